"""Servo families as data: registers, units, bit rates, and how well the constants of one such servo are known (data/servos)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from workbench.robot.errors import InputError
from workbench.robot.resources import resource_dir
from workbench.robot.servo_constants import ServoConstants
from workbench.robot.yaml_file import Fields, read_yaml

LAW_KEYS = ("compliance_slope", "compliance_margin", "punch", "proportional_gain")
_NOMINAL_KEYS = ("stall_torque", "no_load_speed", "rated_voltage", "supply_voltage", "coulomb_friction", "viscous_friction",
                 "reflected_inertia", *LAW_KEYS)
_NEEDED = ("model_number", "id", "baud_rate", "return_delay_time", "cw_angle_limit", "ccw_angle_limit", "temperature_limit",
           "min_voltage_limit", "torque_enable", "goal_position", "moving_speed", "torque_limit", "max_torque",
           "present_position", "present_speed", "present_load", "present_voltage", "present_temperature")


@dataclass(frozen=True)
class Uncertain:
    """A number and how well it is known: value and standard deviation, in the number's own unit (contract, section 4)."""

    value: float
    sd: float


@dataclass(frozen=True)
class Register:
    """Where a number lies in a servo's control table. sign: "" for none, "two" for two's complement, or the bit of the sign."""

    name: str
    address: int
    size: int
    sign: str | int = ""

    def decode(self, data: bytes) -> int:
        """The number in `size` bytes, low byte first."""
        raw = int.from_bytes(data, "little", signed=self.sign == "two")
        if isinstance(self.sign, int) and raw >> self.sign & 1:
            return -(raw & ~(1 << self.sign))
        return raw

    def encode(self, value: int) -> bytes:
        """The bytes of a number; ValueError where they cannot hold it."""
        if isinstance(self.sign, int) and value < 0:
            if -value >> self.sign:
                raise ValueError(f"{self.name}: {value} does not fit below its sign bit {self.sign}")
            value = -value | 1 << self.sign
        try:
            return value.to_bytes(self.size, "little", signed=self.sign == "two")
        except OverflowError:
            raise ValueError(f"{self.name}: {value} does not fit into {self.size} bytes") from None


@dataclass(frozen=True)
class LawRegister:
    """What sets a key of the nominal law: registers that should agree, the key's value for each count (`unit`), and the
    values that have an effect, the largest at or below a written one (`steps`; none: all)."""

    registers: tuple[str, ...]
    unit: float = 1.0
    steps: tuple[int, ...] = ()

    def value(self, counts: int) -> float:
        """The key's value where a register holds `counts`."""
        if self.steps:
            counts = max((s for s in self.steps if s <= counts), default=self.steps[0])
        return counts * self.unit

    def counts(self, value: float) -> int:
        """What to write for a value of the key."""
        return round(value / self.unit)


@dataclass(frozen=True)
class Switch:
    """A register that has to hold `open` while something is done, else `closed`."""

    register: str
    open: int
    closed: int


