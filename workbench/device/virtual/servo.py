"""A virtual servo: its whole control table, its times, its alarms. The moving joint is the body's business."""

from __future__ import annotations

import random
from collections.abc import Callable

from workbench.device.virtual.body import Body, Drive, Sense
from workbench.device.virtual.bus import ServoBus, byte_ticks
from workbench.device.virtual.clock import SECOND
from workbench.device.virtual.protocol import (
    ACTION,
    BROADCAST,
    PING,
    READ,
    REBOOT,
    REG_WRITE,
    RESET,
    SYNC_WRITE,
    WRITE,
    Instruction,
)
from workbench.device.virtual.protocol2 import Protocol2
from workbench.device.virtual.registers import Register, VirtualProfile

VOLTAGE, ANGLE, HEAT, RANGE, CHECKSUM, OVERLOAD, UNKNOWN = (1 << k for k in range(7))
"""Bits of the status packet's error byte."""
TRIPPED = 255
"""Value of a bus watchdog's register once it has stopped the servo."""


class VirtualServo:
    """One servo on a bus, by default an AX-12A as it leaves the factory, but for its ID.

    joint: the body's name for its joint (default: the ID it starts with). seed: phase of its motor interrupt and jitter.
    Faults a test may set: mute (hears, never answers), temperature [deg C], overload (as if stalled for long), settings. It is
    made as one that has started; after its power was off it hears nothing for the family's `boot`, unless not `starts_slowly`.
    """

    def __init__(self, bus: ServoBus, profile: VirtualProfile, ident: int, body: Body, joint: int | None = None,
                 seed: int = 0) -> None:
        self.bus, self.profile, self.body = bus, profile, body
        self.joint = ident if joint is None else joint
        self.mute = False
        self.powered = True
        self.starts_slowly = False
        self.temperature = 30.0
        self.overload = False
        self.written: list[tuple[int, int, int]] = []
        self._rng = random.Random(f"{seed}/{ident}")
        self._phase = self._rng.randrange(round(profile.interrupt[0] * SECOND))
        self._table = bytearray(profile.size)
        self._deaf_until = 0
        self._registered: tuple[int, bytes] | None = None
        self._refreshed = -(10 ** 12)
        self._latched = Sense(0.0)
        self._drive: Drive | None = None
        self._heard = 0
        self.ident, self.rate = ident, 0
        """ID on the bus; bit/s at which it listens and talks."""
        for register in profile.registers:
            self._put(register, register.default)
        self["id"] = ident
        bus.add(self)
        self._power_on()
        self.starts_slowly = True

    # Registers

    def __getitem__(self, name: str) -> int:
        return int.from_bytes(self._table[self.profile.slices[name]], "little")

    def __setitem__(self, name: str, value: int) -> None:
        """Sets a register as if from inside, without checks and times."""
        self._put(self.profile.by_name[name], value)
        if name in _DRIVE:
            self._steer(self.bus.clock.now)

    def has(self, name: str) -> bool:
        """Whether this family has such a register."""
        return name in self.profile.by_name

    def _put(self, register: Register, value: int) -> None:
        self._table[register.address:register.address + register.size] = value.to_bytes(register.size, "little")
        if register.name in ("id", "baud_rate"):
            self._address()

    def _address(self) -> None:
        self.ident, self.rate = self["id"], self.profile.bit_rate(self["baud_rate"])

    # Power

    def power(self, on: bool) -> None:
        """Plug pulled or put back: RAM registers are reset, EEPROM stays."""
        self.bus.silence(self)
        self.powered = on
        if on:
            self._power_on()
        else:
            self.body.drive(self.joint, self.bus.clock.now, Drive())
            self._drive = None

    def _power_on(self) -> None:
        for register in self.profile.registers:
            if not register.eeprom:
                self._put(register, register.default)
        if self.has("torque_limit"):
            self._put(self.profile.by_name["torque_limit"], self["max_torque"])
        self._registered = None
        now = self.bus.clock.now
        if self.starts_slowly:
            self._deaf_until = now + round(self.profile.boot * SECOND)
        angle = self.body.sense(self.joint, now).angle
        self._put(self.profile.by_name["goal_position"], self._count(angle))
        self._steer(now)

    def starting(self, now: int) -> bool:
        """Whether it hears nothing yet, or writes its EEPROM, at a time [ticks]."""
        return now < self._deaf_until

    # Packets

    def receive(self, packet: Instruction, time: int) -> None:
        """A packet has ended on the bus at `time` [ticks]."""
        if not self.powered or time < self._deaf_until:
            return
        if packet.servo not in (self.ident, BROADCAST):
            return
        self._heard = time
        if not packet.intact:
            if packet.servo != BROADCAST:
                self._answer(time, CHECKSUM, b"", self.profile.answer_times[0], level=2)
            return
        if packet.instruction == SYNC_WRITE:
            self._sync_write(packet, time)
            return
        do = _DO.get(packet.instruction)
        if do is None:
            if packet.servo != BROADCAST:
                self._answer(time, UNKNOWN, b"", self.profile.answer_times[0], level=2)
            return
        do(self, packet, time)

    def _ping(self, packet: Instruction, time: int) -> None:
        identity = self.profile.protocol.identity(self["model_number"], self["firmware_version"])
        self._answer(time, 0, identity, self.profile.answer_times[0], level=0)

    def _read(self, packet: Instruction, time: int) -> None:
        if packet.servo == BROADCAST:
            return
        if len(packet.parameters) != 2:
            self._answer(time, RANGE, b"", self.profile.answer_times[1], level=1)
            return
        address, count = packet.parameters
        if not count or address + count > self.profile.size:
            self._answer(time, RANGE, b"", self.profile.answer_times[1], level=1)
            return
        self.alarms()
        self._refresh(time)
        self._answer(time, 0, bytes(self._table[address:address + count]), self.profile.answer_times[1], level=1)

    def answer_in_turn(self, what: bytes, time: int) -> int | None:
        """The servo's answer, in its turn, to a question for `what` (address and count) that went to many. Returns when its last
        byte is out; None where it is silent."""
        address, count = what
        if not self.powered or self.mute or time < self._deaf_until or address + count > self.profile.size:
            return None
        self._heard = time
        self.alarms()
        self._refresh(time)
        return self._answer(time, 0, bytes(self._table[address:address + count]), self.profile.answer_times[1], level=1)

    def add_block(self, what: bytes, time: int, head: bytes, so_far: bytes) -> tuple[int, bytes] | None:
        """This servo's part of the one packet that answers a Fast Sync Read for `what`, address and count, when it is its turn:
        when its last byte is out [ticks], and the part without the head, which the first servo sends. None where it says
        nothing."""
        address, count = what
        protocol = self.profile.protocol
        able = self.powered and not self.mute and time >= self._deaf_until and address + count <= self.profile.size
        if not able or not isinstance(protocol, Protocol2):
            return None
        self._heard = time
        alarms = self.alarms()
        self._refresh(time)
        block = protocol.block(head + so_far, self.ident, alarms, bytes(self._table[address:address + count]))
        data = block if so_far else head + block
        delay = self["return_delay_time"] * self.profile.return_delay_unit if not so_far else 0.0
        first = time + round((delay + self.profile.answer_times[1] * (not so_far) + self._rng.uniform(0, 2e-6)) * SECOND)
        return self.bus.talk(self, data, self.rate, self._starts(first, len(data))), block

    def _write(self, packet: Instruction, time: int) -> None:
        error, ready = RANGE, time
        took = self.profile.answer_times[2] + self.profile.answer_times[3] * max(len(packet.parameters) - 1, 0)
        if len(packet.parameters) > 1:
            error, eeprom = self.store(packet.parameters[0], packet.parameters[1:], time)
            ready += round(eeprom * self.profile.eeprom_time * self._rng.uniform(5 / 6, 7 / 6) * SECOND)
        if packet.servo != BROADCAST:
            self._answer(time, error, b"", took, level=2, ident=packet.servo)  # still under the ID that was addressed
        self._deaf_until = max(self._deaf_until, ready)

    def _register_write(self, packet: Instruction, time: int) -> None:
        if len(packet.parameters) > 1:
            self._registered = packet.parameters[0], packet.parameters[1:]
            if self.has("registered"):
                self["registered"] = 1
        self._answer(time, 0, b"", self.profile.answer_times[2], level=2, broadcast=packet.servo == BROADCAST)

    def _action(self, packet: Instruction, time: int) -> None:
        if self._registered is not None:
            self.store(*self._registered, time)
            self._registered = None
            if self.has("registered"):
                self["registered"] = 0
        self._answer(time, 0, b"", self.profile.answer_times[0], level=2, broadcast=packet.servo == BROADCAST)

    def _reset(self, packet: Instruction, time: int) -> None:
        self._answer(time, 0, b"", self.profile.answer_times[0], level=2, broadcast=packet.servo == BROADCAST)
        for register in self.profile.registers:
            if register.eeprom:
                self._put(register, register.default)
        self._power_on()

    def _reboot(self, packet: Instruction, time: int) -> None:
        self._answer(time, 0, b"", self.profile.answer_times[0], level=2, broadcast=packet.servo == BROADCAST)
        self.overload = False
        self._power_on()

    def _sync_write(self, packet: Instruction, time: int) -> None:
        if packet.servo != BROADCAST or len(packet.parameters) < 3:
            return
        address, count = packet.parameters[:2]
        for k in range(2, len(packet.parameters) - count, count + 1):
            if packet.parameters[k] == self.ident:
                _, eeprom = self.store(address, packet.parameters[k + 1:k + 1 + count], time)
                self._deaf_until = max(self._deaf_until, time + round(eeprom * self.profile.eeprom_time * SECOND))

    def store(self, address: int, values: bytes, time: int) -> tuple[int, int]:
        """Writes what may be written, all or nothing. Returns error bits and how many EEPROM bytes were written."""
        new = bytearray(self._table)
        if address + len(values) > self.profile.size:
            return RANGE, 0
        new[address:address + len(values)] = values
        touched: dict[str, Register] = {}
        for k in range(address, address + len(values)):
            if k not in self.profile.at:
                return RANGE, 0
            touched[self.profile.at[k][0].name] = self.profile.at[k][0]
        error = self._refusal(touched, new)
        if error:
            return error, 0
        self._table = new
        self._address()  # the answer to this comes at the new rate
        for register in touched.values():
            self.written.append((time, register.address, self[register.name]))
        if "goal_position" in touched and self.profile.goal_enables:
            self._put(self.profile.by_name["torque_enable"], 1)
        if touched.keys() & _DRIVE:
            self._steer(time)
        if "bus_watchdog" in touched:
            self._watch()
        return 0, sum(r.size for r in touched.values() if r.eeprom)

    def _watch(self) -> None:
        """A watchdog that is set stops the servo where it is, once it has not been spoken to for so long (20 ms a count)."""
        count = self["bus_watchdog"]
        if count in (0, TRIPPED):
            return
        due = self._heard + round(0.02 * count * SECOND)
        if self.bus.clock.now < due:
            self.bus.clock.at(due, self._watch)
            return
        self._put(self.profile.by_name["bus_watchdog"], TRIPPED)
        angle = self.body.sense(self.joint, self.bus.clock.now).angle
        self._put(self.profile.by_name["goal_position"], self._count(angle))
        self._steer(self.bus.clock.now)

    def _refusal(self, touched: dict[str, Register], new: bytearray) -> int:
        for register in touched.values():
            value = int.from_bytes(new[register.address:register.address + register.size], "little")
            if not register.writable or not register.low <= value <= register.high:
                return RANGE
            if register.eeprom and (self._locked or (not self.profile.goal_enables and self["torque_enable"])):
                return RANGE
            if register.name == "goal_position" and self.has("bus_watchdog") and self["bus_watchdog"] == TRIPPED:
                return RANGE
            if register.name == "goal_position" and not self._wheel and not (
                    self["cw_angle_limit"] <= value <= self["ccw_angle_limit"]):
                return ANGLE
            if register.name == "lock" and self["lock"] and not value and not self.profile.eeprom_lock:
                return RANGE  # until the power goes
        return 0

    @property
    def _locked(self) -> bool:
        return self.has("lock") and bool(self["lock"])

    @property
    def _wheel(self) -> bool:
        return self["cw_angle_limit"] == 0 and self["ccw_angle_limit"] == 0

    def _answer(self, time: int, error: int, parameters: bytes, took: float, level: int, broadcast: bool = False,
                ident: int | None = None) -> int | None:
        """Puts an answer on the wire; when its last byte will be out [ticks], None where there is none."""
        if broadcast or self.mute or self["status_return_level"] < level:
            return None
        delay = self["return_delay_time"] * self.profile.return_delay_unit + took + self._rng.uniform(0, 2e-6)
        data = self.profile.protocol.status(self.ident if ident is None else ident, error | self.alarms(), parameters)
        return self.bus.talk(self, data, self.rate, self._starts(time + round(delay * SECOND), len(data)))

    def _starts(self, first: int, count: int) -> list[int]:
        """Starts of so many bytes; none falls into the motor interrupt."""
        period, length = (round(x * SECOND) for x in self.profile.interrupt)
        byte = byte_ticks(self.rate)
        starts = []
        at = first
        for _ in range(count):
            inside = (at - self._phase) % period
            if inside < length:
                at += length - inside
            starts.append(at)
            at += byte
        return starts

    # What it feels and does

    def alarms(self) -> int:
        """Error bits of its state; those in the shutdown mask take the torque away and stay until power or reboot."""
        bits = 0
        if self.temperature >= self["temperature_limit"]:
            bits |= HEAT
        if not self["min_voltage_limit"] <= round(10 * self.bus.supply) <= self["max_voltage_limit"]:
            bits |= VOLTAGE
        if self.overload:
            bits |= OVERLOAD
        if self.has("hardware_error"):
            self._put(self.profile.by_name["hardware_error"], bits)
        shut = "torque_limit" if self.profile.goal_enables else "torque_enable"
        if bits & self["alarm_shutdown"] and self[shut]:
            self[shut] = 0
        return bits

    def _count(self, angle: float) -> int:
        count = round(self.profile.centre + angle * self.profile.counts / self.profile.span)
        return min(max(count, 0), self.profile.counts)

    def _angle(self, count: int) -> float:
        return (count - self.profile.centre) * self.profile.span / self.profile.counts

    def _refresh(self, now: int) -> None:
        """Position is new at every read, speed and load only every `refresh` seconds."""
        sense = self.body.sense(self.joint, now)
        put, name = self._put, self.profile.by_name
        put(name["present_position"], self._count(sense.angle))
        put(name["moving"], int(abs(sense.velocity) > 0))
        put(name["present_voltage"], min(round(10 * self.bus.supply), 255))
        put(name["present_temperature"], min(round(self.temperature), 255))
        if now - self._refreshed >= self.profile.refresh * SECOND:
            self._refreshed, self._latched = now, sense
        speed, load = self._latched.velocity / self.profile.speed_unit, self.profile.full_torque * self._latched.duty
        put(name["present_speed"], _encode(speed, self.profile.speed_sign, name["present_speed"].size))
        put(name["present_load"], _encode(load, self.profile.load_sign, name["present_load"].size))

    def _steer(self, now: int) -> None:
        on = self.powered and bool(self["torque_enable"])
        def law(register: str) -> int | None:
            return self[register] if self.has(register) else None

        drive = Drive(on, self._angle(self["goal_position"]), self["moving_speed"] * self.profile.speed_unit,
                      self["torque_limit"] / self.profile.full_torque, law("cw_compliance_margin"),
                      law("cw_compliance_slope"), law("punch"))
        if drive != self._drive:
            self._drive = drive
            self.body.drive(self.joint, now, drive)


def _encode(value: float, sign: int, size: int) -> int:
    """Register content of a number: magnitude and a bit for the sign, or two's complement in so many bytes (sign 0)."""
    if not sign:
        return round(value) % (1 << 8 * size)
    return min(round(abs(value)), 1023) | (sign if value < 0 else 0)


_DRIVE = {"torque_enable", "goal_position", "moving_speed", "torque_limit", "cw_compliance_margin", "cw_compliance_slope",
          "punch"}

_DO: dict[int, Callable[[VirtualServo, Instruction, int], None]] = {
    PING: VirtualServo._ping,
    READ: VirtualServo._read,
    WRITE: VirtualServo._write,
    REG_WRITE: VirtualServo._register_write,
    ACTION: VirtualServo._action,
    RESET: VirtualServo._reset,
    REBOOT: VirtualServo._reboot,
}
