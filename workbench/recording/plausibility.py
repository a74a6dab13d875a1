"""Whether a servo log can be what it says: turns that no servo makes, units that are not those of the file, sensors that stand.

What is certain is mended; all is told, by joint and time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.recording.leaps import without_leaps
from workbench.recording.log_state import resolution
from workbench.recording.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LogChecks:
    """When a log is doubted.

    turns: servos of small robots turn less than so many times from their centre. radian_range: a robot's joints all move less
    than so many degrees only in radians [deg]. fine: steps that no hobby servo's sensor resolves (16384 counts a turn) [deg].
    moves: a joint that moves less tells nothing [deg]. slow: between rows of a servo's log [s]; more is another unit.
    stands: as long as a position may repeat to the last digit while its goal goes on by `goes` [s, deg], if it then leaps by
    more than `leaps` of its other steps; a joint that sticks sets out slowly. far: as far as a goal may go without it at the
    end [deg].
    pause: between rows, in medians of their steps. longest: a log may last [s].
    """

    turns: float = 2.0
    radian_range: float = 3.5
    fine: float = 0.02
    moves: float = 0.05
    slow: float = 0.5
    stands: float = 0.25
    goes: float = 5.0
    leaps: float = 3.0
    far: float = 40.0
    pause: float = 8.0
    longest: float = 7200.0


CHECKS = LogChecks()


def checked(recording: Recording, checks: LogChecks = CHECKS) -> Recording:
    """The recording with leaps of its positions mended and `problems` that say so, and whatever else cannot be right. Only of
    logs on one clock; cameras' tracks are mended with the robot in view."""
    time = recording.time
    if recording.sensing != "encoders" or len(time) < 3 or np.any(np.diff(time) <= 0):
        return recording
    channels, problems = dict(recording.channels), list(recording.problems)
    for joint in recording.joints:
        name = f"position.{joint}"
        if name in channels:
            channels[name], said = without_leaps(time, channels[name])
            problems += [f"{name}: {text}" for text in said]
    mended = replace(recording, channels=channels)
    for check in (_clock, _units, _duty, _no_command, _standing):
        problems += check(mended, checks)
    return replace(mended, problems=tuple(problems))


def beyond_range(recording: Recording, limits: dict[str, tuple[float, float]]) -> tuple[str, ...]:
    """A line for each joint whose recorded position leaves the model's range (lower, upper) [rad] by more than 2 deg."""
    out = []
    for joint, (lower, upper) in limits.items():
        position = recording.channels.get(f"position.{joint}")
        if position is None or not np.isfinite(position).any():
            continue
        low, high = float(np.nanmin(position)), float(np.nanmax(position))
        if low < lower - np.deg2rad(2) or high > upper + np.deg2rad(2):
            out.append(f"position.{joint}: reaches {np.rad2deg(low):.1f} to {np.rad2deg(high):.1f} deg, beyond the model's range "
                       f"of {np.rad2deg(lower):.1f} to {np.rad2deg(upper):.1f} deg: the model will stand at its stop")
    return tuple(out)


def _clock(r: Recording, c: LogChecks) -> Iterator[str]:
    steps = np.diff(r.time)
    middle = float(np.median(steps))
    if middle > c.slow:
        yield f"time: rows are {middle:g} s apart, {r.time[-1] - r.time[0]:g} s in all: are the times in milliseconds?"
    elif r.time[-1] - r.time[0] > c.longest:
        yield f"time: the log lasts {(r.time[-1] - r.time[0]) / 3600:.1f} h; expected at most {c.longest / 3600:g} h"
    holes = np.flatnonzero(steps > max(c.pause * middle, 0.1))
    if len(holes):
        worst = holes[np.argmax(steps[holes])]
        yield f"time: {len(holes)} pause(s) without rows, the longest {steps[worst]:.3g} s from {r.time[worst]:.3f} s"


def _units(r: Recording, c: LogChecks) -> Iterator[str]:
    found = {j: r.channels[f"position.{j}"] for j in r.joints if f"position.{j}" in r.channels}
    ranges = {j: float(np.nanmax(np.abs(p))) for j, p in found.items() if np.isfinite(p).any()}
    for joint, most in ranges.items():
        if most > 2 * np.pi * c.turns:
            other = "degrees" if r.units == "radians" and most < 2 * np.pi * 180 else "another unit"
            yield f"position.{joint}: reaches {np.rad2deg(most):.0f} deg, more than {c.turns:g} turns; is it in {other}?"
    if r.units != "degrees" or len(r.time) < 20:
        return
    goals = [r.channels[f"goal.{j}"] for j in r.joints if f"goal.{j}" in r.channels]
    asked = [float(np.nanmax(np.abs(g))) for g in goals if np.isfinite(g).any()]
    reach = np.rad2deg(max([*ranges.values(), *asked], default=0.0))
    moving = {j: p for j, p in found.items() if np.rad2deg(np.ptp(p[np.isfinite(p)])) > c.moves} if ranges else {}
    if moving and reach < c.radian_range and all(np.rad2deg(resolution(p)) < c.fine for p in moving.values()):
        joint = next(iter(moving))
        finest = np.rad2deg(resolution(moving[joint]))
        yield (f"position.{joint}: no joint leaves {reach:.3g} deg, in steps down to {finest:.2g} deg, finer than a "
               "servo's sensor: are the angles in radians? (a joint log has degrees)")


