"""The page of a comparison: the differences, their size over noise and numerical error, and where to look."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from workbench.compare.comparison import Channel, Comparison, Pair, TakeComparison
from workbench.robot import RobotModel
from workbench.view.figures import (
    body_attitude,
    body_path,
    by_joint,
    film_strip,
    footfalls,
    joint_errors,
    joint_grid,
    joint_overlay,
    stance_of,
    unseen_of,
)
from workbench.view.figures.errors import LIMIT
from workbench.view.playback import common_span
from workbench.view.report.curves import Curves
from workbench.view.report.page import Details, Part, Picture, Provenance, Replay, Report, Section, Table, Text
from workbench.view.scene.replay import write_replay

SHOWN = 3
"""Most joints drawn large; only those that differ by more than LIMIT are. The others are folded away."""


def write_comparison(comparison: Comparison, model: RobotModel, folder: Path, title: str,
                     progress: Callable[[str, float | None], None]) -> list[Path]:
    """Writes comparison.json, replay-TAKE.html for each take and report.html, which contains everything; returns their paths.

    progress: called with the current file and the share done.
    """
    paths = [comparison.save(folder / "comparison.json")]
    report = Report(title, headline(comparison), _summary(comparison), _key_numbers(comparison), _provenance(comparison, model))
    if comparison.left_out:
        rows = [[name, reason] for name, reason in comparison.left_out]
        report.add(Section("Takes left out", [Table(["take", "reason"], rows)]))
    for i, take in enumerate(comparison.takes):
        progress(f"drawing {take.name}", i / len(comparison.takes))
        paths.append(folder / f"replay-{take.name}.html")
        report.add(take_section(take, model, paths[-1]))
    return [report.write(folder / "report.html"), *paths]


def headline(comparison: Comparison) -> str:
    """The page's first sentence: which joints differ by more than noise and numerical error."""
    over = [(t, j, c) for t in comparison.takes for j, c in t.joints.items() if c.over_noise > LIMIT]
    if not over:
        return f"Every joint's error is within {LIMIT:g} times noise and numerical error."
    take, joint, worst = max(over, key=lambda found: found[2].over_noise)
    joints = len({j for _, j, _ in over})
    return (f"{_count(joints, 'joint')} differ{'s' if joints == 1 else ''} by more than noise and numerical error; the worst is "
            f"{joint} in {take.name}: {_degrees(worst.error)} RMS, {worst.over_noise:.1f} times that level.")


def _summary(comparison: Comparison) -> str:
    problems = sum(len(t.recorded.problems) for t in comparison.takes)
    text = ("Errors are RMS values after the first command. Noise is measured at rest before it; the numerical floor is the "
            "change of the rollout when the step is halved and quartered. The spread between contact models is listed "
            "separately.")
    return text + (f" {_count(problems, 'remark')} on the recordings; see each take." if problems else "")


def _key_numbers(comparison: Comparison) -> list[tuple[str, str, str]]:
    numbers = []
    for take in comparison.takes:
        worst = next(iter(take.joints_by_error()), None)
        if worst is not None:
            c = take.joints[worst]
            numbers.append((f"{take.name}: worst joint", f"{worst} {_degrees(c.error)}", f"noise {_degrees(c.noise)}"))
        if take.distance is not None and take.recorded.base != "fixed":
            walked = take.distance
            numbers.append((f"{take.name}: distance", _cm(walked.simulated), f"recorded {_cm(walked.recorded)}"))
    return numbers[:8]


def _provenance(comparison: Comparison, model: RobotModel) -> Provenance:
    known = dict(comparison.provenance)
    seconds = known.pop("seconds", None)
    more = [(k, str(v)) for k, v in known.items() if k not in ("workbench", "drake", "model_sha256", "config")]
    more += [(k, str(v)) for k, v in known.get("config", {}).items() if k in ("time_step", "contact", "drive", "approximation")]
    return Provenance(model.sha256, seconds=seconds, more=more)


