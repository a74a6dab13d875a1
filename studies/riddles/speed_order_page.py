"""The page of the misplaced speeds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.common import REAL, body_track, sign
from studies.riddles.page import COLOURS, Answer, Progress, listed, picture, run_subject, shade_stance, times, told
from studies.riddles.speed_order import (
    CONTACTS,
    FRICTIONS,
    GOALS,
    ONCE,
    ORDER,
    QUICK,
    RIGHT,
    SURE,
    SWEEP,
    SWEPT,
    WEAK,
    Result,
    hypotheses,
    measure,
)
from workbench.robot import RobotModel
from workbench.view.figures import style
from workbench.view.report.page import Part, Table, Text


def speed_order(out: Path, quick: bool, progress: Progress) -> str:
    """Runs the study and writes its page."""
    return run_subject(out, quick, lambda model: measure(model, quick, progress), answer)


def answer(r: Result, model: RobotModel) -> Answer:
    """What was found, as a page."""
    figures: dict[str, Figure] = {}
    found = r.pairs[ORDER, RIGHT]
    worst = found.worst()
    first = min(r.sure_after, key=lambda j: r.sure_after[j])
    headline = (
        f"Misplaced speeds would show in every recorded joint, {times(min(map(found.sigma, found.compared.joints)))} to "
        f"{times(found.sigma(worst))} sigma off, {worst} most, and in {first} {1e3 * r.sure_after[first]:.0f} ms after the "
        f"first command. They turn the walk {_to_a_side(r.ends[ORDER]['ry'].value)} in {r.seconds:.0f} s; the thesis's robot "
        "went straight.")
    question = (
        "In figure 3.4 of the thesis pos.txt lists the goals in the order of bus IDs, speed.txt the speeds in that of names. If "
        "one loop reads both, every servo gets another's speed. Did that happen?")
    shows: list[Part] = [
        _table(r),
        picture(figures, "joints", draw_joints(r), "How far each joint of a recording is from the simulation of the right "
                                                   "order."),
        picture(figures, "angles", draw_angles(r, model, _shown(r)),
                "Recorded angles in the first two cycles: the joint that tells most, and the one that tells first. A servo "
                "that gets too low a speed never arrives; one that gets 0, which means at once, jumps."),
        _given_table(r),
        picture(figures, "path", draw_paths(r), f"Where the body goes in {r.seconds:.0f} s, seen from above."),
    ]
    return Answer("Riddle: did the speeds reach the wrong servos?", headline, question, hypotheses(), shows, [Text(_decides(r))],
                  [Text(_excluded(r)), _elsewhere_table(r)], [Text(_open())], _numbers(r), figures)


def _to_a_side(turn: float) -> str:
    return f"{abs(turn):.0f} deg to the {'left' if turn > 0 else 'right'}"


def _shown(r: Result) -> tuple[str, ...]:
    """The joint furthest off and the one that is sure first."""
    worst = r.pairs[ORDER, RIGHT].worst()
    rest = {j: t for j, t in r.sure_after.items() if j != worst}
    return worst, min(rest, key=lambda j: rest[j])


def _table(r: Result) -> Table:
    rows = []
    for name in r.runs:
        row = [name]
        for model in (RIGHT, ORDER):
            found = r.pairs[name, model]
            row.append(f"{times(found.sigma(found.worst()))} ({found.worst()})")
        found = r.pairs[name, RIGHT]
        row.append(f"{np.degrees(np.median([c.error for c in found.compared.joints.values()])):.2f}")
        row += [told(r.ends[name][c]) for c in ("x", "z", "ry")]
        rows.append(row)
    rows.append(["thesis: real robot", "–", "–", "–", sign(REAL[0]), sign(REAL[2]), "–"])
    return Table(("recorded", "from right order [sigma]", "from misplaced [sigma]", "median error [deg]", "x [cm]",
                  "z, right [cm]", "heading, left [deg]"), rows,
                 "The worst joint of a recording of each hypothesis against simulations of the right and of "
                 "the misplaced order. ±: floor and spread, where they were run.", emphasis=(0, 1))


def _given_table(r: Result) -> Table:
    swing = r.swing
    rows = [[j, f"{r.given[j]:.2f}" if r.given[j] else "at once", f"{swing[RIGHT][j]:.2f}", f"{swing[ORDER][j]:.2f}",
             times(r.pairs[ORDER, RIGHT].sigma(j)), f"{1e3 * r.sure_after[j]:.0f}" if j in r.sure_after else "–"]
            for j in r.pairs[ORDER, RIGHT].compared.joints]
    return Table(("joint", "speed it gets / its own", "swing / commanded, right order", "the same, misplaced", "sigma",
                  f"{SURE:.0f} noises off after [ms]"), rows,
                 "Speeds are means of the four poses. A speed of 0 means at once.")


def _short(r: Result, name: str, share: float = 0.7) -> list[str]:
    return [j for j, s in r.swing[name].items() if s < share]


def _decides(r: Result) -> str:
    right, wrong = r.pairs[ORDER, RIGHT], r.pairs[RIGHT, ORDER]
    quick = r.pairs[QUICK, RIGHT]
    return (
        f"**Any recording with joint angles, the first {max(r.sure_after.values()):.2f} s of it.** Recorded with misplaced "
        f"speeds, the worst joint is {times(right.sigma(right.worst()))} sigma from the right order; recorded in the right "
        f"order it is {times(wrong.sigma(wrong.worst()))} sigma from the misplaced one; {len(r.sure_after)} of "
        f"{len(right.compared.joints)} joints are {SURE:.0f} noises off within {1e3 * max(r.sure_after.values()):.0f} ms of the "
        "first command. So the thesis's own recording decides it today: lay its joint angles over both simulations. On the bus "
        "it is decided without any recording, by reading each servo's register of moving speed after a pose.\n\n"
        f"**Ramps 0.4 % slow are another matter.** In the walk they are {times(quick.sigma(quick.worst()))} sigma from the "
        f"servo's unit in the worst joint: nothing. A slow sweep of one joint decides: {SWEPT} on the stand from "
        f"{np.degrees(SWEEP):.0f} to {-np.degrees(SWEEP):.0f} deg at a whole count of speed, so that no rounding enters. Its "
        f"recorded slope over the simulated one is {r.sweep[RIGHT].ratio:.5f} ± {r.sweep[RIGHT].sigma:.5f} with the servo's "
        f"unit and {r.sweep[QUICK].ratio:.5f} ± {r.sweep[QUICK].sigma:.5f} with the thesis's, {times(_sweep_sigma(r))} sigma "
        "apart.")


def _sweep_sigma(r: Result) -> float:
    a, b = r.sweep[RIGHT], r.sweep[QUICK]
    return float(abs(a.ratio - b.ratio) / np.hypot(a.sigma, b.sigma))


def _turns(r: Result, name: str) -> list[float]:
    return [turn for (n, *_), (_, _, turn) in r.elsewhere.items() if n == name]


def _excluded(r: Result) -> str:
    off, on = _turns(r, ORDER), _turns(r, RIGHT)
    wrong, right = _short(r, ORDER), _short(r, RIGHT)
    return (
        f"**Direction.** The thesis's robot ended at x {REAL[0]:.2f}, z {sign(REAL[2], 2)} cm: straight. With misplaced speeds "
        f"the simulated one turns by {sign(min(off), 0)} to {sign(max(off), 0)} deg over friction {FRICTIONS[0]} to "
        f"{FRICTIONS[-1]} and both contact models, in the right order by {sign(min(on), 0)} to {sign(max(on), 0)}; floor and "
        f"spread are {r.ends[ORDER]['ry'].doubt:.0f} and {r.ends[RIGHT]['ry'].doubt:.0f} deg. {_straight(r)}\n\n"
        "**Swing.** The thesis (7.2.1) says that the recording misses peaks at the start, and that the tail turns significantly "
        f"less than told, probably the tops too. With misplaced speeds {listed(wrong) or 'no joint'} would swing by less than "
        f"70 % of what is commanded, in the right order {listed(right) or 'no joint'}; the tail would swing by "
        f"{r.swing[ORDER]['tail']:.2f} of it, in the right order by {r.swing[RIGHT]['tail']:.2f}. "
        f"{_swing_says(r, wrong)}\n\n"
        f"**Goals misplaced** (speeds right) would have been seen by eye: the body ends at x {sign(r.ends[GOALS]['x'].value)} "
        f"cm with a heading of {sign(r.ends[GOALS]['ry'].value, 0)} deg.")


def _straight(r: Result) -> str:
    least = min(abs(t) for t in _turns(r, ORDER))
    most = max(abs(t) for t in _turns(r, RIGHT))
    if least > 2 * most:
        return ("No condition that was tried brings a walk with misplaced speeds near straight, so that the thesis's straight "
                "end speaks clearly against them, as far as this model walks like the robot.")
    return "The ranges are not far apart, so that direction alone does not exclude them."


def _swing_says(r: Result, wrong: list[str]) -> str:
    said = []
    legs = [j for j in wrong if j[-1] in "bm"]
    if legs:
        said.append(f"That thighs and shanks ({listed(legs)}) fall that short does not fit the thesis, which names tail and tops "
                    f"alone.")
    if r.swing[ORDER]["tail"] > 1:
        said.append("Nor does a tail that turns further than told.")
    return " ".join(said) or "That alone does not speak against it."


def _open() -> str:
    return ("The exclusion by direction leans on a model whose signs and feet are a choice (studies.joint_signs). That by joint "
            "angles would not, but the thesis prints them only as a figure. Reading the recording itself settles it.")


def _elsewhere_table(r: Result) -> Table:
    rows = []
    for contact in CONTACTS:
        for friction in (f for f in FRICTIONS if (ORDER, f, contact) in r.elsewhere):
            row = [f"{friction:g}", contact]
            for name in (RIGHT, ORDER):
                x, z, turn = r.elsewhere[name, friction, contact]
                row += [sign(x), sign(z), sign(turn, 0)]
            rows.append(row)
    ends = ("x [cm]", "z [cm]", "turn [deg]")
    return Table(("friction", "contact", *(f"right: {ends[0]}", *ends[1:]), *(f"misplaced: {ends[0]}", *ends[1:])), rows)


def _numbers(r: Result) -> dict[str, object]:
    return {
        "sigma": {f"{a} | {b}": {j: p.sigma(j) for j in p.compared.joints} for (a, b), p in r.pairs.items()},
        "sure_after_s": dict(r.sure_after), "speed_ratio": dict(r.given), "swing": {n: dict(s) for n, s in r.swing.items()},
        "ends": {n: {c: [v.value, float(np.nan_to_num(v.floor)), float(np.nan_to_num(v.spread))] for c, v in e.items()}
                 for n, e in r.ends.items()},
        "elsewhere": {" ".join(map(str, k)): list(v) for k, v in r.elsewhere.items()},
        "sweep": {n: [s.ratio, s.sigma] for n, s in r.sweep.items()}, "sweep_sigma": _sweep_sigma(r)}


@style.styled
def draw_joints(r: Result) -> Figure:
    """Sigma of each joint for each recorded hypothesis, logarithmic, with the contract's bound."""
    figure = style.new_figure(12, 4.8)
    axes = figure.subplots()
    names = [n for n in r.runs if n != GOALS]
    joints = list(r.pairs[ORDER, RIGHT].compared.joints)
    for k, name in enumerate(names):
        at = np.arange(len(joints)) + (k - len(names) / 2 + 0.5) * 0.16
        axes.bar(at, [r.pairs[name, RIGHT].sigma(j) for j in joints], 0.16, color=COLOURS[list(r.runs).index(name)], label=name)
    axes.axhline(1.3, color=style.ERROR, lw=1, ls="--", label="1.3: nothing is claimed below")
    axes.set_yscale("log")
    axes.set_xticks(range(len(joints)), joints)
    axes.set_ylabel("from the right order [sigma]")
    axes.grid(False, axis="x")
    style.legend_above(axes)
    return figure


