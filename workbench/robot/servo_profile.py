"""Servo families as data: registers, units, bit rates, and how well the constants of one such servo are known (data/servos)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from workbench.files import InputError
from workbench.robot.servo_constants import ServoConstants

LAW_KEYS = ("compliance_slope", "compliance_margin", "punch", "proportional_gain")
MORE_KEYS = ("minimum_duty", "dead_zone", "goal_delay", "goal_ramp", "command_filter", "derivative_gain", "load_friction")
"""Keys of the nominal law that only some servos have."""


@dataclass(frozen=True)
class Uncertain:
    """A number with its uncertainty: value and standard deviation, in the number's own unit (docs/formats.md, section 4)."""

    value: float
    sd: float


@dataclass(frozen=True)
class Register:
    """Place of a number in a servo's control table. sign: "" for none, "two" for two's complement, or the bit of the sign."""

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
    """How registers set a key of the nominal law: registers that should agree, the key's value for each count (`unit`), and the
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
    speed_unit [rad/s], largest_speed: of the register moving_speed, where 0 is as fast as possible; table_unit [rad/s]: unit that
    the conversion of a motion table assumes, where it is another. load_unit: share of full output a count. supply: voltages [V]
    at which it works. full_torque: count of max_torque and torque_limit that sets no limit. bit_rates: bit/s by value of
    baud_rate. return_delay_unit [s]. eeprom_below: address where RAM begins. law: registers behind the keys of the nominal law.
    nominal: those keys, and how well they are known for an unmeasured servo. tolerances: of torque and back-EMF, as in
    servo.yaml. alarms, refusals: meanings of the bits of an answer's error byte, of the servo's state and of the instruction;
    with protocol 2 alarms are bits of the register hardware_error and refusals numbers. position_mode: register values of plain
    position control. unlock: register that allows the EEPROM to be written. watchdog: register and its unit [s] with which a
    servo stops automatically when the bus falls silent. maker: manufacturer, for its recommendations. group_read: how many are
    asked at once: Sync Read of protocol 2, Feetech's, Bulk Read of protocol 1, or "" for one after the other. fast_read: firmware
    from which Fast Sync Read is answered, too. marker: a register without effect on the joint,
    reset when the servo restarts.
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
    supply: tuple[float, float]
    full_torque: int
    bit_rates: Mapping[int, int]
    return_delay_unit: float
    eeprom_below: int
    registers: Mapping[str, Register]
    law: Mapping[str, LawRegister]
    nominal: Mapping[str, Uncertain]
    alarms: Mapping[int, str]
    refusals: Mapping[int, str]
    position_mode: Mapping[str, int]
    tolerances: Mapping[str, float] = field(default_factory=dict)
    table_unit: float | None = None
    unlock: Switch | None = None
    watchdog: tuple[str, float] | None = None
    marker: str | None = None
    maker: str = ""
    group_read: Literal["", "sync", "feetech", "bulk"] = ""
    fast_read: int | None = None
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
        """The nominal law of an unmeasured servo, with its uncertainty."""
        keys: dict[str, Any] = dict.fromkeys(LAW_KEYS)
        return ServoConstants(model=self.name, **keys | {k: u.value for k, u in self.nominal.items()} | dict(self.tolerances),
                              sd=tuple((k, u.sd) for k, u in self.nominal.items()))
