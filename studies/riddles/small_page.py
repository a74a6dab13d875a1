"""The page of the smaller riddles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.common import sign
from studies.riddles.hypotheses import Hypothesis, walk
from studies.riddles.page import Answer, Progress, listed, picture, run_subject, shade_stance, times
from studies.riddles.small import AFTER, ALL, LAST, WALKED, Result, measure
from workbench.robot import RobotModel
from workbench.view.figures import style
from workbench.view.report.page import Part, Table, Text

LATE = np.radians(1.0)
"""From here on a joint is said to be late."""


def small(out: Path, quick: bool, progress: Progress) -> str:
    """Runs the study and writes its page."""
    return run_subject(out, quick, lambda model: measure(model, progress), answer)


def answer(r: Result, model: RobotModel) -> Answer:
    """What was found, as a page."""
    figures: dict[str, Figure] = {}
    joint, apart = last_pose(r)
    late, once = late_joints(r), only_once(r)
    worst = max(late, key=lambda j: r.late[j][0])
    headline = (
        f"A last pose that is never sent leaves {joint} {np.degrees(apart):.0f} deg from where it should stand; the first pose "
        f"is missed by up to {np.degrees(r.late[worst][1]):.0f} deg ({worst}), once; the body leans back by "
        f"{r.lean['servo law']:.1f} deg, which a recording zeroed in neutral does not show.")
    question = "Three small things in the thesis that a recording, or a level, would settle."
    hypotheses = [Hypothesis(ALL, "All poses of all cycles are sent."),
                  Hypothesis(LAST, "Algorithm 3.1 read literally: the program steps on, sees the last pose and resets before it "
                                   "is sent.")]
    shows: list[Part] = [
        picture(figures, "last_pose", draw_last(r, model, joint), f"{joint} at the end of {WALKED} cycles, as recorded."),
        _last_table(r),
        picture(figures, "first_pose", draw_first(r, model, worst),
                f"{worst} in the first two cycles: from neutral it has further to go than from the last pose, at the same "
                "speed."),
        _late_table(r),
    ]
    decides = [Text(
        f"**The last pose.** Where the joints stand after the walk. {joint} is {np.degrees(apart):.1f} deg apart, "
        f"{times(apart / (np.sqrt(2.0) * r.noise))} times the noise of such a mean; the walk need only be recorded to its "
        "end.\n\n"
        f"**The first pose.** When pose 2 is sent, the ramps of {listed(late) or 'no joint'} have not reached pose 1 in the "
        f"first cycle by more than {np.degrees(LATE):.0f} deg, {worst} by {np.degrees(r.late[worst][0]):.1f}; recorded, "
        f"{worst} is {np.degrees(r.late[worst][1]):.1f} deg short then and {np.degrees(r.late[worst][2]):.1f} in later cycles. "
        f"{once} So it explains the missed peaks at the start and no lag that grows.\n\n"
        "**The lean.** Geometry alone (hind feet against front feet, joints at neutral) leans the body back by "
        f"{sign(r.lean['geometry'], 2)} deg; at rest it leans by {sign(r.lean['ideal joints'], 2)} deg with ideal joints and "
        f"{sign(r.lean['servo law'], 2)} deg with the servo law, whose joints give under the weight; in the walk by "
        f"{sign(r.lean['walk'], 2)} deg on average. The recording does not show it: Motive's frames are made parallel to the "
        "room in the neutral pose as it stands, so that the lean is its zero. A level on the body, or the heights of a front "
        "and a hind marker, would.")]
    excluded = [Text(
        "The thesis's simulation starts with a small positive z rotation (7.2.2), which it explains by the shorter hind legs: "
        f"here {sign(r.lean['ideal joints'], 2)} deg with ideal joints, as it simulated. Its figure 7.2 shows missed peaks at "
        "the start, which fits the first pose. Nothing in it speaks about the last pose.")]
    return Answer("Smaller riddles", headline, question, hypotheses, shows, decides, excluded, [], _numbers(r), figures)


def last_pose(r: Result) -> tuple[str, float]:
    """The joint that stands furthest from where it should without its last pose, and by how much [rad]."""
    off = {j: abs(r.stands[LAST][j] - a) for j, a in r.stands[ALL].items()}
    joint = max(off, key=lambda j: off[j])
    return joint, off[joint]


def late_joints(r: Result) -> list[str]:
    """Joints whose ramp has not reached pose 1 when pose 2 is sent, in the first cycle."""
    return [j for j, (ramp, *_) in r.late.items() if ramp > LATE]


def only_once(r: Result) -> str:
    """Whether joints are late in the first cycle alone."""
    extra = {j: first - later for j, (_, first, later) in r.late.items() if j in late_joints(r)}
    same = [j for j, x in extra.items() if abs(x) < LATE]
    return ("All of them are late once only." if not same else
            f"{listed(same)} {'is' if len(same) == 1 else 'are'} as far off in every later cycle, for another reason than the "
            "start.")


def _last_table(r: Result) -> Table:
    rows = [[j, sign(np.degrees(a)), sign(np.degrees(r.stands[LAST][j])), sign(np.degrees(r.stands[LAST][j] - a))]
            for j, a in r.stands[ALL].items()]
    return Table(("joint", "stands at, all poses [deg]", "last pose missing [deg]", "difference [deg]"), rows,
                 f"Means over the last quarter of a second of the recording, which ends {AFTER} s after {WALKED} cycles; "
                 "against the rest before the walk.")


def _late_table(r: Result) -> Table:
    rows = [[j, *(f"{np.degrees(v):.1f}" for v in values)] for j, values in r.late.items()]
    return Table(("joint", "ramp, first cycle [deg]", "recorded, first cycle [deg]", "recorded, later cycles [deg]"), rows,
                 "How far from pose 1 when pose 2 is sent. A servo under load stays some degrees behind its ramp in every cycle.")


def _numbers(r: Result) -> dict[str, object]:
    joint, apart = last_pose(r)
    return {"last_pose": {"joint": joint, "deg": float(np.degrees(apart)), "noise_of_mean_deg": float(np.degrees(r.noise))},
            "late_deg": {j: [float(np.degrees(x)) for x in v] for j, v in r.late.items()}, "lean_deg": dict(r.lean)}


@style.styled
def draw_last(r: Result, model: RobotModel, joint: str) -> Figure:
    """A joint at the end of the walk, with and without the last pose."""
    figure = style.new_figure(11, 4)
    axes = figure.subplots()
    for name, colour in ((ALL, style.SIMULATED), (LAST, style.RECORDED)):
        _angle(axes, r, name, joint, colour)
    end = WALKED * walk().duration
    axes.set_xlim(end - 0.6, end + AFTER)
    _finish(axes, r, model, joint)
    return figure


@style.styled
def draw_first(r: Result, model: RobotModel, joint: str) -> Figure:
    """A joint in the first two cycles, with its ramp and goal."""
    figure = style.new_figure(11, 4)
    axes = figure.subplots()
    motion = walk()
    commands = motion.commands(WALKED)
    clock = np.linspace(-0.1, 2 * motion.duration, 800)
    ramp = commands.reference(clock)[:, commands.column(joint)]
    axes.plot(clock, np.degrees(ramp), color=style.COMMAND, ls="--", lw=1.3, label="ramp")
    goals = commands.goals[np.clip(np.searchsorted(commands.times, clock, side="right") - 1, 0, None), commands.column(joint)]
    axes.step(clock, np.degrees(np.where(clock < 0, 0.0, goals)), color=style.COMMAND, lw=0.8, label="goal")
    _angle(axes, r, ALL, joint, style.SIMULATED)
    axes.set_xlim(-0.1, 2 * motion.duration)
    _finish(axes, r, model, joint)
    return figure


def _angle(axes: Axes, r: Result, name: str, joint: str, colour: str) -> None:
    take = r.takes[name]
    axes.plot(take.since_start, np.degrees(take.q[:, take.column(joint)]), color=colour, label=name)


def _finish(axes: Axes, r: Result, model: RobotModel, joint: str) -> None:
    if joint[:2] in ("fl", "fr", "bl", "br"):
        shade_stance([axes], r.takes[ALL], model, f"{joint[:2]}b")
    axes.set_ylabel(f"{joint} [deg]")
    axes.set_xlabel("time since the first command [s]")
    style.legend_above(axes)