@style.styled
def draw_angles(r: Result, model: RobotModel, joints: tuple[str, ...]) -> Figure:
    """Recorded angles of some joints in the first two cycles under each order; stance of their foot in the right order shaded."""
    figure = style.new_figure(12, 3.4 * len(joints))
    grid: list[Axes] = list(np.atleast_1d(figure.subplots(len(joints), 1, sharex=True)))
    until = min(0.94, r.seconds)
    for axes, joint in zip(grid, joints):
        sent = r.runs[RIGHT].take.commands
        assert sent is not None
        clock = np.linspace(-0.1, until, 500)
        axes.plot(clock, np.degrees(sent.reference(clock)[:, sent.column(joint)]), color=style.COMMAND, ls="--", lw=1.3,
                  label="ramp that was meant")
        for name in (RIGHT, ORDER, ONCE, WEAK):
            take = r.pairs[name, RIGHT].recorded.take
            seen = (take.since_start > -0.1) & (take.since_start < until)
            axes.plot(take.since_start[seen], np.degrees(take.q[seen, take.column(joint)]),
                      color=COLOURS[list(r.runs).index(name)], lw=1.6, label=name)
        if joint[:2] in ("fl", "fr", "bl", "br"):
            shade_stance([axes], r.pairs[RIGHT, RIGHT].recorded.take, model, f"{joint[:2]}b")
        axes.set_ylabel(f"{joint} [deg]")
        axes.set_xlim(-0.1, until)
        style.legend_above(axes)
    grid[-1].set_xlabel("time since the first command [s]")
    return figure


@style.styled
def draw_paths(r: Result) -> Figure:
    """The body from above under each hypothesis; the thesis's end."""
    figure = style.new_figure(9, 6)
    axes = figure.subplots()
    for k, (name, run) in enumerate(r.runs.items()):
        track = body_track(run.take, np.linspace(0.0, r.seconds - 2e-3, 300))
        axes.plot(track[:, 0], -track[:, 2], color=COLOURS[k], label=name, lw=2.2 if name in (RIGHT, ORDER) else 1.3)
        axes.plot(track[-1, 0], -track[-1, 2], "o", color=COLOURS[k], ms=6)
    axes.plot(REAL[0], -REAL[2], "<", color=style.ERROR, ms=11, label="thesis: real robot")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x, forward [cm]")
    axes.set_ylabel("to the left [cm]")
    axes.legend(loc="best")
    return figure
