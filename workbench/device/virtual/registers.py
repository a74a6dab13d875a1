"""What kind of servo it is, as data: its registers and its times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

from workbench.device.virtual.protocol import Protocol, Protocol1


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
class VirtualProfile:
    """A servo family. Times [s]; positions: `counts` over `span` [rad], `centre` the count of angle zero.

    registers: by these names the servo's conduct finds them: model_number, id, baud_rate, return_delay_time, status_return_level,
    cw_angle_limit, ccw_angle_limit, temperature_limit, min_voltage_limit, max_voltage_limit, max_torque, alarm_shutdown, lock,
    torque_enable, goal_position, moving_speed, torque_limit, present_position, present_speed, present_load, present_voltage,
    present_temperature, registered, moving, cw_compliance_margin, cw_compliance_slope, punch; what a family lacks is left out.
    bit_rate: value of the baud-rate register to bit/s. answer_times: of ping, read, and write with its time for each byte.
    interrupt: the motor interrupt's period and length, in which nothing is sent. refresh: how seldom speed and load are new.
    eeprom_time: for each byte written, in which the servo is deaf.
    """

    name: str
    registers: tuple[Register, ...]
    bit_rate: Callable[[int], int]
    size: int
    counts: int = 1023
    span: float = 5.235987755982989
    centre: int = 512
    speed_unit: float = 0.011623892818282235
    speed_sign: int = 0x400
    return_delay_unit: float = 2e-6
    answer_times: tuple[float, float, float, float] = (18e-6, 22e-6, 24e-6, 6e-6)
    interrupt: tuple[float, float] = (1e-3, 130e-6)
    refresh: float = 0.130
    eeprom_time: float = 6e-3
    protocol: Protocol = field(default_factory=Protocol1)

    @cached_property
    def by_name(self) -> dict[str, Register]:
        """Registers by name."""
        return {r.name: r for r in self.registers}

    @cached_property
    def at(self) -> dict[int, tuple[Register, int]]:
        """Which register, and which byte of it, lies at an address."""
        return {r.address + k: (r, k) for r in self.registers for k in range(r.size)}
