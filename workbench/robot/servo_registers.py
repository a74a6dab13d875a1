"""The servos' own registers, read over the bus: evidence of a session that needs no recording."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from workbench.files.reading import write_whole
from workbench.files.yaml_file import Fields, read_yaml, yaml_text
from workbench.robot.model import EffectSpec, RobotModel
from workbench.robot.servo_constants import COUNT
from workbench.robot.servo_profile import ServoProfile
from workbench.robot.servo_profile_file import servo_profile

FORMAT = 1


@dataclass(frozen=True)
class ServoReading:
    """One servo: its ID and model, and its registers in counts, by name."""

    id: int
    model: str
    registers: Mapping[str, int]


@dataclass(frozen=True)
class Departure:
    """A register that differs from the model. nominal, found: in the unit of the law's key, or in counts. effect: the
    corresponding physics beyond the nominal model (docs/formats.md, section 7), None if there is none."""

    joint: str
    key: str
    nominal: float
    found: float
    effect: EffectSpec | None = None

    def __str__(self) -> str:
        text = f"{self.joint}: {self.key} is {self.found:g}, the model has {self.nominal:g}"
        if self.effect is None:
            return text
        values = ", ".join(f"{k} {v:.3g}" for k, v in self.effect.parameters.items() if isinstance(v, float))
        return f"{text} ({self.effect.effect}, {values})"


@dataclass(frozen=True)
class ServoRegisters:
    """The registers of a robot's servos on one day. profile: name of the family. read: when (UTC, ISO 8601)."""

    profile: str
    read: str
    joints: Mapping[str, ServoReading]

    def departures(self, model: RobotModel) -> tuple[Departure, ...]:
        """Every register that sets the servo's law or limits its torque, and differs from the model."""
        family = servo_profile(self.profile)
        out: list[Departure] = []
        for joint, reading in self.joints.items():
            if joint in model.joints:
                out += _law(joint, reading, model, family)
                out += _torque(joint, reading, model, family)
        return tuple(out)


def _law(joint: str, reading: ServoReading, model: RobotModel, family: ServoProfile) -> list[Departure]:
    out = []
    constants = model.servo(joint)
    for key, law in family.law.items():
        nominal = getattr(constants, key)
        if nominal is None:
            continue
        values = [law.value(reading.registers[name]) for name in law.registers if name in reading.registers]
        if not values:
            continue
        found = sum(values) / len(values)  # both directions, where there are two
        if abs(found - nominal) > max(law.unit / 2, 0.01 * abs(nominal)):
            out.append(Departure(joint, key, nominal, found, _effect(joint, key, nominal, found)))
    return out


def _effect(joint: str, key: str, nominal: float, found: float) -> EffectSpec | None:
    if key == "compliance_slope" and found > 0:
        return EffectSpec("servo_gain", (joint,), {"ratio": nominal / found})
    if key == "proportional_gain":
        return EffectSpec("servo_gain", (joint,), {"ratio": found / nominal})
    if key == "compliance_margin":
        return EffectSpec("dead_band", (joint,), {"margin": math.degrees((found - nominal) * COUNT)})
    return None


def _torque(joint: str, reading: ServoReading, model: RobotModel, family: ServoProfile) -> list[Departure]:
    """Less than full torque allowed, by either register; 0 means that an alarm has shut the servo down."""
    allowed = min(reading.registers.get(name, family.full_torque) for name in ("max_torque", "torque_limit"))
    if allowed >= family.full_torque:
        return []
    ceiling = model.servo(joint).torque_at_full_duty * allowed / family.full_torque
    effect = EffectSpec("torque_ceiling", (joint,), {"torque": ceiling}) if allowed else None
    return [Departure(joint, "torque_limit", family.full_torque, allowed, effect)]


def save_registers(registers: ServoRegisters, path: str | Path) -> Path:
    """Writes registers.yaml, whole or not at all."""
    content: dict[str, Any] = {"format": FORMAT, "profile": registers.profile, "read": registers.read, "joints": {
        joint: {"id": r.id, "model": r.model, "registers": dict(r.registers)} for joint, r in registers.joints.items()}}
    return write_whole(path, yaml_text(content))


def load_registers(path: str | Path, model: RobotModel | None = None) -> ServoRegisters:
    """Reads registers.yaml; InputError names the file, the key and the expected value, or a joint that `model` lacks."""
    path = Path(path)
    top = Fields(path, read_yaml(path))
    if top.raw("format") != FORMAT:
        raise top.error("format", f"expected {FORMAT}")
    name = str(top.required("profile", top.text("profile")))
    family = servo_profile(name)
    when = str(top.required("read", top.text("read")))
    joints = {}
    each = top.mapping("joints")
    if each is None:
        raise top.error("joints", "is missing")
    for joint, value in each.items():
        if model is not None and joint not in model.joints:
            raise each.error(joint, f"the robot has no such joint; its joints: {' '.join(model.joints)}")
        joints[joint] = _reading(Fields(path, value, each.at(joint)), family)
    top.done()
    return ServoRegisters(name, when, joints)


def _reading(f: Fields, family: ServoProfile) -> ServoReading:
    values = f.mapping("registers")
    if values is None:
        raise f.error("registers", "is missing")
    registers: dict[str, int] = {}
    for name, value in values.items():
        if name not in family.registers:
            raise values.error(name, f"{family.name} has no such register")
        if isinstance(value, bool) or not isinstance(value, int):
            raise values.error(name, f"expected a whole number, got {value!r}")
        registers[name] = value
    reading = ServoReading(f.required("id", f.whole("id")), str(f.required("model", f.text("model"))), registers)
    f.done()
    return reading