@dataclass(frozen=True)
class ServoProfile:
    """One family of bus servos. SI and radians.

    models: name by model number. protocol: of the bus. counts over span [rad]: of positions, `centre` the count of angle zero.
    speed_unit [rad/s], largest_speed: of the register moving_speed, where 0 is as fast as it can. load_unit: share of full
    output a count. full_torque: count of max_torque and torque_limit that limits nothing. bit_rates: bit/s by value of
    baud_rate. return_delay_unit [s]. eeprom_below: address where RAM begins. unlock: what lets the EEPROM be written. watchdog:
    register and its unit [s] with which a servo stops by itself when the bus falls silent. law: registers behind the keys of
    the nominal law. nominal: those keys, and how well they are known of a servo nobody measured.
    """

    name: str
    models: Mapping[int, str]
    protocol: Literal[1, 2]
    counts: int
    span: float
    centre: int
    speed_unit: float
    largest_speed: int
    load_unit: float
    full_torque: int
    bit_rates: Mapping[int, int]
    return_delay_unit: float
    eeprom_below: int
    registers: Mapping[str, Register]
    law: Mapping[str, LawRegister]
    nominal: Mapping[str, Uncertain]
    unlock: Switch | None = None
    watchdog: tuple[str, float] | None = None
    source: str = field(default="", compare=False)

    @property
    def count(self) -> float:
        """One count of position [rad]."""
        return self.span / self.counts

    @property
    def largest_position(self) -> int:
        """Largest goal of a joint that turns less than once."""
        return self.counts if self.counts % 2 else self.counts - 1

    def angle(self, position: float) -> float:
        """Angle [rad] of a position in counts, zero at the servo's centre."""
        return (position - self.centre) * self.count

    def position(self, angle: float) -> int:
        """Nearest count to an angle [rad], halves away from the centre; InputError where the register cannot hold it."""
        offset = angle / self.count
        counts = self.centre + int(math.copysign(math.floor(abs(offset) + 0.5 + 1e-9), offset))
        if not 0 <= counts <= self.largest_position:
            raise InputError(self.name, f"{math.degrees(angle):.1f} deg is count {counts}; expected 0 to {self.largest_position}")
        return counts

    def speed(self, rate: float) -> int:
        """Nearest count of moving speed to a rate [rad/s]: at least 1, as 0 is no limit, at most the largest."""
        return min(max(round(rate / self.speed_unit), 1), self.largest_speed)

    def constants(self) -> ServoConstants:
        """The nominal law of a servo nobody measured."""
        keys: dict[str, Any] = dict.fromkeys(LAW_KEYS)
        return ServoConstants(model=self.name, **keys | {k: u.value for k, u in self.nominal.items()})


def load_profile(path: str | Path) -> ServoProfile:
    """Reads a profile; InputError names the file, the key and what was expected."""
    path = Path(path)
    top = Fields(path, read_yaml(path))
    if top.raw("format") != 1:
        raise top.error("format", "expected 1")
    position, speed, load = (_needed(top, key) for key in ("position", "speed", "load"))
    registers = _registers(_needed(top, "registers"))
    profile = ServoProfile(
        name=str(top.required("name", top.text("name"))), models=_models(_needed(top, "models")),
        protocol=top.required("protocol", top.whole("protocol", least=1)),
        counts=position.required("counts", position.whole("counts", least=2)),
        span=math.radians(_number(position, "span")), centre=position.required("centre", position.whole("centre")),
        speed_unit=math.radians(_number(speed, "unit")), largest_speed=speed.required("largest", speed.whole("largest", least=1)),
        load_unit=_number(load, "unit"), full_torque=top.required("full_torque", top.whole("full_torque", least=1)),
        bit_rates=_bit_rates(_needed(top, "bit_rates")), return_delay_unit=_number(top, "return_delay_unit"),
        eeprom_below=top.required("eeprom_below", top.whole("eeprom_below")), registers=registers,
        law=_law(_needed(top, "law"), registers), nominal=_nominal(_needed(top, "nominal")),
        unlock=_unlock(top.mapping("unlock"), registers), watchdog=_watchdog(top.mapping("watchdog"), registers),
        source=str(path))
    if profile.protocol not in (1, 2):
        raise top.error("protocol", f"expected 1 or 2, got {profile.protocol}")
    for f in (position, speed, load, top):
        f.done()
    try:
        profile.constants()
    except (TypeError, ValueError) as e:
        raise top.error("nominal", str(e)) from None
    return profile


@cache
def servo_profiles() -> Mapping[str, ServoProfile]:
    """The families that ship with the workbench, by name."""
    found = [load_profile(path) for path in sorted((resource_dir("data") / "servos").glob("*.yaml"))]
    return MappingProxyType({p.name: p for p in found})


