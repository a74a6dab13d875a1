"""The page of the growing lag."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.common import sign
from studies.riddles.apart import Growth
from studies.riddles.cameras import RATE
from studies.riddles.page import COLOURS, Answer, Progress, picture, run_subject, shade_stance, times
from studies.riddles.rounding import (
    CLOCK,
    CYCLES,
    EXACT,
    FADE,
    PACKET,
    ROUNDED,
    SAG,
    SLOWER,
    SYNC_WRITE,
    UP,
    WEAK,
    Result,
    hypotheses,
    measure,
    rounding_errors,
)
from workbench.motion import interpolate_motion
from workbench.robot import RobotModel
from workbench.view.figures import style
from workbench.view.report.page import Part, Table, Text

SHOWN = "flb"
"""The joint that the thesis shows most."""


def rounding(out: Path, quick: bool, progress: Progress) -> str:
    """Runs the study and writes its page."""
    return run_subject(out, quick, lambda model: measure(model, quick, progress), answer)


def answer(r: Result, model: RobotModel) -> Answer:
    """What was found, as a page."""
    figures: dict[str, Figure] = {}
    per_pose, per_second = 1e3 * SYNC_WRITE, 1e3 * r.lagging[PACKET].long.slope
    worst = 1e3 * np.abs(rounding_errors(r.motion, CYCLES)[1]).max()
    headline = (
        f"Rounding cannot make a lag that grows: in this walk it never exceeds {worst:.1f} ms and is gone after every cycle. "
        f"{per_pose:.2f} ms lost at each pose, the time of its packet, would make {per_second:.1f} ms a second. How fast a "
        f"recording of {r.seconds:.0f} s lags shows which, and one with dwells twice as long tells loss per pose from a slow "
        "clock.")
    question = (
        "The thesis (7.2.1) sees the recording lag behind the ROBOTIS angles more and more and suspects the rounding of the "
        "dwells to milliseconds. What would its recording show if that were so, and what if something else is late?")
    shows: list[Part] = [
        picture(figures, "rounding_errors", draw_errors(r),
                "By how much rounding alone brings a pose late, from the table: four errors that cancel in every cycle."),
        picture(figures, "lag", draw_lag(r),
                "Lag of the recorded joints behind the ROBOTIS angles (median over 13 joints, windows of two cycles). Servos "
                f"are always behind, by {1e3 * r.lagging[ROUNDED].long.at_start:.0f} ms here; what matters is the slope. Band: "
                "the doubt of the rounded walk's slope (standard error, floor, spread)."),
        _table(r),
        picture(figures, "end", draw_end(r, model),
                f"{SHOWN} in the last cycles as the cameras would have seen it. Rounded or not is one curve to the eye; what "
                f"is {1e3 * r.seconds * r.lagging[PACKET].long.slope:.0f} ms late by then is not."),
    ]
    return Answer(
        "Riddle: why does the recording lag more and more?", headline, question, hypotheses(r.motion), shows, _decides(r),
        [Text(_excluded(r))], [Text(_open(r))], _numbers(r), figures)


def _table(r: Result) -> Table:
    rows = []
    for name, x in r.lagging.items():
        rows.append([name, _slope(x.short), _slope(x.long), sign(1e3 * r.seconds * x.long.slope, 0),
                     _joints(r, name), sign(1e3 * x.long.at_start, 0), f"{x.amplitude:.2f}"])
    return Table(
        ("hypothesis", f"growth in {r.short:.0f} s [ms/s]", f"in {r.seconds:.0f} s [ms/s]", "lag added by the end [ms]",
         "growth, joint by joint [ms/s]", "constant lag [ms]", "smallest swing left"), rows,
        "± is the standard error of the slope in one recording. Numerical floor and contact spread of the slope of the rounded "
        f"walk: {1e3 * r.slope.doubt:.2f} ms/s in {r.short:.0f} s, which is also taken for {r.seconds:.0f} s. Last column: "
        "swing in the last three cycles over that in the first, of the joint that keeps least.")


def _joints(r: Result, name: str) -> str:
    slopes = r.lagging[name].long.by_joint.values()
    return f"{sign(1e3 * min(slopes), 2)} to {sign(1e3 * max(slopes), 2)}"


def _slope(g: Growth) -> str:
    return f"{sign(1e3 * g.slope, 2)} ± {1e3 * g.sigma:.2f}"


def sigma_short(r: Result, name: str, long: bool = False) -> float:
    """By how many sigma (standard error, floor, spread) a hypothesis's growth differs from that of the rounded walk."""
    mine, other = ((x.long if long else x.short) for x in (r.lagging[name], r.lagging[ROUNDED]))
    return float(abs(mine.slope - other.slope) / np.sqrt(mine.sigma**2 + other.sigma**2 + r.slope.doubt**2))