def _duty(r: Recording, c: LogChecks) -> Iterator[str]:
    for joint in r.joints:
        duty = r.channels.get(f"duty.{joint}")
        if duty is not None and np.isfinite(duty).any() and np.nanmax(np.abs(duty)) > 1.05:
            most = float(np.nanmax(np.abs(duty)))
            unit = "per cent" if most <= 100 else "a register's counts"
            yield f"duty.{joint}: reaches {most:g}; expected -1 to 1: is it in {unit}?"


def _no_command(r: Recording, c: LogChecks) -> Iterator[str]:
    for joint, goal, position, on in _commanded(r):
        both = np.isfinite(goal) & np.isfinite(position) & on
        if both.sum() < 10:
            continue
        far = np.rad2deg(np.ptp(position[both]))
        if far < c.goes:
            continue
        if np.mean(np.abs(goal - position)[both] < 1e-7) > 0.98:
            yield f"goal.{joint}: equals position.{joint} in every row: this log holds no command, only what the joint did"
        elif np.ptp(goal[both]) == 0 and not _comes_to(goal[both][0], position[both]):
            yield (f"goal.{joint}: stays at {np.rad2deg(goal[both][0]):.4g} deg in every row while the joint moves over "
                   f"{far:.3g} deg: was the command recorded?")


def _comes_to(goal: float, position: Array) -> bool:
    """Whether a joint moves to a goal that stands, as in a step, and does not go to and fro."""
    way, travelled = np.abs(position - goal), float(np.abs(np.diff(position)).sum())
    return bool((way[-1] < 0.3 * way.max() or way[-1] < np.deg2rad(5)) and travelled < 3 * np.ptp(position))


def _standing(r: Recording, c: LogChecks) -> Iterator[str]:
    for joint, goal, position, on in _commanded(r):
        if np.mean(np.abs(goal - position) < 1e-7) > 0.98:
            continue
        for first, last in _repeats(position):
            span = slice(first, last + 1)
            if last - first < 4 or r.time[last] - r.time[first] < c.stands or not on[span].all():
                continue
            inside = goal[first + 1:last]  # the goal's last step may come with the position's
            inside = inside[np.isfinite(inside)]
            if len(np.unique(inside)) < 4 or np.rad2deg(np.ptp(inside)) < c.goes:
                continue
            steps = np.abs(np.diff(position))
            others = np.concatenate([steps[:first], steps[last + 1:]])
            usual = float(np.nanpercentile(others, 99)) if np.isfinite(others).any() else 0.0
            leapt = last + 1 < len(position) and steps[last] > max(c.leaps * usual, np.deg2rad(2))
            if leapt or (last + 1 == len(position) and np.rad2deg(np.ptp(inside)) > c.far):
                yield (f"position.{joint}: repeats {np.rad2deg(position[first]):.4g} deg to the last digit for "
                       f"{r.time[last] - r.time[first]:.2f} s from {r.time[first]:.3f} s while its goal moves over "
                       f"{np.rad2deg(np.ptp(inside)):.3g} deg{', and then leaps' if leapt else ''}: the sensor stood still")
                break


def _commanded(r: Recording) -> Iterator[tuple[str, Array, Array, NDArray[np.bool_]]]:
    """Joints with both goal and position: name, both (N,) [rad], and where torque was on."""
    for joint in r.joints:
        goal, position = r.channels.get(f"goal.{joint}"), r.channels.get(f"position.{joint}")
        if goal is not None and position is not None:
            yield joint, goal, position, r.channels.get(f"enabled.{joint}", np.ones(len(goal))) != 0


def _repeats(values: Array) -> NDArray[np.int_]:
    """Runs (K, 2) of equal finite values: first and last index."""
    same = np.concatenate([[False], values[1:] == values[:-1], [False]])
    edges = np.flatnonzero(np.diff(same.astype(int)))
    return edges.reshape(-1, 2)