def servo_profile(model: str) -> ServoProfile:
    """The family of a servo by its name or a model's (as `model` in servo.yaml); InputError where nobody knows it."""
    wanted = _plain(model)
    for profile in servo_profiles().values():
        if wanted in (_plain(profile.name), *map(_plain, profile.models.values())):
            return profile
    raise InputError(None, f"no servo profile for '{model}'; expected one of {', '.join(servo_profiles())}")


def model_name(number: int, protocol: int) -> str:
    """What a model number stands for."""
    for profile in servo_profiles().values():
        if profile.protocol == protocol and number in profile.models:
            return profile.models[number]
    return f"unknown model {number}"


def _plain(name: str) -> str:
    return "".join(c for c in name.lower() if c.isalnum())


def _needed(f: Fields, key: str) -> Fields:
    found = f.mapping(key)
    if found is None:
        raise f.error(key, "is missing")
    return found


def _number(f: Fields, key: str) -> float:
    value: float = f.required(key, f.number(key, least=0))
    return value


def _by_number(f: Fields) -> dict[int, Any]:
    out: dict[int, Any] = {}
    for key, value in list(f._left.items()):
        if isinstance(key, bool) or not isinstance(key, int) or key < 0:
            raise f.error(str(key), "expected a whole number as key")
        out[key] = value
    return out


def _models(f: Fields) -> Mapping[int, str]:
    return {k: str(v) for k, v in _by_number(f).items()}


def _bit_rates(f: Fields) -> Mapping[int, int]:
    rates = _by_number(f)
    for key, rate in rates.items():
        if isinstance(rate, bool) or not isinstance(rate, int) or rate < 1:
            raise f.error(str(key), f"expected bit/s, got {rate!r}")
    return rates


def _registers(f: Fields) -> Mapping[str, Register]:
    out = {}
    for name, value in f.items():
        if not isinstance(value, list) or not 2 <= len(value) <= 3 or value[1] not in (1, 2, 4):
            raise f.error(name, f"expected [address, size] or [address, size, sign], got {value!r}")
        sign = value[2] if len(value) == 3 else ""
        if sign not in ("", "two") and not (isinstance(sign, int) and 0 < sign < 8 * value[1]):
            raise f.error(name, f"expected `two` or a bit as sign, got {sign!r}")
        out[name] = Register(name, int(value[0]), int(value[1]), sign)
    missing = [name for name in _NEEDED if name not in out]
    if missing:
        raise f.error(missing[0], "is missing")
    return out


def _law(f: Fields, registers: Mapping[str, Register]) -> Mapping[str, LawRegister]:
    out = {}
    for key in LAW_KEYS:
        entry = f.mapping(key)
        if entry is None:
            continue
        names = entry.raw("registers")
        if not isinstance(names, list) or not names or not set(names) <= set(registers):
            raise entry.error("registers", f"expected names of registers, got {names!r}")
        steps = entry.raw("steps") or []
        unit = entry.number("unit", least=0)
        entry.done()
        out[key] = LawRegister(tuple(names), 1.0 if unit is None else unit, tuple(steps))
    f.done()
    return out


def _nominal(f: Fields) -> Mapping[str, Uncertain]:
    out = {}
    for key in _NOMINAL_KEYS:
        entry = f.mapping(key)
        if entry is not None:
            out[key] = Uncertain(_number(entry, "value"), _number(entry, "sd"))
            entry.done()
    f.done()
    return out


def _unlock(f: Fields | None, registers: Mapping[str, Register]) -> Switch | None:
    if f is None:
        return None
    switch = Switch(_register_name(f, registers), f.required("open", f.whole("open")), f.required("closed", f.whole("closed")))
    f.done()
    return switch


def _watchdog(f: Fields | None, registers: Mapping[str, Register]) -> tuple[str, float] | None:
    if f is None:
        return None
    found = _register_name(f, registers), _number(f, "unit")
    f.done()
    return found


def _register_name(f: Fields, registers: Mapping[str, Register]) -> str:
    name: str = f.required("register", f.text("register"))
    if name not in registers:
        raise f.error("register", f"no register '{name}'")
    return name
