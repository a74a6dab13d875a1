"""Checks whether the numbers of a servo log can be in its format's units: angles, velocities, duty, voltage, signs, zeros. Each
check compares a channel with the limits of servos, with the counts of sensors, or with another channel of the joint.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workbench.recording.recording import Recording
from workbench.recording.servo_log.state import count_of, resolution
from workbench.types import Array


@dataclass(frozen=True)
class UnitChecks:
    """When a unit is doubted.

    turns: servos of small robots turn less than so many times from their centre. radian_range: a joint that moves, moves less
    than so many degrees only in radians [deg]. fine: steps that no hobby servo's sensor resolves (16384 counts a turn) [deg].
    moves: a joint that moves less is not checked [deg]. goes: least motion for a comparison with another channel [deg].
    far: a joint that never comes nearer to its servo's centre is counted from elsewhere, or in counts [deg]. off: a joint that
    follows its goal does not stay so far from it [deg]. tolerance: of a ratio from a unit's. follows:
    correlation above which one channel follows another, by `lag` at most [s]. volts: above the supply of any servo of a small
    robot [V]. rows: fewer are not checked.
    """

    turns: float = 1.25
    radian_range: float = 3.5
    fine: float = 0.02
    moves: float = 0.05
    goes: float = 5.0
    far: float = 180.0
    off: float = 60.0
    tolerance: float = 0.15
    follows: float = 0.9
    lag: float = 0.2
    volts: float = 30.0
    rows: int = 20


UNITS = UnitChecks()
_COUNTS = {name: np.deg2rad(size) for name, size in (
    ("4096 a turn", 360 / 4096), ("1024 in 300 deg", 300 / 1023), ("16384 a turn", 360 / 16384), ("1024 in 220 deg", 220 / 1023))}
"""One count of the sensors in hobby servos [rad]."""
_OTHER = {"radians": np.pi / 180, "degrees": 180 / np.pi, "counts of 4096 a turn": 4096 / 360}
"""Factor by which a number is larger in another unit than in the format's: degrees or, for the second alone, radians. Counts of
300/1023 deg are not among them: a weak servo goes over a third of its goal's way, too."""
_RATES = {"radians a second": np.pi / 180, "turns a minute": 1 / 6, "counts of 0.229 turns a minute": 1 / (6 * 0.229),
          "counts of 0.111 turns a minute": 1 / (6 * 0.111), "degrees a second": 180 / np.pi}


def unit_problems(r: Recording, c: UnitChecks = UNITS) -> Iterator[str]:
    """A line for each channel that cannot be in its format's unit, or has another zero or sign."""
    found = {j: r.channels[f"position.{j}"] for j in r.joints if f"position.{j}" in r.channels}
    found = {j: p for j, p in found.items() if np.isfinite(p).any()}
    reported = set()
    for joint, position in found.items():
        for check in (_reach, _counted_in_radians, _against_goal):
            line = next(check(r, c, joint, position), None)
            if line is not None:
                reported.add(joint)
                yield line
                break
    if not reported:
        yield from _all_in_radians(r, c, found)
    for joint, position in found.items():
        yield from _velocity(r, c, joint, position)
    yield from _duty(r)
    voltage = r.channels.get("voltage")
    if voltage is not None and np.isfinite(voltage).any() and (most := float(np.nanmax(np.abs(voltage)))) > c.volts:
        unit = "millivolts" if most > 1000 else "tenths of a volt"
        yield f"voltage: reaches {most:g}; expected volts, at most {c.volts:g}: is it in {unit}?"


def _reach(r: Recording, c: UnitChecks, joint: str, position: Array) -> Iterator[str]:
    goal = r.channels.get(f"goal.{joint}")
    asked = float(np.nanmax(np.abs(goal))) if goal is not None and np.isfinite(goal).any() else 0.0
    most, least = float(np.nanmax(np.abs(position))), float(np.nanmin(np.abs(position)))
    if most > 2 * np.pi * c.turns:
        other = "degrees" if r.units == "radians" and most < 2 * np.pi * 180 else "another unit (counts)"
        yield f"position.{joint}: reaches {np.rad2deg(most):.0f} deg, more than {c.turns:g} turns; is it in {other}?"
    elif asked > 2 * np.pi * c.turns:
        row = int(np.nanargmax(np.abs(goal)))  # type: ignore[arg-type]  # there is one, as asked tells
        yield (f"goal.{joint}: reaches {np.rad2deg(asked):.0f} deg at {r.time[row]:.3f} s, more than {c.turns:g} turns; is it in "
               "another unit, or a typing error?")
    elif np.rad2deg(least) > c.far:
        yield (f"position.{joint}: never comes nearer than {np.rad2deg(least):.0f} deg to its servo's centre: is it in counts, "
               "or counted from another zero?")


def _counted_in_radians(r: Recording, c: UnitChecks, joint: str, position: Array) -> Iterator[str]:
    """A line if one joint among others is in radians: its steps are those of a known sensor."""
    if r.units != "degrees" or len(position) < c.rows or np.rad2deg(np.nanmax(np.abs(position))) > c.radian_range:
        return
    count = count_of(np.rad2deg(position).round(6).astype(float))
    for name, size in _COUNTS.items():
        if abs(count / size - 1) < 0.02:
            most = np.rad2deg(np.nanmax(np.abs(position)))
            yield (f"position.{joint}: leaves zero by no more than {most:.3g} deg, in steps of {count:.3g}, a sensor's "
                   f"count ({name}) in radians: is it in radians? (a joint log has degrees)")
            return


