"""Reading servo profiles, and finding the family of a servo by its name or number."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path, PurePath
from types import MappingProxyType
from typing import Any, Literal

from workbench.files import InputError
from workbench.files.plug_ins import with_plug_ins
from workbench.files.resources import resource_dir
from workbench.files.yaml_file import Fields, top_of
from workbench.robot.servo_constants import REQUIRED, TOLERANCES, ServoConstants
from workbench.robot.servo_profile import LAW_KEYS, MORE_KEYS, LawRegister, Register, ServoProfile, Switch, Uncertain

ENTRY_POINT_GROUP = "workbench.servos"
_NOMINAL_KEYS = ("stall_torque", "no_load_speed", "rated_voltage", "supply_voltage", "coulomb_friction", "viscous_friction",
                 "reflected_inertia", *LAW_KEYS, *MORE_KEYS)
BY_GAIN = ("minimum_duty", "dead_zone", "derivative_gain")
"""Keys of the law by proportional gain; the law by compliance has punch and margin instead."""
_NEEDED = ("model_number", "id", "baud_rate", "return_delay_time", "cw_angle_limit", "ccw_angle_limit", "temperature_limit",
           "min_voltage_limit", "torque_enable", "goal_position", "moving_speed", "torque_limit", "max_torque",
           "present_position", "present_speed", "present_load", "present_voltage", "present_temperature")


def load_profile(path: str | PurePath) -> ServoProfile:
    """Reads a profile; InputError names the file, the key and the expected value."""
    path = Path(path)
    top = top_of(path, "position", "speed", "load", "registers", "name", "models", "protocol", "supply", "position_mode",
                 "full_torque", "bit_rates", "return_delay_unit", "eeprom_below", "law", "nominal", "alarms", "refusals",
                  "unlock", "watchdog", "marker", "maker", "group_read", "fast_read", *TOLERANCES)
    position, speed, load = (_required_section(top, key) for key in ("position", "speed", "load"))
    registers = _registers(_required_section(top, "registers"))
    profile = ServoProfile(
        name=str(top.required("name", top.text("name"))), models=_names(_required_section(top, "models")),
        protocol=top.required("protocol", top.whole("protocol", least=1)),
        supply=_range(top, "supply"), position_mode=_position_mode(top.mapping("position_mode"), registers),
        counts=position.required("counts", position.whole("counts", least=2)),
        span=math.radians(_number(position, "span")), centre=position.required("centre", position.whole("centre")),
        speed_unit=math.radians(_number(speed, "unit")), largest_speed=speed.required("largest", speed.whole("largest", least=1)),
        table_unit=None if (of_tables := speed.number("table_unit", least=0)) is None else math.radians(of_tables),
        load_unit=_number(load, "unit"), full_torque=top.required("full_torque", top.whole("full_torque", least=1)),
        bit_rates=_bit_rates(_required_section(top, "bit_rates")), return_delay_unit=_number(top, "return_delay_unit"),
        eeprom_below=top.required("eeprom_below", top.whole("eeprom_below")), registers=registers,
        law=_law(_required_section(top, "law"), registers), nominal=_nominal(_required_section(top, "nominal")),
        tolerances={key: v for key in TOLERANCES if (v := top.number(key, least=0)) is not None},
        alarms=_names(_required_section(top, "alarms")), refusals=_names(_required_section(top, "refusals")),
        unlock=_unlock(top.mapping("unlock"), registers), watchdog=_watchdog(top.mapping("watchdog"), registers),
        marker=_marker(top, registers), maker=top.text("maker") or "",
        group_read=_group_read(top), fast_read=top.whole("fast_read"), source=str(path))
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
    """The families that ship with the workbench, by name, and those of other packages: an entry point of the group
    `workbench.servos` names the path of a profile."""
    shipped = map(load_profile, sorted((resource_dir("data") / "servos").glob("*.yaml")))

    def load_named(path: PurePath, at: str) -> tuple[str, ServoProfile]:
        profile = load_profile(path)
        return profile.name, profile

    return MappingProxyType(with_plug_ins({p.name: p for p in shipped}, ENTRY_POINT_GROUP, PurePath, "servo family", load_named))


def servo_profile(model: str) -> ServoProfile:
    """The family of a servo by its name or a model's (as `model` in servo.yaml); InputError where nobody knows it."""
    profile = family_of_servo(model)
    if profile is not None:
        return profile
    raise InputError(None, f"no servo profile for '{model}'; expected one of {', '.join(servo_profiles())}, or a "
                           f"profile of its own ({_plain(model)}.yaml; see docs/extending.md), as its counts are unknown")


