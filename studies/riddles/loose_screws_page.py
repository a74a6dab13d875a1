"""The page of the drift to the left."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.common import sign
from studies.riddles.apart import sigma
from studies.riddles.loose_screws import (
    ACROSS,
    ASKEW,
    BACKLASH,
    BACKLASH_LEG,
    LEG,
    PLAY,
    PLAYS,
    SHORT,
    SLIP,
    SOUGHT,
    TIGHT,
    TILT,
    WEAK,
    Result,
    hypotheses,
    measure,
)
from studies.riddles.page import Answer, Progress, listed, picture, run_subject, shade_stance, times, told
from workbench.compare.metrics import heading
from workbench.robot import RobotModel
from workbench.view.figures import style
from workbench.view.report.page import Part, Table, Text

BOUND = 1.3
"""Sigma below which nothing is claimed (docs/formats.md, section 6)."""
LOOSE = tuple(f"loose {j} {a}" for j in LEG for a in ACROSS[j])
RIVALS = (BACKLASH, BACKLASH_LEG, WEAK, TILT, SLIP, SHORT)
SHOWN = f"loose {SOUGHT[0]} {SOUGHT[1]}"


def loose_screws(out: Path, quick: bool, progress: Progress) -> str:
    """Runs the study and writes its page."""
    return run_subject(out, quick, lambda model: measure(model, quick, progress), answer)


def answer(r: Result, model: RobotModel) -> Answer:
    """What was found, as a page."""
    figures: dict[str, Figure] = {}
    off = {n: off_axis(r, n) for n in LOOSE}
    rivals = {n: off_axis(r, n) for n in RIVALS}
    drifts = [r.drift(n) for n in LOOSE]
    headline = (
        f"A screw that is loose by {PLAY:g} deg shows as rotation that the joint's servo does not turn, "
        f"{times(min(off.values()))} to {times(max(off.values()))} sigma in that joint alone; its rivals show at most "
        f"{times(max(rivals.values()))} ({max(rivals, key=lambda n: rivals[n])}). The drift itself decides nothing: the same "
        f"play turns the walk by {sign(min(drifts), 0)} to {sign(max(drifts), 0)} deg (positive: left), depending on which "
        "screw it is.")
    question = (
        "The thesis (8.1) saw its robot drift to the left where the simulation drifted slightly to the right, found loose "
        "screws in the front left leg, and took them for the cause. What would a recording show of loose screws, and what of "
        "anything else that makes a robot drift?")
    shows: list[Part] = [
        _table(r),
        picture(figures, "channels", draw_channels(r),
                "Two channels of each recording against the simulation with all screws tight: the drift over floor and spread "
                "of the heading, and the rotation off its axis of the front left joint that shows most."),
        picture(figures, "off_axis", draw_off_axis(r, model),
                f"What the servo of {SOUGHT[0]} does not turn, in the first three cycles: loose screws, backlash, and tight. "
                "Noise is the cameras'."),
        picture(figures, "heading", draw_heading(r),
                f"Heading in {r.seconds:.0f} s. Bars at the end: floor and spread of the tight robot's."),
    ]
    return Answer("Riddle: do loose screws make it drift to the left?", headline, question, hypotheses(), shows,
                  [Text(_decides(r)), _small_table(r)], [Text(_excluded(r))], [Text(_open(r))], _numbers(r), figures)


def off_axis(r: Result, name: str) -> float:
    """The largest sigma off its axis of a front left joint."""
    return max(sigma(r.found[name].off_axis[j]) for j in LEG)


def _off_joint(r: Result, name: str) -> str:
    return max(LEG, key=lambda j: sigma(r.found[name].off_axis[j]))


def _table(r: Result) -> Table:
    rows = []
    for name, found in r.found.items():
        j, worst = _off_joint(r, name), found.worst()
        rows.append([name, told(r.ends[name]["ry"]), sign(r.drift(name)), told(r.ends[name]["z"]), times(off_axis(r, name)), j,
                     f"{np.degrees(found.off_axis[j].error):.2f}", times(found.sigma(worst)), worst])
    return Table(("recorded", "heading, left [deg]", "more than tight", "z, right [cm]", "off axis [sigma]", "of", "[deg]",
                  "worst angle [sigma]", "of"), rows,
                 "Against the simulation with all tight. Off axis: rotation that no servo turns, of the front "
                 "left joint that shows most; noise alone is 1 and 0.25 deg. Worst angle: of all 13 recorded "
                 "joints.", emphasis=(0,))


def _small_table(r: Result) -> Table:
    rows = [[f"{p:g}", times(r.small[p][0]), times(r.small[p][1])] for p in PLAYS if p in r.small]
    shown = r.found[SHOWN]
    rows.append([f"{PLAY:g}", times(sigma(shown.off_axis[SOUGHT[0]])), times(shown.sigma(shown.worst()))])
    return Table((f"play of {SOUGHT[0]} about {SOUGHT[1]} [deg]", "off axis [sigma]", "worst angle [sigma]"), rows)


def _least(r: Result) -> str:
    seen = [p for p in PLAYS if p in r.small and r.small[p][0] > BOUND]
    return f"{min(seen):g} deg" if seen else f"{PLAY:g} deg"


def _off_too(r: Result) -> list[str]:
    """Rivals that show off an axis, too."""
    return [f"{n} ({times(off_axis(r, n))})" for n in RIVALS if off_axis(r, n) > BOUND]


def _decides(r: Result) -> str:
    there, back = r.turned_round["there"], r.turned_round["back"]
    angle = {n: r.found[n].sigma(r.found[n].worst()) for n in RIVALS}
    known = [n for n, s in angle.items() if s > BOUND]
    unknown = [n for n, s in angle.items() if s <= BOUND]
    named = listed([f"{n} ({r.found[n].worst()}, {times(angle[n])} sigma)" for n in known])
    return (
        "**The rotation across the servo's axis.** The cameras record each rigid body's whole rotation, so this is in the "
        "thesis's own recordings; its animation plays it back (gimbal joints), its simulation leaves it out. A loose "
        f"mount moves it in its own joint, from {_least(r)} of play on; of the rivals {listed(_off_too(r)) or 'none'} beyond "
        f"{BOUND} sigma.\n\n"
        f"**The rivals by other channels.** {named or 'No rival'} change a joint's angle by more than {BOUND}; "
        f"{listed(unknown) or 'none'} leave every angle within it. A tilted floor: walk there and back. Over 1 deg the robot "
        f"ends {sign(there[1])} cm to the right with the slope falling to its left, {sign(back[1])} cm with the slope falling "
        f"to its right: the part that changes sides is the floor's, the rest the robot's. The capture's axes: {ASKEW:g} deg "
        f"askew move a straight robot's end by {sign(r.askew[0])} cm to the right in the capture's own z, and by "
        f"{sign(r.askew[1], 2)} cm after registration, which takes the heading from the robot's own joints.")


def _excluded(r: Result) -> str:
    tight, shown = r.ends[TIGHT]["ry"], r.ends[SHOWN]["ry"]
    sure = [n for n in LOOSE if r.drift_sigma(n) > BOUND]
    left, right = ([n for n in sure if side * r.drift(n) > 0] for side in (1, -1))
    beyond = (
        f"Beyond {BOUND} times the doubt (the tight robot's where a hypothesis's own was not run) {listed(left) or 'none'} of "
        f"the loose mounts turn the walk to the left and {listed(right) or 'none'} to the right.")
    side = ("So which side the robot drifted to does not point at that leg." if right else
            "So a drift to the left is what loose screws there would do." if left else
            "So the drift's side is no evidence either way.")
    return (
        "The thesis gives no number for the drift, and after the repair its robot ended 0.1 cm left of straight. So nothing is "
        "excluded by numbers. What is measured here: heading is a poor witness. Numerics and the contact model alone move the "
        f"end's heading by {tight.doubt:.1f} deg (tight) and {shown.doubt:.1f} deg ({SHOWN}). {beyond} {side} That the drift was "
        "gone after the screws were tightened is good evidence that they caused it.")


def _open(r: Result) -> str:
    return (f"How loose the screws were and where. {PLAY:g} deg is our choice, and the mount's play here is nearly free of "
            "friction; a screw that slips and sticks shows less and drifts otherwise. Signs and feet of the model are a choice "
            "(studies.joint_signs), and which way a loose leg turns the walk depends on them.")


def _numbers(r: Result) -> dict[str, object]:
    return {
        "ends": {n: {c: [v.value, float(np.nan_to_num(v.floor)), float(np.nan_to_num(v.spread))] for c, v in e.items()}
                 for n, e in r.ends.items()},
        "off_axis_sigma": {n: {j: sigma(c) for j, c in f.off_axis.items()} for n, f in r.found.items()},
        "off_axis_deg": {n: {j: float(np.degrees(c.error)) for j, c in f.off_axis.items()} for n, f in r.found.items()},
        "angle_sigma": {n: {j: f.sigma(j) for j in f.compared.joints} for n, f in r.found.items()},
        "drift_deg": {n: r.drift(n) for n in r.ends},
        "drift_sigma": {n: r.drift_sigma(n) for n in r.ends if np.isfinite(r.drift_sigma(n))},
        "small_play": {str(p): list(v) for p, v in r.small.items()},
        "turned_round": {n: list(v) for n, v in r.turned_round.items()}, "askew_cm": list(r.askew)}


@style.styled
def draw_channels(r: Result) -> Figure:
    """Drift with its doubt, and sigma off axis, a row a hypothesis."""
    names = list(r.found)
    figure = style.new_figure(12, 0.36 * len(names) + 1.6)
    left, right = figure.subplots(1, 2, sharey=True)
    tight = r.ends[TIGHT]["ry"]
    doubt = float(np.nan_to_num(tight.doubt))
    left.axvspan(tight.value - doubt, tight.value + doubt, color=style.FLOOR, alpha=0.5, lw=0, label="tight: floor and spread")
    for row, name in enumerate(names):
        colour = style.RECORDED if name in LOOSE else style.SIMULATED if name == TIGHT else style.ACCENT
        end = r.ends[name]["ry"]
        left.errorbar(end.value, row, xerr=np.nan_to_num(end.doubt), fmt="o", color=colour, ms=7, capsize=3)
        right.barh(row, off_axis(r, name), color=colour, height=0.65)
        right.text(off_axis(r, name) + 0.1, row, times(off_axis(r, name)), va="center", fontsize=10)
    right.axvline(BOUND, color=style.ERROR, lw=1, ls="--", label=f"{BOUND}: nothing is claimed below")
    left.set_yticks(range(len(names)), names)
    left.invert_yaxis()
    left.set_xlabel("heading at the end, left [deg]")
    right.set_xlabel("off its axis, front left joint that shows most [sigma]")
    for axes in (left, right):
        axes.grid(False, axis="y")
        style.legend_above(axes)
    return figure


@style.styled
def draw_off_axis(r: Result, model: RobotModel) -> Figure:
    """SOUGHT's rotation about its loose axis in three cycles; stance shaded."""
    joint, axis = SOUGHT
    figure = style.new_figure(12, 6.4)
    grid: list[Axes] = list(figure.subplots(3, 1, sharex=True, sharey=True))
    for axes, name, colour in zip(grid, (SHOWN, BACKLASH, TIGHT), (style.RECORDED, style.ACCENT, style.SIMULATED)):
        take = r.found[name].recorded.take
        assert take.off_axis is not None
        seen = (take.since_start > -0.2) & (take.since_start < min(1.41, r.seconds))
        swing = np.degrees(take.off_axis[seen, take.column(joint), "xyz".index(axis)])
        axes.plot(take.since_start[seen], swing, color=colour, lw=1.4, label=name)
        shade_stance([axes], take, model, "flb")
        axes.set_ylabel("[deg]")
        axes.set_xlim(-0.2, min(1.41, r.seconds))
        style.legend_above(axes)
    grid[0].set_title(f"{joint}, about the {'forward' if axis == 'x' else axis} axis")
    grid[-1].set_xlabel("time since the first command [s]")
    return figure


