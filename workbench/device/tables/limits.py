"""Whether a pose table is within the servos' limits."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import minimum_filter1d

from workbench.files import InputError
from workbench.motion import PoseTable
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.robot.ranges import joint_ranges
from workbench.robot.servo_units import maker_of

RPM = 2 * math.pi / 60
HOLD = 0.01
"""How long a torque has to last to count [s]: the one-step impulses of a rigid contact are nothing that a servo, whose
control loop runs once a millisecond, has to hold."""
RECOMMENDED = 1 / 5
"""ROBOTIS: motion is stable where the load stays below a fifth of the stall torque (AX-12A manual)."""


@dataclass(frozen=True)
class Violation:
    """A limit that a table breaks, or (`warning`) a rule that it had better keep.

    value, limit: in `unit`. pose: counts from 1; None where it is not one pose's doing.
    """

    kind: Literal["position", "speed", "torque"]
    joint: str
    value: float
    limit: float
    unit: str
    text: str
    pose: int | None = None
    warning: bool = False

    def __str__(self) -> str:
        place = f"joint {self.joint}" if self.pose is None else f"pose {self.pose}, joint {self.joint}"
        return f"{place}: {self.text}"


def check_limits(table: PoseTable, model: RobotModel, simulated: Take | None = None) -> list[Violation]:
    """Requirements beyond the joints' ranges, the servos' speed and, as it ran in simulation, their torque.

    Broken limits come first, then warnings. The registers' own range is the table's to refuse. InputError for a joint
    that the model or the take lacks.
    """
    for joint in table.joints:
        if joint not in model.joints:
            raise InputError(table.source, f"the robot has no joint '{joint}'; its joints: {' '.join(model.joints)}")
    found = [*_positions(table, model), *_speeds(table, model), *(_torques(table, model, simulated) if simulated else ())]
    return sorted(found, key=lambda violation: violation.warning)


def refuse_broken_limits(table: PoseTable, model: RobotModel, force: bool, simulated: Take | None = None,
                         refused: str = "not played") -> list[Violation]:
    """`check_limits`; InputError where a limit is broken, unless `force`. Warnings never are."""
    violations = check_limits(table, model, simulated)
    broken = [v for v in violations if not v.warning]
    if broken and not force:
        more = f" (and {len(broken) - 1} more)" if len(broken) > 1 else ""
        raise InputError(table.source, f"{broken[0]}{more}; {refused}")
    return violations


def _positions(table: PoseTable, model: RobotModel) -> Iterator[Violation]:
    """Goals beyond the joints' ranges; half a count is granted, as a limit itself may round to that."""
    angles, ranges = table.angles(), joint_ranges(model)
    for i, joint in enumerate(table.joints):
        own = ranges[joint]
        for bound, side in ((own.lower, -1), (own.upper, 1)):
            for k in np.flatnonzero(side * (angles[:, i] - bound) > table.count[i] / 2):
                value, limit = math.degrees(angles[k, i]), math.degrees(bound)
                text = (f"goal {table.goals[k, i]} is {value:.1f} deg, beyond the joint's limit of {limit:.1f} deg "
                        f"({own.source})")
                yield Violation("position", joint, value, limit, "deg", text, pose=int(k) + 1)


def _speeds(table: PoseTable, model: RobotModel) -> Iterator[Violation]:
    """Moving speeds beyond the no-load speed at the supply voltage; a warning from the speed on at which full duty only just
    overcomes the servo's own friction. Speed 0 (at once) needs the travel over the dwell; in the first pose, from neutral, a
    warning, as the workbench's own programs do not send it."""
    angles = table.angles()
    before = np.vstack([np.zeros((1, len(table.joints))), angles[:-1]]) if table.start else np.roll(angles, 1, axis=0)
    if not table.start:
        before[0] = angles[table.loop - 1]  # where the loop closes
    travel = np.abs(angles - before) / (table.dwells_ms[:, None] / 1000)
    asked = np.where(table.speeds > 0, table.rates(), travel) / RPM
    for i, joint in enumerate(table.joints):
        servo = model.servo(joint)
        no_load, reached = float(servo.line.no_load_speed) / RPM, float(servo.line.reachable_speed) / RPM
        for k in np.flatnonzero(asked[:, i] > reached):
            broken = bool(asked[k, i] > no_load)
            limit = no_load if broken else reached
            what = "its no-load speed" if broken else "the speed that the unloaded servo reaches against its own friction"
            text = (f"moving speed {table.speeds[k, i]} is {asked[k, i]:.1f} rpm, beyond {what}, "
                    f"{limit:.1f} rpm at {servo.supply_voltage:g} V")
            yield Violation("speed", joint, float(asked[k, i]), limit, "rpm", text, pose=int(k) + 1, warning=not broken)
        away, dwell = abs(float(angles[0, i])), float(table.dwells_ms[0]) / 1000
        if table.speeds[0, i] == 0 and away / dwell > no_load * RPM:
            text = (f"moving speed 0, but {math.degrees(away):.1f} deg from neutral: play, run and flash go there slowly first; "
                    "a program of your own has to do so, too")
            yield Violation("speed", joint, away / dwell / RPM, no_load, "rpm", text, pose=1, warning=True)


def _torques(table: PoseTable, model: RobotModel, take: Take) -> Iterator[Violation]:
    """Joint torque that lasts beyond the servo's torque-speed line at full duty; a warning above a fifth of the stall torque."""
    if take.torque is None:
        raise InputError(take.name, "the simulated take holds no torque")
    moving = ~take.resting
    time = take.time[moving]
    window = max(1, round(HOLD / float(np.median(np.diff(time)))))
    for joint in table.joints:
        if joint not in take.joints:
            raise InputError(take.name, f"the simulated take lacks joint '{joint}'")
        servo, i = model.servo(joint), take.column(joint)
        torque = take.torque[moving, i]
        allowed = servo.line.available(torque, np.zeros_like(torque) if take.v is None else take.v[moving, i])
        lasting = minimum_filter1d(np.nan_to_num(np.abs(torque) - allowed, nan=-np.inf), window)
        k = int(np.argmax(lasting))
        if lasting[k] > 0.01 * servo.torque_at_full_duty:
            value, limit = abs(float(torque[k])), float(allowed[k])
            text = (f"at {time[k]:.2f} s the simulation needs {value:.2f} N m, for {HOLD * 1000:g} ms or longer more than "
                    f"the servo has at that speed and {servo.supply_voltage:g} V, {limit:.2f} N m")
            yield Violation("torque", joint, value, limit, "N m", text)
        rms, advised = float(np.sqrt(np.nanmean(torque**2))), RECOMMENDED * servo.torque_at_full_duty
        if rms > advised:
            text = (f"torque of {rms:.2f} N m (RMS) is above a fifth of the stall torque, {advised:.2f} N m "
                    f"({_rule(servo.model)})")
            yield Violation("torque", joint, rms, advised, "N m", text, warning=True)


def _rule(model: str) -> str:
    """Whose advice the share of the stall torque is: ROBOTIS gives it for its own servos."""
    return "ROBOTIS's rule" if maker_of(model) == "ROBOTIS" else "ROBOTIS's rule for its own servos; ask the maker of this one"
