"""Kinds of servos: addresses of their registers, from the same data file by which real ones are read, and behaviour of each
register."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from workbench.device.virtual.protocol import Protocol, Protocol1
from workbench.robot import data_file
from workbench.robot.servo_profile_file import load_profile


@dataclass(frozen=True)
class Register:
    """One entry of a control table: `default` and what may be written, from `low` to `high`; `eeprom` survives power off."""

    name: str
    address: int
    size: int
    default: int = 0
    low: int = 0
    high: int = 0
    writable: bool = True
    eeprom: bool = False


@dataclass(frozen=True)
class Kept:
    """One register of a servo: value from the factory or at power-on, and values that may be written (None: none). at: address
    and size if the data file does not name it, as nobody needs it from outside."""

    default: int = 0
    writable: tuple[int, int] | None = None
    at: tuple[int, int] | None = None


@dataclass(frozen=True)
class VirtualProfile:
    """A servo family. Times [s]; positions: `counts` over `span` [rad], `centre` the count of angle zero.

    registers: by these names the servo's conduct finds them: model_number, id, baud_rate, return_delay_time, status_return_level,
    cw_angle_limit, ccw_angle_limit, temperature_limit, min_voltage_limit, max_voltage_limit, max_torque, alarm_shutdown, lock,
    torque_enable, goal_position, moving_speed, torque_limit, present_position, present_speed, present_load, present_voltage,
    present_temperature, registered, moving, cw_compliance_margin, cw_compliance_slope, punch; a family has only some of them.
    bit_rate: value of the baud-rate register to bit/s. answer_times: of ping, read, and write with its time for each byte.
    interrupt: the motor interrupt's period and length, in which nothing is sent. refresh: how seldom speed and load are new.
    eeprom_time: for each byte written, in which the servo is deaf. speed_sign, load_sign: bit of the sign, 0 for two's
    complement. full_torque: count of torque_limit that sets no limit. goal_enables: whether a goal switches torque on.
    eeprom_lock: 1 where the register lock closes the EEPROM and can be opened again. boot: from power-on until it listens; stated
    by ROBOTIS for the XC-330 (0.4 s), not measured.
    """

    name: str
    registers: tuple[Register, ...]
    bit_rate: Callable[[int], int]
    size: int
    counts: int
    span: float
    centre: int
    speed_unit: float
    speed_sign: int
    load_sign: int
    full_torque: int
    return_delay_unit: float
    answer_times: tuple[float, float, float, float] = (18e-6, 22e-6, 24e-6, 6e-6)
    interrupt: tuple[float, float] = (1e-3, 130e-6)
    goal_enables: bool = True
    eeprom_lock: int = 0
    boot: float = 0.2
    refresh: float = 0.130
    eeprom_time: float = 6e-3
    protocol: Protocol = field(default_factory=Protocol1)

    @cached_property
    def by_name(self) -> dict[str, Register]:
        """Registers by name."""
        return {r.name: r for r in self.registers}

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Where each register lies in the table."""
        return {r.name: slice(r.address, r.address + r.size) for r in self.registers}

    @cached_property
    def at(self) -> dict[int, tuple[Register, int]]:
        """Which register, and which byte of it, lies at an address."""
        return {r.address + k: (r, k) for r in self.registers for k in range(r.size)}


def emulate(file: str, model: str, size: int, kept: Mapping[str, Kept], **own: Any) -> VirtualProfile:
    """A servo of the family that a file in data/servos describes: addresses, sizes, signs, units and bit rates are the file's,
    `own` holds the properties that only an emulation needs."""
    family = load_profile(data_file(f"servos/{file}.yaml"))

    def sign(name: str) -> int:
        bit = family.registers[name].sign
        return 1 << bit if isinstance(bit, int) else 0

    registers = []
    for name, keeps in kept.items():
        address, length = keeps.at or (family.registers[name].address, family.registers[name].size)
        low, high = keeps.writable or (0, 0)
        registers.append(Register(name, address, length, keeps.default, low, high, keeps.writable is not None,
                                  address < family.eeprom_below))
    common: dict[str, Any] = {
        "bit_rate": lambda value: family.bit_rates[value], "counts": family.counts, "span": family.span, "centre": family.centre,
        "speed_unit": family.speed_unit, "speed_sign": sign("present_speed"), "load_sign": sign("present_load"),
        "full_torque": family.full_torque, "return_delay_unit": family.return_delay_unit}
    return VirtualProfile(name=model, registers=tuple(registers), size=size, **common | own)
