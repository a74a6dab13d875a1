"""Setting servos as the model has them: IDs, return delay, angle limits; nothing else, and read back."""

from __future__ import annotations

from collections.abc import Iterator

from workbench.device.bus.bus import Bus
from workbench.device.bus.errors import BusError
from workbench.device.bus.survey import Survey
from workbench.files import InputError
from workbench.files.nearest import did_you_mean
from workbench.robot import RobotModel, bus_ids
from workbench.robot.mounting import JointServo, Mounting
from workbench.robot.ranges import joint_ranges
from workbench.robot.servo_profile import ServoProfile

ROUNDING = 2
"""Counts by which limits may differ that were written from degrees."""


def wanted_registers(model: RobotModel, joint: str, profile: ServoProfile) -> dict[str, int]:
    """What `set_up` writes into a joint's servo: answers to all instructions without delay, and the joint's range, by the model
    and the table of ranges that the firmware's tables keep to."""
    own = joint_ranges(model)[joint]
    lowest, highest = JointServo(profile, model.mountings.get(joint, Mounting())).limits(own.lower, own.upper)
    level = {"status_return_level": 2} if "status_return_level" in profile.registers else {}
    return {**level, "return_delay_time": 0, "cw_angle_limit": lowest, "ccw_angle_limit": highest}


def wider_limits(model: RobotModel, found: Survey) -> tuple[str, ...]:
    """A line for each servo that may turn further than the model's joint: it does not stop a goal that came in broken."""
    out = []
    for servo in found.found.values():
        if servo.joint is None or servo.number not in found.profile.models:
            continue
        wanted = wanted_registers(model, servo.joint, found.profile)
        low, high = servo.registers["cw_angle_limit"], servo.registers["ccw_angle_limit"]
        lowest, highest = wanted["cw_angle_limit"], wanted["ccw_angle_limit"]
        if low < lowest - ROUNDING or high > highest + ROUNDING:
            out.append(f"servo {servo.id} ({servo.joint}): turns from {low} to {high}, the model's joint from {lowest} to "
                       f"{highest}")
    return tuple(out)


def set_up(bus: Bus, model: RobotModel, found: Survey) -> Iterator[str]:
    """Writes the differing registers, servo by servo, and yields a line for each. BusError where a servo has its torque on, as
    its EEPROM cannot be written then or the robot may move, or where a register does not keep the written value."""
    on = [servo for servo in found.found.values() if servo.joint and servo.registers.get("torque_enable")]
    if on:
        raise BusError("its torque is on; switch the robot off and on before its registers are written", on[0].id, on[0].joint)
    for servo in found.found.values():
        if servo.joint is None or servo.number not in bus.profile.models:
            continue
        for name, value in wanted_registers(model, servo.joint, bus.profile).items():
            if servo.registers[name] != value:
                bus.write(servo.id, {name: value})
                yield f"servo {servo.id} ({servo.joint}): {name} {servo.registers[name]} -> {value}"


def set_id(bus: Bus, model: RobotModel, found: Survey, joint: str) -> str:
    """Gives the one servo on the bus the ID of a joint; InputError where there are several."""
    ids = bus_ids(model)
    if joint not in ids:
        raise InputError(model.description, f"the robot has no joint '{joint}'; its joints: {' '.join(model.joints)}"
                             + did_you_mean(joint, model.joints))
    if len(found.found) != 1 or found.doubled:
        count = len(found.found) + len(found.doubled)
        raise BusError(f"{count} IDs answer; expected one servo alone on the bus to give it the ID of {joint}")
    (old,) = found.found
    new = ids[joint]
    if new == old:
        return f"servo {old}: has the ID of {joint} already"
    bus.write(old, {"id": new}, check=False)
    bus.pause(0.05)
    if bus.exists(new) is None:
        raise BusError(f"does not answer to {new} after its ID was written", old)
    lock = bus.profile.unlock
    if lock is not None:
        bus.write(new, {lock.register: lock.closed})
    return f"servo {old} is now {new} ({joint})"
