"""Checks whether a servo log is plausible: turns that no servo makes, wrong units, sensors that freeze. Errors are repaired if
the repair is certain, and always reported, by joint and time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.files.problem import RemovedReadings, name_problem
from workbench.recording.recording import Recording
from workbench.recording.servo_log.faults import without_faults
from workbench.recording.servo_log.lead import lead_problems
from workbench.recording.servo_log.leaps import without_leaps
from workbench.recording.servo_log.logged import as_logged
from workbench.recording.servo_log.other_channels import channel_problems, few_rows
from workbench.recording.servo_log.reversed_roles import reversed_roles
from workbench.recording.servo_log.started import ramp_problems
from workbench.recording.servo_log.supply import supply_problems
from workbench.recording.servo_log.units import UNITS, unit_problems
from workbench.types import Array, Mask


@dataclass(frozen=True)
class LogChecks:
    """When a log is doubted. slow: largest step between rows of a servo's log [s]; more is another unit. fast: no bus reads rows
    closer to each other [s]. stands: how long a position may repeat to the last digit while its goal moves on by `goes` [s, deg],
    if it then leaps by more than `leaps` of its other steps; a joint that sticks sets out slowly. far: largest distance of a goal
    from it at the end [deg]. same: share of rows in which goal and position are equal above which the goal is no command; shift:
    by so many rows at most. pause: between rows, in medians of their steps. longest: longest duration of a log [s]. largest:
    largest number in any channel, beyond the range of 32-bit counts [SI]. read: least share of rows with a reading; logs of
    several rates have one in ten.
    """

    slow: float = 0.5
    fast: float = 6e-4
    stands: float = 0.25
    goes: float = 5.0
    leaps: float = 3.0
    far: float = 20.0
    same: float = 0.98
    shift: int = 3
    pause: float = 8.0
    longest: float = 7200.0
    largest: float = 1e10
    read: float = 0.04


CHECKS = LogChecks()


def check_log(recording: Recording, checks: LogChecks = CHECKS) -> Recording:
    """The recording with leaps of its positions repaired and reported in `problems`, with all other implausible values;
    InputError if a number is beyond all bounds. Only for logs on one clock; cameras' tracks are repaired with knowledge of the
    robot."""
    time = recording.time
    _check_bounds(recording, checks)
    if recording.sensing != "encoders" or np.any(np.diff(time) <= 0):
        return recording
    channels, problems = dict(recording.channels), [*recording.problems, *few_rows(recording), *_no_reading(recording, checks)]
    if len(time) < 3:
        return replace(recording, problems=tuple(problems))
    if np.median(np.diff(time)) < checks.fast:  # what follows compares with the times in which servos answer
        return replace(recording, problems=(*problems, *_clock(recording, checks)))
    exchanged = {j: text for j, text in reversed_roles(recording)
                 if _shift_of_equals(channels[f"goal.{j}"], channels[f"position.{j}"], checks) is None}
    problems += exchanged.values()
    for joint in recording.joints:
        name = f"position.{joint}"
        goal = channels.get(f"goal.{joint}")
        if joint in exchanged:
            channels[name] = np.full(len(time), np.nan)
        elif name in channels and not (goal is not None and _in_another_unit(goal)):
            channels[name], texts = without_leaps(time, channels[name])
            problems += [name_problem(name, text) for text in texts]
    read = replace(recording, channels=channels)
    for check in (_clock, _no_command):
        problems += check(read, checks)
    problems += unit_problems(read)
    problems += supply_problems(read)
    problems += channel_problems(read)
    mended = without_faults(read, frozenset(j for j in read.joints if any(
        text.startswith((f"goal.{j}:", f"position.{j}:")) and not isinstance(text, RemovedReadings) for text in problems)))
    problems += mended.lines
    problems += _frozen_sensors(mended.recording, checks)
    if not any(text.startswith("goal.") for text in problems):  # otherwise these are not goals, or have another unit
        problems += lead_problems(mended.recording)
        problems += ramp_problems(mended.recording)
    return as_logged(replace(mended.recording, problems=tuple(problems)))


def _no_reading(r: Recording, c: LogChecks) -> list[str]:
    """A line for each position without a reading in any row, or with next to none; one in the first row is that of commands."""
    out = []
    for name in (f"position.{joint}" for joint in r.joints if f"position.{joint}" in r.channels):
        rows = np.flatnonzero(np.isfinite(r.channels[name]))
        count = len(rows)
        if not count:
            out.append(f"{name}: holds no reading in any row")
        elif rows[-1] and count < c.read * len(r.time):
            out.append(f"{name}: holds a reading in {count} of {len(r.time)} rows: nothing is compared in the others")
    return out


def _check_bounds(r: Recording, c: LogChecks) -> None:
    for name, values in r.channels.items():
        beyond = np.flatnonzero(np.abs(values) > c.largest)
        if len(beyond) and len(values) == len(r.time):
            raise InputError(r.source, f"{name}: {values[beyond[0]]:.3g} (SI) at {r.time[beyond[0]]:.3f} s; expected at most "
                                       f"{c.largest:g}")


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
                       f"of {np.rad2deg(lower):.1f} to {np.rad2deg(upper):.1f} deg: the model will rest at its stop")
    return tuple(out)


def _in_another_unit(goal: Array) -> bool:
    """Whether goals (N,) [rad] are beyond a servo's range: then the joint's leaps are not leaps, and the unit is reported
    instead."""
    return bool(np.isfinite(goal).any() and np.nanmax(np.abs(goal)) > 2 * np.pi * UNITS.turns)


def _clock(r: Recording, c: LogChecks) -> Iterator[str]:
    steps = np.diff(r.time)
    middle = float(np.median(steps))
    if np.all(steps == 1.0):
        yield f"time: rows are 1 s apart, {r.time[-1] - r.time[0]:g} s in all: is it the number of the row, or of the frame?"
    elif middle > c.slow:
        unit = "milliseconds" if middle < 1e3 else "microseconds" if middle < 1e6 else "nanoseconds"
        yield f"time: rows are {middle:g} s apart, {r.time[-1] - r.time[0]:g} s in all: are the times in {unit}?"
    elif middle < c.fast:
        unit = next((unit for unit, seconds in (("minutes", 60), ("hours", 3600)) if seconds * middle > c.fast), "another unit")
        yield f"time: rows are {1e3 * middle:.3g} ms apart, faster than servos are read: are the times in {unit}?"
    elif r.time[-1] - r.time[0] > c.longest:
        yield f"time: the log lasts {(r.time[-1] - r.time[0]) / 3600:.1f} h; expected at most {c.longest / 3600:g} h"
    holes = np.flatnonzero(steps > max(c.pause * middle, 0.1))
    if len(holes):
        worst = holes[np.argmax(steps[holes])]
        yield f"time: {len(holes)} pause(s) without rows, the longest {steps[worst]:.3g} s from {r.time[worst]:.3f} s"


def _no_command(r: Recording, c: LogChecks) -> Iterator[str]:
    for joint, goal, position, on in _commanded_joints(r):
        both = np.isfinite(goal) & np.isfinite(position) & on
        sent = int(np.argmax(np.isfinite(goal))) if np.isfinite(goal).any() else len(goal)
        unasked = position[:sent][on[:sent] & np.isfinite(position[:sent])]
        if len(unasked) >= 10 and np.rad2deg(np.ptp(unasked)) > c.goes:
            when = "in every row" if sent == len(goal) else f"until {r.time[sent]:.3f} s"
            yield (f"goal.{joint}: blank {when} while the joint, its torque on, moves over "
                   f"{np.rad2deg(np.ptp(unasked)):.3g} deg: simulated as held; was the command recorded?")
        if both.sum() < 10:
            continue
        far = np.rad2deg(np.ptp(position[both]))
        if far < c.goes:
            continue
        shift = _shift_of_equals(goal, position, c)
        if shift is not None:
            when = "in every row" if not shift else f"of {abs(shift)} row(s) {'before' if shift > 0 else 'later'}, throughout"
            yield f"goal.{joint}: equals position.{joint} {when}: this log holds no command, only the joint's motion"
        elif np.ptp(goal[both]) == 0 and not _comes_to(goal[both][0], position[both]):
            yield (f"goal.{joint}: stays at {np.rad2deg(goal[both][0]):.4g} deg in every row while the joint moves over "
                   f"{far:.3g} deg: was the command recorded?")


def _shift_of_equals(goal: Array, position: Array, c: LogChecks) -> int | None:
    """The number of rows by which the position precedes a goal that equals it to the last digit; None if they differ."""
    for shift in sorted(range(-c.shift, c.shift + 1), key=abs):
        a, b = goal[max(shift, 0):len(goal) + min(shift, 0)], position[max(-shift, 0):len(position) - max(shift, 0)]
        both = np.isfinite(a) & np.isfinite(b)
        if both.sum() >= 10 and np.mean(np.abs(a - b)[both] < 1e-7) > c.same:
            return shift
    return None


def _comes_to(goal: float, position: Array) -> bool:
    """Whether a joint moves to a constant goal, as in a step, and not to and fro."""
    way, travelled = np.abs(position - goal), float(np.abs(np.diff(position)).sum())
    return bool((way[-1] < 0.3 * way.max() or way[-1] < np.deg2rad(5)) and travelled < 3 * np.ptp(position))


def _frozen_sensors(r: Recording, c: LogChecks) -> Iterator[str]:
    for joint, goal, position, on in _commanded_joints(r):
        if _shift_of_equals(goal, position, c) is not None:
            continue
        for first, last in _repeats(position):
            span = slice(first, last + 1)
            if last - first < 4 or r.time[last] - r.time[first] < c.stands or not on[span].all():
                continue
            inside = goal[first + 1:last]  # the goal's last step may coincide with the position's
            inside = inside[np.isfinite(inside)]
            if len(np.unique(inside)) < 4 or np.rad2deg(np.ptp(inside)) < c.goes:
                continue
            steps = np.abs(np.diff(position))
            others = np.concatenate([steps[:first], steps[last + 1:]])
            usual = float(np.nanpercentile(others, 99)) if np.isfinite(others).any() else 0.0
            leapt = last + 1 < len(position) and steps[last] > max(c.leaps * usual, np.deg2rad(2))
            if leapt or (last + 1 == len(position) and _left_behind(goal, position, first, c)):
                yield (f"position.{joint}: repeats {np.rad2deg(position[first]):.4g} deg to the last digit for "
                       f"{r.time[last] - r.time[first]:.2f} s from {r.time[first]:.3f} s while its goal moves over "
                       f"{np.rad2deg(np.ptp(inside)):.3g} deg{', and then leaps' if leapt else ''}: the sensor stood still")
                break


def _left_behind(goal: Array, position: Array, first: int, c: LogChecks) -> bool:
    """Whether a goal moves away from a joint that stands still from row `first` to the end, by `far` and by `leaps` times the
    largest earlier distance: more than with a weak servo, or one at its stop."""
    away = np.abs(goal - position)
    before = float(np.nanmax(away[:first], initial=0.0))
    return bool(np.rad2deg(np.nanmax(away[first:])) > c.far and np.nanmax(away[first:]) > c.leaps * before)


def _commanded_joints(r: Recording) -> Iterator[tuple[str, Array, Array, Mask]]:
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