def slower_sigma(r: Result) -> float:
    """By how many sigma loss per pose and slow clock differ in the slower walk."""
    a, b = r.slower[PACKET], r.slower[CLOCK]
    return float(abs(a.slope - b.slope) / np.sqrt(a.sigma**2 + b.sigma**2 + r.slope.doubt**2))


def _decides(r: Result) -> list[Text | Table]:
    together, rounded = r.pairs[PACKET, CLOCK], r.pairs[EXACT, ROUNDED]
    first = Text(
        f"**The slope over {r.seconds:.0f} s.** Loss per pose stands {times(sigma_short(r, PACKET, True))} sigma from rounding "
        f"there, {times(sigma_short(r, PACKET))} in {r.short:.0f} s; the very worst rounding {times(sigma_short(r, UP, True))} "
        f"and {times(sigma_short(r, UP))}. Rounded and exact dwells cannot be told apart by any joint ({rounded.worst()} "
        f"{times(rounded.sigma(rounded.worst()))} sigma; without noise, at a step that resolves the dwells, "
        f"{np.degrees(r.same):.2f} deg RMS at most).\n\n"
        f"**Loss per pose or a slow clock?** Played once they make the same recording: {r.seconds:.0f} s of one against the "
        f"other differ by {times(together.sigma(together.worst()))} sigma in the worst joint ({together.worst()}). Play the "
        f"same poses with every dwell {SLOWER:g} times as long: a loss per pose then halves its slope, a clock keeps it "
        f"({times(slower_sigma(r))} sigma apart).\n\n"
        f"**Timing or power?** Timing makes all joints late alike ({_joints(r, PACKET)} ms/s) and leaves their swing as it was. "
        f"Motors that fade do not: {_joints(r, FADE)} ms/s, joint by joint, and the worst joint's swing shrinks to "
        f"{r.lagging[FADE].amplitude:.2f} of what it was ({r.lagging[ROUNDED].amplitude:.2f} in the rounded walk).")
    rows = [[n, _slope(r.lagging[n].long), _slope(r.slower[n])] for n in (ROUNDED, PACKET, CLOCK)]
    return [first, Table(("hypothesis", "growth, dwells as they are [ms/s]", f"dwells × {SLOWER:g} [ms/s]"), rows)]


def _excluded(r: Result) -> str:
    worst = 1e3 * np.abs(rounding_errors(r.motion, CYCLES)[1]).max()
    most = 0.5 * len(r.motion.times[1:]) / r.motion.duration
    return (
        "The thesis prints the dwells of figure 3.4, 140, 103, 94 and 131 ms, and the times they come from, 0.1404, 0.2436, "
        f"0.3372 and 0.468 s. The sum of both is 468 ms: rounding adds nothing from cycle to cycle and {worst:.1f} ms at most "
        f"within one, where a camera frame is {1e3 / RATE:.1f} ms. **Rounding is excluded by the thesis's own table**, unless "
        "the program held other dwells than it prints. At the very worst, for a walk whose dwells all end on half a "
        f"millisecond, it would be {most:.1f} ms/s. Moving speeds are rounded too, and ramps are 0.4 % slow; both are in the "
        f"rounded walk, whose lag grows by {_slope(r.lagging[ROUNDED].long)} ms/s. A weak supply is late by a constant amount "
        "and does not lag more and more.")


def _open(r: Result) -> str:
    fade, sag, weak = (1e3 * r.lagging[n].long.slope for n in (FADE, SAG, WEAK))
    return (
        "The thesis gives no number for its lag, so that none of the rest is excluded. Supply hypotheses grow by "
        f"{sign(weak, 2)} (weak), {sign(sag, 2)} (sagging) and {sign(fade, 2)} ms/s (warming by 2 % a second). The packet's "
        "time is computed from the protocol; what the program's loop takes besides, and whether the wait starts before or after "
        "sending, is not in the thesis. Whose clock is off, the controller's or the cameras', no recording of the robot alone "
        "can tell: film a stopwatch.")


