"""What hangs on the bus, against the model: who answers, as what, in what state, set how."""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from workbench.device.bus.bus import Bus
from workbench.device.bus.errors import BusError, NoAnswerError
from workbench.device.bus.wire import measure_latency
from workbench.files import InputError
from workbench.robot import RobotModel, bus_ids
from workbench.robot.mounting import JointServo, Mounting
from workbench.robot.names import HIGHEST_ID
from workbench.robot.servo_profile import ServoProfile
from workbench.robot.servo_profile_file import model_name, servo_profile
from workbench.robot.servo_registers import ServoReading, ServoRegisters

STATE = ("present_position", "present_voltage", "present_temperature")
FIRST = 25.0
"""Time-out for a servo before any has answered [ms]: the default latency of an FTDI chip, and half as much again."""


@dataclass(frozen=True)
class FoundServo:
    """One servo. joint: the model's, None for a servo that is not in the model. registers: in counts. angle: the joint's, without
    a joint the servo's own [rad]. voltage [V], temperature [deg C]. mounting: how the servo sits on its joint."""

    id: int
    joint: str | None
    number: int
    model: str
    registers: Mapping[str, int]
    angle: float
    voltage: float
    temperature: int
    alarms: tuple[str, ...]
    mounting: Mounting = field(default_factory=Mounting)


@dataclass(frozen=True)
class Survey:
    """found: by ID. missing: joints that do not answer. doubled: IDs to which two seem to answer. rate: bit/s. latency: how long
    answers take beyond their bytes [s], the adapter's doing."""

    profile: ServoProfile
    rate: int
    found: Mapping[int, FoundServo]
    missing: tuple[str, ...]
    doubled: tuple[int, ...]
    latency: float = 0.0

    def problems(self) -> tuple[str, ...]:
        """Problems that have to be fixed before anything moves, a line each."""
        out = [f"joint {joint} does not answer" for joint in self.missing]
        out += [f"servo {i}: two servos seem to have this ID, or its cable is bad" for i in self.doubled]
        out += self._supply()
        for servo in self.found.values():
            name = f"servo {servo.id}" + (f" ({servo.joint})" if servo.joint else "")
            if servo.number not in self.profile.models:
                out.append(f"{name}: is {servo.model} ({servo.number}); expected {self.profile.name}")
                continue
            if servo.alarms:
                out.append(f"{name}: alarm: {', '.join(servo.alarms)}")
            limit = servo.registers.get("temperature_limit", 70)
            if servo.temperature > limit - COOLER:
                out.append(f"{name}: {servo.temperature} deg C; expected at least {COOLER} below its limit of {limit}")
            out += [f"{name}: {problem}" for problem in (*_mode(servo, self.profile), *_homing(servo))]
        return tuple(out)

    def _supply(self) -> list[str]:
        """One line: the supply is everybody's."""
        low, high = self.profile.supply
        off = [s for s in self.found.values() if s.number in self.profile.models and not low <= s.voltage <= high]
        if not off:
            return []
        volts = sorted(s.voltage for s in off)
        span = f"{volts[0]:.1f} V" if volts[0] == volts[-1] else f"{volts[0]:.1f} to {volts[-1]:.1f} V"
        return [f"{len(off)} of {len(self.found)} servos read {span}; expected {low:g} to {high:g} V"]

    def registers(self) -> ServoRegisters:
        """The registers as evidence of a session."""
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        return ServoRegisters(self.profile.name, now, {
            s.joint: ServoReading(s.id, s.model, s.registers) for s in self.found.values() if s.joint is not None})


COOLER = 10
"""How far below its limit a servo has to be before it starts to move [deg C]: one minute at stall warms an AX-12 by about as
much."""


def family_of(model: RobotModel) -> ServoProfile:
    """The one family of a model's servos; InputError where there are several, or none that is known."""
    families = {servo_profile(model.servo(joint).model).name for joint in model.joints}
    if len(families) > 1:
        raise InputError(model.description, f"servos of several families ({', '.join(sorted(families))}); a bus takes one")
    return servo_profile(families.pop())


def all_ids(protocol: int) -> range:
    """IDs that a servo of a protocol can have."""
    return range(HIGHEST_ID[protocol] + 1)