def with_family_law(servo: ServoConstants, given: Collection[str]) -> ServoConstants:
    """The constants, with parts of the servo's law that their file omits taken from its family's profile, with their uncertainty.

    given: keys of the file; their values are kept, including 0. Servos of an unknown family stay as they are. Keys of the law by
    proportional gain are not added to a servo with the law by compliance.
    """
    family = family_of_servo(servo.model)
    if family is None:
        return servo
    keys = [k for k in MORE_KEYS if k in family.nominal and k not in given]
    if servo.proportional_gain is None:
        keys = [k for k in keys if k not in BY_GAIN]
    if not keys:
        return servo
    values: dict[str, Any] = {k: family.nominal[k].value for k in keys}
    return replace(servo, **values, sd=tuple(sorted((dict(servo.sd) | {k: family.nominal[k].sd for k in keys}).items())))


def model_name(number: int, protocol: int) -> str:
    """Name of the servo with a model number."""
    for profile in servo_profiles().values():
        if profile.protocol == protocol and number in profile.models:
            return profile.models[number]
    return f"unknown model {number}"


def family_of_servo(model: str) -> ServoProfile | None:
    """The family of a servo by its name or a model's; None where nobody knows it."""
    wanted = _plain(model)
    return next((p for p in servo_profiles().values() if wanted in (_plain(p.name), *map(_plain, p.models.values()))), None)


def _plain(name: str) -> str:
    return "".join(c for c in name.lower() if c.isalnum())


def _required_section(f: Fields, key: str) -> Fields:
    found = f.mapping(key)
    if found is None:
        raise f.error(key, "is missing")
    return found


def _number(f: Fields, key: str) -> float:
    value: float = f.required(key, f.number(key, least=0))
    return value


def _range(f: Fields, key: str) -> tuple[float, float]:
    value = f.raw(key)
    numbers = isinstance(value, list) and len(value) == 2 and all(isinstance(x, (int, float)) for x in value)
    if not (numbers and value[0] < value[1]):
        raise f.error(key, f"expected [lowest, highest], got {value!r}")
    return float(value[0]), float(value[1])


def _names(f: Fields) -> Mapping[int, str]:
    return {k: str(v) for k, v in f.numbered().items()}


def _bit_rates(f: Fields) -> Mapping[int, int]:
    rates = f.numbered()
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
        raise f.missing(missing)
    return out


def _position_mode(f: Fields | None, registers: Mapping[str, Register]) -> Mapping[str, int]:
    if f is None:
        return {}
    mode = dict(f.items())
    for name, value in mode.items():
        if name not in registers or not isinstance(value, int):
            raise f.error(name, "expected a register and a whole number")
    return mode


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
    missing = sorted(REQUIRED - set(out))
    if missing:
        raise f.missing(missing)
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


def _marker(f: Fields, registers: Mapping[str, Register]) -> str | None:
    name = f.text("marker")
    if name is not None and name not in registers:
        raise f.error("marker", f"no register '{name}'")
    return name


def _group_read(f: Fields) -> Literal["", "sync", "feetech", "bulk"]:
    kind = f.text("group_read") or ""
    if kind not in ("", "sync", "feetech", "bulk"):
        raise f.error("group_read", f"expected sync, feetech or bulk, got {kind!r}")
    return kind  # type: ignore[return-value]  # one of them


def _register_name(f: Fields, registers: Mapping[str, Register]) -> str:
    name: str = f.required("register", f.text("register"))
    if name not in registers:
        raise f.error("register", f"no register '{name}'")
    return name
