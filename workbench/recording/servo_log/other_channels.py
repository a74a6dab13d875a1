"""Finds channels other than goals and positions that contradict the motion, or cannot be in the format's unit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from workbench.recording.recording import Recording
from workbench.recording.servo_log.following import fit_following, joint_logs
from workbench.types import Array


@dataclass(frozen=True)
class ChannelChecks:
    """amperes, celsius: no hobby servo draws more [A] or survives more [deg C]. turns_off: torque must be on in a joint that
    moves this far [deg], and whose goals explain `follows` of its position, although every row says off. faster: factor by which
    a joint exceeds the moving speed of its goals. opposite: correlation of duty with the distance from position to goal below
    which its sign is wrong. moves: least usable motion [deg]. fewest: least number of rows."""

    amperes: float = 20.0
    celsius: float = 120.0
    turns_off: float = 5.0
    follows: float = 0.8
    faster: float = 3.0
    opposite: float = -0.7
    moves: float = 5.0
    fewest: int = 20


CHANNELS = ChannelChecks()


def channel_problems(r: Recording, c: ChannelChecks = CHANNELS) -> Iterator[str]:
    """A line for each such channel of a log."""
    for joint in r.joints:
        current, heat = r.channels.get(f"current.{joint}"), r.channels.get(f"temperature.{joint}")
        if current is not None and (most := _largest(current)) > c.amperes:
            yield f"current.{joint}: reaches {most:.4g}; expected amperes, at most {c.amperes:g}: is it in milliamperes?"
        if heat is not None and (most := _largest(heat)) > c.celsius:
            unit = "kelvin or tenths of a degree" if most < 1000 else "hundredths of a degree"
            yield f"temperature.{joint}: reaches {most:.4g}; expected degrees Celsius, at most {c.celsius:g}: is it in {unit}?"
        yield from _check_enabled(r, joint, c)
        yield from _speed(r, joint, c)
        yield from _duty(r, joint, c)


def few_rows(r: Recording, c: ChannelChecks = CHANNELS) -> Iterator[str]:
    """A line for a log of positions that is too short to show anything. Positions in the first row alone are a start."""
    seen = [r.channels[f"position.{j}"] for j in r.joints if f"position.{j}" in r.channels]
    if len(r.time) < c.fewest and any(np.isfinite(p[min(1, len(p) - 1):]).any() for p in seen):
        yield f"time: only {len(r.time)} row(s), expected {c.fewest} or more: was the file cut, or the log stopped at once?"


def _check_enabled(r: Recording, joint: str, c: ChannelChecks) -> Iterator[str]:
    enabled = r.channels.get(f"enabled.{joint}")
    if enabled is None or enabled.any():
        return
    on = {**r.channels, f"enabled.{joint}": np.ones(len(r.time))}
    log = joint_logs(replace(r, channels=on)).get(joint)
    if log is None or np.rad2deg(min(np.ptp(log.goal), np.ptp(log.position))) < c.turns_off:
        return
    if fit_following(log.time, log.goal, log.position).explained > c.follows:
        yield (f"enabled.{joint}: is 0 in every row while position.{joint} follows goal.{joint}: is the column inverted "
               "(1: torque on)? The joint counts as limp")


def _speed(r: Recording, joint: str, c: ChannelChecks) -> Iterator[str]:
    speed, position = r.channels.get(f"speed.{joint}"), r.channels.get(f"position.{joint}")
    if speed is None or position is None or len(r.time) < c.fewest or not np.nanmax(speed, initial=0.0) > 0:
        return
    if np.any(speed[np.isfinite(speed)] == 0) or not np.isfinite(position).any():
        return
    rows = max(1, round(0.1 / float(np.median(np.diff(r.time)))))
    if rows >= len(position) or np.rad2deg(np.nanmax(position) - np.nanmin(position)) < c.moves:
        return
    moved = np.abs(position[rows:] - position[:-rows]) / (r.time[rows:] - r.time[:-rows])
    most, allowed = float(np.nanquantile(moved, 0.98)), float(np.nanmax(speed))
    if most > c.faster * allowed:
        yield (f"speed.{joint}: is at most {np.rad2deg(allowed):.3g} deg/s, but position.{joint} moves at {np.rad2deg(most):.3g} "
               "deg/s: is it in another unit (rad/s, counts)? A joint log has deg/s, 0 for at once")


def _duty(r: Recording, joint: str, c: ChannelChecks) -> Iterator[str]:
    duty = r.channels.get(f"duty.{joint}")
    log = joint_logs(r).get(joint) if duty is not None else None
    if duty is None or log is None or np.rad2deg(np.ptp(log.position)) < c.moves:
        return
    drive, way = duty[log.rows], log.goal - log.position
    known = np.isfinite(drive)
    if known.sum() < c.fewest or np.ptp(drive[known]) == 0 or np.ptp(way[known]) == 0:
        return
    alike = float(np.corrcoef(drive[known], way[known])[0, 1])
    if alike < c.opposite:
        yield (f"duty.{joint}: is opposite to the way from position.{joint} to goal.{joint} (correlation {alike:.2f}): has it "
               "the other sign?")


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