def survey(bus: Bus, model: RobotModel | None, ids: Iterable[int] | None = None,
           progress: Callable[[str, float], None] | None = None) -> Survey:
    """Asks `ids`, by default every one that the protocol allows, then reads all registers of each servo that answered. Without a
    model no servo has a joint. BusError where none answers; it says at which other bit rate servos do."""
    joints = {} if model is None else {i: joint for joint, i in bus_ids(model).items()}
    mountings = {} if model is None else model.mountings
    bus.joints.update(joints)
    wanted = sorted({*(all_ids(bus.profile.protocol) if ids is None else ids), *joints})
    _measure(bus, [*joints, *(i for i in wanted if i not in joints)])
    numbers: dict[int, int] = {}
    for k, servo in enumerate(wanted):
        if progress is not None:
            progress("looking at each ID", k / len(wanted))
        numbers |= bus.find([servo])
    doubled = tuple(i for i in wanted if (i in numbers or i in joints) and bus.answers(i) > 1)
    if not numbers and not doubled:
        raise _nobody(bus, wanted)
    found = {}
    for k, (servo, number) in enumerate(numbers.items()):
        if progress is not None:
            progress("reading registers", k / len(numbers))
        if servo not in doubled:
            joint = joints.get(servo)
            found[servo] = _describe_servo(bus, servo, number, joint, mountings.get(joint or "", Mounting()))
    fast = bus.profile.fast_read
    if fast is not None and found and all(s.registers.get("firmware_version", 0) >= fast for s in found.values()):
        bus.group_kind = "fast"
    missing = tuple(joint for i, joint in joints.items() if i not in numbers and i not in doubled)
    return Survey(bus.profile, int(bus.port.getBaudRate()), found, missing, doubled, bus.latency)


def _measure(bus: Bus, servos: Iterable[int]) -> None:
    """How patient to be, by the first servo that answers at all."""
    kept, bus.port.patience = bus.port.patience, max(float(bus.port.patience), FIRST)
    try:
        first = next((servo for servo in servos if bus.exists(servo, tries=1) is not None), None)
    finally:
        bus.port.patience = kept
    if first is not None:
        measure_latency(bus, first)


def read_registers(bus: Bus, servo: int) -> dict[str, int]:
    """All registers of a servo, in as few packets as the family's table allows (up to 80 bytes each)."""
    out: dict[str, int] = {}
    group: list[str] = []
    start = 0
    for register in sorted(bus.profile.registers.values(), key=lambda r: r.address):
        if group and register.address + register.size - start > 80:
            out |= bus.read(servo, *group)
            group = []
        if not group:
            start = register.address
        group.append(register.name)
    return out | bus.read(servo, *group)


def _describe_servo(bus: Bus, servo: int, number: int, joint: str | None, mounting: Mounting) -> FoundServo:
    name = model_name(number, bus.profile.protocol)
    if number not in bus.profile.models:  # its table is another one
        return FoundServo(servo, joint, number, name, {}, math.nan, math.nan, 0, ())
    try:
        registers = read_registers(bus, servo)
    except NoAnswerError as e:
        raise BusError(f"answered once, then not any more: {e.cause}", servo, joint) from None
    angle = JointServo(bus.profile, mounting).angle(registers["present_position"])
    return FoundServo(servo, joint, number, name, registers, angle, registers["present_voltage"] / 10,
                      registers["present_temperature"], bus.alarms.get(servo, ()), mounting)


def _mode(servo: FoundServo, profile: ServoProfile) -> Iterable[str]:
    """Ways in which a servo would not do as the model says."""
    r = servo.registers
    if r["cw_angle_limit"] == r["ccw_angle_limit"]:
        yield f"both angle limits are {r['cw_angle_limit']}: it turns without end (wheel mode); set them with --write"
    if r["torque_limit"] == 0 or r["max_torque"] == 0:
        yield "its torque is limited to nothing: an alarm shut it down, or a person did; switch its power off and on"
    for name, expected in profile.position_mode.items():
        if r[name] != expected:
            yield f"{name} is {r[name]}; expected {expected}, for plain position control"


def _homing(servo: FoundServo) -> Iterable[str]:
    """A servo whose zero was moved since the robot was calibrated."""
    expected, found = servo.mounting.homing, servo.registers.get("homing_offset")
    if expected is not None and found != expected:
        yield f"homing_offset is {found}, the calibration says {expected}; its angles are not those of the calibration"


def _nobody(bus: Bus, wanted: list[int]) -> BusError:
    rate = int(bus.port.getBaudRate())
    elsewhere = bus.find_at_any_rate(wanted)
    if elsewhere:
        other, servos = max(elsewhere.items(), key=lambda item: len(item[1]))
        return BusError(f"no servo answers at {rate} bit/s, but {len(servos)} do at {other}; say --rate {other}")
    return BusError(f"no servo answers, at {rate} bit/s or any other; is the servos' power on, and is this the right port?")