def take_section(take: TakeComparison, model: RobotModel, replay: Path) -> Section:
    """Everything about one take, including its 3D replay, which is written to `replay`."""
    write_replay(replay, model, take.simulated, take.recorded, title=take.name)
    parts: list[Part] = [Picture(joint_errors(take.joints),
                                 "Error of each joint, and the error that noise and numerical error alone would cause.")]
    problems = take.recorded.problems
    if problems:
        parts.append(Details(f"{_count(len(problems), 'remark')} on the recording", [Text("\n\n".join(problems))]))
    recorded, simulated = stance_of(take.recorded_phases, take.recorded), stance_of(take.simulated_phases, take.simulated)
    for k, joint in enumerate(take.joints_by_error()[:SHOWN]):
        c = take.joints[joint]
        if k and not c.over_noise > LIMIT:
            break
        figure = joint_overlay(joint, take.simulated, take.recorded, noise=_finite_or_none(c.noise),
                               floor=_finite_or_none(c.floor), stance=by_joint(recorded, model))
        parts.append(Picture(figure, _about(joint, c)))
    if take.joints:
        parts.append(Curves(take.simulated, take.recorded, take.joints_by_error(),
                            "Joints in order of error, largest first; time zero is the first command."))
    noise = {j: c.noise for j, c in take.joints.items()}
    parts.append(Details("All joints", [
        Picture(joint_grid(take.simulated, take.recorded, noise=noise, joints=sorted(take.joints),
                           stance=by_joint(recorded, model))),
        _joint_table(take)]))
    span = common_span([take.simulated, take.recorded])
    if take.body is not None and take.recorded.base != "fixed":
        parts.append(_body_table(take))
        parts.append(Picture(body_path(take.simulated, take.recorded), "Path of the base link seen from above, and its heading."))
        parts.append(Details("Height and attitude of the body", [Picture(body_attitude(take.simulated, take.recorded))]))
        if recorded and simulated:
            unseen = unseen_of(take.recorded_phases, take.recorded)
            parts.append(Picture(footfalls(simulated, recorded, span=(0.0, span[1]), unseen=unseen), "Stance of each foot."))
    parts.append(Replay(replay, f"{take.name} in 3D: simulated solid, recorded as a ghost.",
                        film_strip(model, take.simulated, take.recorded)))
    return Section(take.name, parts)


def _joint_table(take: TakeComparison) -> Table:
    rows = []
    for joint in take.joints_by_error():
        c = take.joints[joint]
        angles = [_number(math.degrees(x), 3) for x in (c.error, c.noise, c.floor, c.spread)]
        rows.append([joint, *angles, _number(c.over_noise, 1), _number(c.correlation, 4), _number(1e3 * c.lag, 1)])
    header = ["joint", "error [deg]", "noise", "floor", "spread", "ratio to noise and floor", "correlation",
              "lag of the recording [ms]"]
    return Table(header, rows)


def _body_table(take: TakeComparison) -> Table:
    rows = []
    quantities: list[tuple[str, Pair | None, float, int]] = [
        ("distance [cm]", take.distance, 100, 1), ("forward [cm]", take.forward, 100, 1),
        ("heading, left positive [deg]", take.heading, 180 / np.pi, 1), ("speed [cm/s]", take.speed, 100, 1),
        ("smoothness [SPARC]", take.smoothness, 1, 2)]
    for name, pair, scale, digits in quantities:
        if pair is not None:
            values = (pair.recorded, pair.simulated, pair.floor, pair.spread)
            rows.append([name, *(_number(scale * x, digits) for x in values)])
    if take.body is not None:
        c = take.body
        rows.append(["path, RMS error [cm]", "–", *(_number(100 * x, 2) for x in (c.error, c.floor, c.spread))])
    for foot, phase in take.recorded_phases.items():
        if foot in take.simulated_phases:
            rows.append([f"duty factor {foot}", _number(phase.duty, 2), _number(take.simulated_phases[foot].duty, 2), "–", "–"])
    return Table(["body", "recorded", "simulated", "numerical floor", "contact spread"], rows)


def _about(joint: str, c: Channel) -> str:
    ratio = f", {c.over_noise:.1f} times noise and numerical error" if math.isfinite(c.over_noise) else ""
    lag = f"; the recording {'lags' if c.lag > 0 else 'leads'} by {abs(1e3 * c.lag):.0f} ms" if abs(c.lag) >= 1e-3 else ""
    return f"{joint}: {_degrees(c.error)} RMS{ratio}{lag}."


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _degrees(value: float) -> str:
    return f"{math.degrees(value):.2f}°" if math.isfinite(value) else "unknown"


def _cm(value: float) -> str:
    return f"{100 * value:.1f} cm" if math.isfinite(value) else "unknown"


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}".replace("-", "−") if math.isfinite(value) else "–"