@style.styled
def draw_heading(r: Result) -> Figure:
    """Heading over time: loose screws on the left, rivals on the right."""
    figure = style.new_figure(12, 5)
    grid = figure.subplots(1, 2, sharey=True)
    palette = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
    tight = r.ends[TIGHT]["ry"]
    for axes, names, title in zip(grid, (LOOSE, RIVALS), (f"loose by {PLAY:g} deg", "rivals")):
        _heading(axes, r, TIGHT, "#000000", 2.6)
        for name, colour in zip(names, palette):
            _heading(axes, r, name, colour, 1.4)
        axes.errorbar(r.seconds, tight.value, yerr=np.nan_to_num(tight.doubt), color="#000000", capsize=4)
        axes.set_title(title)
        axes.set_xlabel("time since the first command [s]")
        axes.legend(loc="upper left", ncols=2, fontsize=9)
    grid[0].set_ylabel("heading, left [deg]")
    return figure


def _heading(axes: Axes, r: Result, name: str, colour: str, width: float) -> None:
    take = r.found[name].recorded.take
    assert take.quat_WB is not None
    turn = np.degrees(heading(take.quat_WB))
    seen = take.since_start >= 0
    axes.plot(take.since_start[seen], (turn - turn[take.resting].mean())[seen], color=colour, lw=width, label=name)