def _numbers(r: Result) -> dict[str, object]:
    return {
        "rounding_worst_ms": float(1e3 * np.abs(rounding_errors(r.motion, CYCLES)[1]).max()),
        "growth_ms_per_s": {
            n: {"short": 1e3 * x.short.slope, "short_sigma": 1e3 * x.short.sigma, "long": 1e3 * x.long.slope,
                "long_sigma": 1e3 * x.long.sigma, "constant_lag_ms": 1e3 * x.long.at_start, "swing_left": x.amplitude}
            for n, x in r.lagging.items()},
        "slower_ms_per_s": {n: [1e3 * g.slope, 1e3 * g.sigma] for n, g in r.slower.items()},
        "floor_and_spread_ms_per_s": [1e3 * r.slope.floor, 1e3 * r.slope.spread],
        "sigma_from_rounded": {n: [sigma_short(r, n), sigma_short(r, n, True)] for n in r.lagging if n != ROUNDED},
        "per_pose_against_clock_sigma": {"walk": r.pairs[PACKET, CLOCK].sigma(r.pairs[PACKET, CLOCK].worst()),
                                         "slower": slower_sigma(r)},
        "rounded_against_exact": {"sigma": r.pairs[EXACT, ROUNDED].sigma(r.pairs[EXACT, ROUNDED].worst()),
                                  "rms_deg": float(np.degrees(r.same))}}


@style.styled
def draw_errors(r: Result) -> Figure:
    """Lateness of each pose by rounding, in the first cycles; every other cycle shaded."""
    due, late = rounding_errors(r.motion, 4)
    figure = style.new_figure(10, 3.6)
    axes = figure.subplots()
    axes.step(due, 1e3 * late, where="post", color=style.SIMULATED, lw=1.5)
    axes.plot(due, 1e3 * late, "o", color=style.SIMULATED, ms=5, label="a pose goes out")
    for k in range(0, 4, 2):
        axes.axvspan(k * r.motion.duration, (k + 1) * r.motion.duration, color=style.STANCE, lw=0, zorder=0.5,
                     label="every other gait cycle" if k == 0 else None)
    axes.axhline(0, color="#999999", lw=0.8)
    axes.set_ylabel("late by rounding [ms]")
    axes.set_xlabel("time since the first command [s]")
    style.legend_above(axes)
    return figure


@style.styled
def draw_lag(r: Result) -> Figure:
    """Growth of the lag over time: timing on the left, power on the right, on one scale."""
    figure = style.new_figure(12, 5.2)
    grid = figure.subplots(1, 2, sharey=True)
    for axes, names, title in zip(grid, ((ROUNDED, EXACT, UP, PACKET, CLOCK), (ROUNDED, WEAK, SAG, FADE)),
                                  ("timing", "power")):
        _lags(axes, r, names)
        axes.set_title(title)
        axes.set_xlabel("time since the first command [s]")
        axes.legend(loc="upper left")
    grid[0].set_ylabel("lag behind the ROBOTIS angles [ms]")
    return figure


def _lags(axes: Axes, r: Result, names: tuple[str, ...]) -> None:
    order = list(r.lagging)
    for name in names:
        time, late = r.lagging[name].track
        dashed = name in (EXACT, CLOCK)
        axes.plot(time, 1e3 * np.nanmedian(late, axis=1), color=COLOURS[order.index(name)], ls="--" if dashed else "-",
                  lw=2.4 if dashed else 1.6, label=name)
    base = r.lagging[ROUNDED].long
    span = np.array([0.0, r.seconds])
    doubt = r.slope.doubt + base.sigma
    low, high = (1e3 * (base.at_start + (base.slope + s * doubt) * span) for s in (-1, 1))
    axes.fill_between(span, low, high, color=style.FLOOR, alpha=0.5, lw=0)


@style.styled
def draw_end(r: Result, model: RobotModel) -> Figure:
    """SHOWN in the last two cycles under three hypotheses, beside the table's angles; its foot's stance shaded."""
    figure = style.new_figure(12, 4.6)
    axes = figure.subplots()
    begin = r.seconds - 2 * r.motion.duration
    reference = interpolate_motion(r.motion, CYCLES + 1, 1e-3, "rest")
    use = (reference.time >= begin) & (reference.time <= r.seconds)
    axes.plot(reference.time[use], np.degrees(reference.q[use, reference.column(SHOWN)]), color=style.COMMAND, ls="--", lw=1.4,
              label="ROBOTIS angles")
    order = list(r.lagging)
    for name in (ROUNDED, EXACT, PACKET, CLOCK):
        take = r.lagging[name].recorded
        clock = take.since_start
        seen = (clock >= begin) & (clock <= r.seconds)
        axes.plot(clock[seen], np.degrees(take.q[seen, take.column(SHOWN)]), color=COLOURS[order.index(name)],
                  ls="--" if name in (EXACT, CLOCK) else "-", lw=2.4 if name in (EXACT, CLOCK) else 1.6, label=name)
    shade_stance([axes], r.lagging[ROUNDED].recorded, model, SHOWN)
    axes.set_xlim(begin, r.seconds)
    axes.set_ylabel(f"{SHOWN} [deg]")
    axes.set_xlabel("time since the first command [s]")
    style.legend_above(axes)
    return figure