def _against_goal(r: Recording, c: UnitChecks, joint: str, position: Array) -> Iterator[str]:
    """A line if position and goal of one joint have different units, signs or zeros."""
    goal = r.channels.get(f"goal.{joint}")
    if goal is None or len(goal) < c.rows:
        return
    both = np.isfinite(goal) & np.isfinite(position) & (r.channels.get(f"enabled.{joint}", np.ones(len(goal))) != 0)
    if both.sum() < c.rows:
        return
    goal, position = goal[both], position[both]
    asked, done = np.rad2deg(np.ptp(goal)), np.rad2deg(np.ptp(position))
    if max(asked, done) < c.goes or min(asked, done) < c.moves:
        return
    follows = _follows(goal, position, max(1, round(c.lag / float(np.median(np.diff(r.time))))))
    if abs(follows) < c.follows:
        return
    for unit, ratio in _OTHER.items():
        for which, mine, other, its in (("position", done, "goal", asked), ("goal", asked, "position", done)):
            if unit != r.units and abs(mine / its / ratio - 1) < c.tolerance:
                yield f"{which}.{joint}: goes over {mine:.3g} deg where {other}.{joint} goes over {its:.3g} deg: is it in {unit}?"
                return
    if follows < 0:
        yield (f"position.{joint}: moves opposite to goal.{joint} (correlation {follows:.2f}): has one of them the other "
               "sign?")
    elif (away := np.rad2deg(abs(float(np.median(position - goal))))) > c.off:
        yield f"position.{joint}: stays {away:.0f} deg from goal.{joint}, which it follows: are their zeros the same?"


def _follows(goal: Array, position: Array, most: int) -> float:
    """Correlation (-1 to 1) of a joint with its goal at the lag of at most `most` rows at which it is largest; the most negative
    one where none is high, as of a swing the wrong lag makes the other sign."""
    found = [0.0]
    for lag in range(min(most, len(goal) // 4) + 1):
        a, b = goal[:len(goal) - lag], position[lag:]
        if np.ptp(a) > 0 and np.ptp(b) > 0:
            found.append(float(np.corrcoef(a, b)[0, 1]))
    return max(found) if max(found) > -min(found) / 2 else min(found)


def _all_in_radians(r: Recording, c: UnitChecks, found: dict[str, Array]) -> Iterator[str]:
    """A line if a whole log is in radians: no joint moves far, and all move in finer steps than sensors have."""
    if r.units != "degrees" or len(r.time) < c.rows or not found:
        return
    goals = [r.channels[f"goal.{j}"] for j in r.joints if f"goal.{j}" in r.channels]
    most = [float(np.nanmax(np.abs(g))) for g in (*goals, *found.values()) if np.isfinite(g).any()]
    reach = np.rad2deg(max(most, default=0.0))
    moving = {j: p for j, p in found.items() if np.rad2deg(np.ptp(p[np.isfinite(p)])) > c.moves}
    if moving and reach < c.radian_range and all(np.rad2deg(resolution(p)) < c.fine for p in moving.values()):
        joint = next(iter(moving))
        finest = np.rad2deg(resolution(moving[joint]))
        yield (f"position.{joint}: no joint leaves {reach:.3g} deg, in steps down to {finest:.2g} deg, finer than a "
               "servo's sensor: are the angles in radians? (a joint log has degrees)")


def _velocity(r: Recording, c: UnitChecks, joint: str, position: Array) -> Iterator[str]:
    """A logged velocity against the slope of the position."""
    velocity = r.channels.get(f"velocity.{joint}")
    if velocity is None or len(r.time) < c.rows or np.rad2deg(np.ptp(position[np.isfinite(position)])) < c.goes:
        return
    width = 5  # rows over which a single count does not look like a speed
    slope = (position[width:] - position[:-width]) / (r.time[width:] - r.time[:-width])
    logged = velocity[width // 2:][:len(slope)]
    both = np.isfinite(slope) & np.isfinite(logged)
    if both.sum() < c.rows or np.ptp(logged[both]) == 0 or np.ptp(slope[both]) == 0:
        return
    alike = float(np.corrcoef(slope[both], logged[both])[0, 1])
    if abs(alike) < c.follows:
        return
    ratio = float(np.sqrt(np.mean(logged[both] ** 2) / np.mean(slope[both] ** 2)))
    unit = next((name for name, of in _RATES.items() if abs(ratio / of - 1) < c.tolerance), None)
    if unit is not None:
        yield f"velocity.{joint}: is {ratio:.3g} times the slope of position.{joint}: is it in {unit}?"
    elif alike < 0:
        yield f"velocity.{joint}: has the opposite sign to the slope of position.{joint}"


def _duty(r: Recording) -> Iterator[str]:
    for joint in r.joints:
        duty = r.channels.get(f"duty.{joint}")
        if duty is not None and np.isfinite(duty).any() and np.nanmax(np.abs(duty)) > 1.05:
            most = float(np.nanmax(np.abs(duty)))
            unit = "per cent" if most <= 100 else "a register's counts"
            yield f"duty.{joint}: reaches {most:g}; expected -1 to 1: is it in {unit}?"
