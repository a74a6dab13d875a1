"""One joint moved a little and back, so that somebody sees which one it is and which way it turns."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from workbench.device.bus.bus import Bus
from workbench.device.bus.errors import BusError
from workbench.device.bus.survey import FoundServo
from workbench.files import InputError
from workbench.robot.mounting import Mounting


@dataclass(frozen=True)
class WiggleOptions:
    """by: how far it goes [rad]; seen from a metre, and less than a servo's gears take when the leg is held. speed: [rad/s].
    torque: share of the torque limit. rest: at the far end, and back [s]. moved: share of the way that counts as having moved."""

    by: float = math.radians(3)
    speed: float = math.radians(12)
    torque: float = 0.3
    rest: float = 0.6
    moved: float = 0.5


@dataclass(frozen=True)
class Wiggled:
    """went: how far the joint went [rad], by its own sensor. blocked: whether that was too little."""

    joint: str
    servo: int
    went: float
    blocked: bool


def wiggle(bus: Bus, servo: FoundServo, options: WiggleOptions | None = None) -> Wiggled:
    """Torque on where it stands, a little in the positive direction, back, and torque off, whatever happens. BusError where it
    does not answer; InputError where it has no joint, or has torque already, as then something else moves it."""
    o, profile = options or WiggleOptions(), bus.profile
    if servo.joint is None:
        raise InputError(None, f"servo {servo.id} is not a joint of the model")
    if bus.read(servo.id, "torque_enable")["torque_enable"]:
        raise BusError("its torque is on; switch the robot off and on first", servo.id, servo.joint)
    here = bus.read(servo.id, "present_position")["present_position"]
    if abs(bus.read(servo.id, "present_position")["present_position"] - here) * profile.count > math.radians(2):
        raise BusError("it moves; hold the robot still", servo.id, servo.joint)
    step = servo.mounting.direction * round(o.by / profile.count)
    there = min(max(here + step, 0), profile.largest_position)
    time = {"goal_time": 0} if "goal_time" in profile.registers else {}

    def go(count: int) -> None:
        bus.sync_write({servo.id: {"goal_position": count, "moving_speed": profile.speed(o.speed), **time}})

    limit = servo.registers["torque_limit"]
    try:
        bus.sync_write({servo.id: {"torque_limit": round(o.torque * limit)}})
        go(here)
        bus.write(servo.id, {"torque_enable": 1})
        go(there)
        bus.pause(o.by / o.speed + o.rest)
        moved = bus.read(servo.id, "present_position")["present_position"] - here
        went = servo.mounting.direction * moved * profile.count
        go(here)
        bus.pause(o.by / o.speed + o.rest)
    finally:
        held = bus.let_go([servo.id])
        bus.sync_write({servo.id: {"torque_limit": limit}})
        bus.pause(0.002)
    if held:
        raise BusError("does not confirm that its torque is off; switch the robot's power off", servo.id, servo.joint)
    return Wiggled(servo.joint, servo.id, went, went < o.moved * o.by)


@dataclass
class Answers:
    """What somebody saw. moved: the joint that was seen to move, by the one that was told to. reversed: joints that turned the
    other way."""

    moved: dict[str, str] = field(default_factory=dict)
    reversed: list[str] = field(default_factory=list)

    def take(self, joint: str, answer: str, joints: Iterable[str]) -> None:
        """"" or yes: this one, the positive way; `-`: this one, the other way; a joint's name, perhaps with `-` behind it: that
        one. InputError for anything else."""
        name = answer.strip()
        other = name.removesuffix("-").strip()
        if other.lower() in ("", "y", "yes"):
            other = joint
        if other not in joints:
            raise InputError(None, f"'{answer.strip()}': expected Enter, -, or the joint that moved: {' '.join(joints)}")
        self.moved[joint] = other
        if name.endswith("-"):
            self.reversed.append(other)

    def findings(self, ids: Mapping[str, int]) -> list[str]:
        """Errors of bus IDs and directions, a line each."""
        out = [f"servo {ids[commanded]} is {seen}, not {commanded}: bus_ids should say {seen}: {ids[commanded]}"
               for commanded, seen in self.moved.items() if commanded != seen]
        seen = list(self.moved.values())
        out += [f"joint {joint} moved for several servos: look again" for joint in sorted({j for j in seen if seen.count(j) > 1})]
        out += [f"joint {joint} turns the other way than in the model" for joint in self.reversed]
        return out

    def corrections(self, ids: Mapping[str, int], mountings: Mapping[str, Mounting]) -> dict[str, dict[str, int]]:
        """The keys `bus_ids` and `direction` of a `robot` section that agree with the observations; a key that is right already
        is left out. InputError where two servos were seen to move one joint."""
        seen = list(self.moved.values())
        if len(set(seen)) < len(seen):
            raise InputError(None, "one joint moved for several servos; wiggle them again")
        new = {joint: ids[commanded] for commanded, joint in self.moved.items()}
        unseen = {joint: i for joint, i in ids.items() if joint not in new and i not in new.values()}
        signs = {}
        for joint in ids:
            commanded = next((t for t, s in self.moved.items() if s == joint), joint)
            sign = mountings.get(commanded, Mounting()).direction * (-1 if joint in self.reversed else 1)
            if sign != 1:
                signs[joint] = sign
        old = {joint: m.direction for joint, m in mountings.items() if m.direction != 1}
        out = {} if all(ids[joint] == i for joint, i in new.items()) else {"bus_ids": new | unseen}
        return out if signs == old else out | {"direction": signs}
