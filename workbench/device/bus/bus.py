"""Reading and writing servos by the names of their registers; every answer is looked at, every failure is an exception."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

from dynamixel_sdk import COMM_RX_CORRUPT, COMM_SUCCESS, PacketHandler

from workbench.device.bus import group, wire
from workbench.device.bus.errors import BusError, NoAnswerError, PortGoneError
from workbench.device.bus.ports import GONE, StripEcho, port_gone
from workbench.robot.servo_profile import Register, ServoProfile

T = TypeVar("T")
LONGEST = 200
"""Bytes of parameters in one Sync Write: below the SDK's 250 and the AX-12's receive buffer with some to spare."""


@dataclass(frozen=True)
class BusOptions:
    """tries: how often a servo is asked before it counts as silent; at 1 % of answers lost, three leave one in a million.
    settle: pause after a byte of EEPROM was written [s] (AX-12: 6 ms a byte, in which it is deaf)."""

    tries: int = 3
    settle: float = 0.01


class Bus:
    """Servos on one port, of one family.

    port: dynamixel-sdk's, with `pause` and `patience` (`SerialPort`, or a virtual one). joints: by ID, for messages.
    alarms: state in each servo's last answer. retries: by ID, how often it had to be asked again.
    strip_echo: for an adapter that is known to hear itself; any other that does is refused. latency: delay of answers
    beyond their bytes [s], once it was measured. group_kind: how many servos are asked at once, "" for one after the
    other. asked: when the last byte of the last question was out [s], since the servo answers with its state at that time.
    """

    def __init__(self, port: Any, profile: ServoProfile, joints: Mapping[int, str] | None = None,
                 options: BusOptions | None = None, strip_echo: bool = False) -> None:
        self.port, self.profile, self.options = port, profile, options or BusOptions()
        self.joints = dict(joints or {})
        self.alarms: dict[int, tuple[str, ...]] = {}
        self.retries: Counter[int] = Counter()
        self._handler = PacketHandler(float(profile.protocol))
        self.latency, self.asked = 0.0, 0.0
        self.group_kind: group.Kind | Literal[""] = profile.group_read
        if strip_echo:
            self.port = StripEcho(port)
        elif self._using_port(lambda: wire.hears_itself(port, profile.protocol)):
            raise wire.echo_error()

    # Time

    def now(self) -> float:
        """The port's clock [s]."""
        return float(self.port.getCurrentTime()) / 1000

    def wait_until(self, time: float) -> None:
        """Lets time go by until then [s]."""
        self._using_port(lambda: self.port.pause(time - self.now()))

    def pause(self, seconds: float) -> None:
        """Lets time go by."""
        self._using_port(lambda: self.port.pause(seconds))

    def close(self) -> None:
        """Gives the port back; one that is gone is none."""
        with suppress(*GONE):
            self.port.closePort()

    # One servo

    def read(self, servo: int, *names: str) -> dict[str, int]:
        """Registers by name, in one packet from the first to the last of them; asked again where the answer is missing or broken.

        NoAnswerError after `tries`, BusError where the servo refuses."""
        wanted, first, count = self._block(names)

        def call() -> tuple[bytes, int, int]:
            self.asked = self.now() + (8 if self.profile.protocol == 1 else 14) * self.port.tx_time_per_byte / 1000
            question = wire.read_packet(self.profile.protocol, servo, first, count)
            answer, result, error = self._handler.txRxPacket(self.port, question)
            return wire.parameters_of(self.profile.protocol, answer) if result == COMM_SUCCESS else b"", result, error

        data = self._ask(servo, names[0] if len(names) == 1 else None, call, count)
        return {r.name: r.decode(data[r.address - first:r.address - first + r.size]) for r in wanted}

    def write(self, servo: int, values: Mapping[str, int], check: bool = True) -> None:
        """Writes registers one by one and, with `check`, reads each back. BusError names the first mismatch. A servo
        that answers reads only (status_return_level 1) is judged by its readings.

        EEPROM of a family that locks it is unlocked before and locked after."""
        eeprom = any(self._register(name).address < self.profile.eeprom_below for name in values)
        switch = self.profile.unlock if eeprom else None
        if switch is not None:
            self._switch(servo, switch.register, switch.open)
        for name, value in values.items():
            with suppress(*([NoAnswerError] if check else [])):
                self._write(servo, name, value)
            if check and self.read(servo, name)[name] != value:
                found = self.read(servo, name)[name]
                raise BusError(f"reads {found} after {value} was written", servo, self.joints.get(servo), name)
        if switch is not None and "id" not in values:
            self._switch(servo, switch.register, switch.closed)

    def _switch(self, servo: int, name: str, value: int) -> None:
        """Writes a register of which only the effect on others counts; whether it answered does not matter."""
        with suppress(NoAnswerError):
            self._write(servo, name, value)

    def exists(self, servo: int, tries: int | None = None) -> int | None:
        """Model number of a servo, None where none answers to so many questions (default: the options')."""
        kept, self.options = self.options, replace(self.options, tries=tries or self.options.tries)
        try:
            return self.read(servo, "model_number")["model_number"]
        except NoAnswerError:
            return None
        finally:
            self.options = kept

    def reboot(self, servo: int) -> None:
        """Restarts a servo, where its protocol can; clears a latched alarm."""
        if self.profile.protocol != 2:
            raise BusError("cannot be restarted over the bus; switch its power off and on", servo, self.joints.get(servo))
        self._ask(servo, None, lambda: (b"", *self._handler.reboot(self.port, servo)), 0)

    # All

    def read_all(self, servos: Sequence[int], *names: str) -> dict[int, dict[str, int]]:
        """Registers of many servos by one question that they answer in turn, asked once, where the family can; by ID, without
        those of which no whole answer came. Where one is silent, those after it may be, too."""
        kind = self.group_kind
        if not kind:
            raise ValueError(f"{self.profile.name} cannot be asked all at once")
        wanted, first, count = self._block(names)
        packet = group.question(kind, servos, first, count)
        self.asked = self.now() + len(packet) * self.port.tx_time_per_byte / 1000
        heard = self._using_port(lambda: wire.collect(self.port, packet, group.reply_length(kind, len(servos), count)))
        out = {}
        for servo, (error, data) in group.answers(kind, heard, count, servos).items():
            self._look(servo, error)
            out[servo] = {r.name: r.decode(data[r.address - first:r.address - first + r.size]) for r in wanted}
        if heard and len(out) < len(servos):
            self._using_port(lambda: wire.wait_for_silence(self.port))
        return out

    def sync_write(self, values: Mapping[int, Mapping[str, int]]) -> float:
        """Writes the same registers of many servos in one packet (or as few as hold them), which nobody answers. Returns when its
        last byte is out and the servos have it [s]. ValueError where the registers do not lie side by side."""
        names = next(iter(values.values())).keys()
        registers = sorted((self._register(name) for name in names), key=lambda r: r.address)
        for one, two in itertools.pairwise(registers):
            if one.address + one.size != two.address:
                raise ValueError(f"{one.name} and {two.name} do not lie side by side")
        length = sum(r.size for r in registers)
        packed = [bytes([servo]) + b"".join(r.encode(v[r.name]) for r in registers) for servo, v in values.items()]
        sent, frame = self.now(), 8 if self.profile.protocol == 1 else 14
        for some in _split(packed, LONGEST // (length + 1)):
            parameters = list(b"".join(some))
            result = self._using_port(lambda: self._handler.syncWriteTxOnly(
                self.port, registers[0].address, length, parameters, len(parameters)))  # noqa: B023
            if result != COMM_SUCCESS:
                raise BusError(f"could not be sent: {self._handler.getTxRxResult(result)}")
            sent = self.now() + (len(parameters) + frame) * self.port.tx_time_per_byte / 1000
        return sent

    def release(self, servos: Iterable[int]) -> None:
        """Torque off, broadcast twice, as nobody answers; never raises for a servo, only where the port is gone."""
        off = {servo: {"torque_enable": 0} for servo in servos}
        for _ in range(2 if off else 0):
            self.sync_write(off)
            self.pause(0.002)

    def let_go(self, servos: Iterable[int], seconds: float = 1.0) -> tuple[int, ...]:
        """Torque off, read back, and written again for so long [s] to servos that do not confirm it: a packet with a wrong length
        may have swallowed the ones after it. Returns the servos whose torque is unknown."""
        waiting, end = list(servos), self.now() + seconds
        while True:
            self.release(waiting)
            for servo in list(waiting):
                try:
                    if not self.read(servo, "torque_enable")["torque_enable"]:
                        waiting.remove(servo)
                except PortGoneError:
                    raise
                except BusError:
                    continue
            if not waiting or self.now() >= end:
                return tuple(waiting)
            self.pause(0.02)

    def find(self, servos: Iterable[int]) -> dict[int, int]:
        """Model numbers of those that answer, by ID; asked once each, the silent ones twice."""
        asked = {servo: self.exists(servo, tries=2) for servo in servos}
        return {servo: number for servo, number in asked.items() if number is not None}

    def find_at_any_rate(self, servos: Iterable[int]) -> dict[int, dict[int, int]]:
        """Who answers at which of the family's bit rates; the port's own is set again."""
        wanted, own, found = list(servos), int(self.port.getBaudRate()), {}
        for rate in sorted(set(self.profile.bit_rates.values()), reverse=True):
            if self._using_port(lambda: self.port.setBaudRate(rate)):  # noqa: B023
                here = self.find(wanted)
                if here:
                    found[rate] = here
        self._using_port(lambda: self.port.setBaudRate(own))
        return found

    def answers(self, servo: int) -> int:
        """How many servos seem to answer to one ID, of five pings: 2 where answers are longer than one, or broken, again and
        again."""
        protocol = self.profile.protocol
        packet, most = wire.ping(protocol, servo), 24 if protocol == 1 else 56
        heard = [self._using_port(lambda: wire.hear(self.port, packet, most, self.port.patience)) for _ in range(5)]
        if not any(heard):
            return 0
        return 2 if sum(bool(answer) and not wire.clean(protocol, answer) for answer in heard) >= 3 else 1

    # Inside

    def _register(self, name: str) -> Register:
        if name not in self.profile.registers:
            raise BusError(f"{self.profile.name} has no such register", register=name)
        return self.profile.registers[name]

    def _block(self, names: Sequence[str]) -> tuple[list[Register], int, int]:
        """Registers, and address and length of the shortest piece of the table that holds them."""
        wanted = [self._register(name) for name in names]
        first = min(r.address for r in wanted)
        return wanted, first, max(r.address + r.size for r in wanted) - first

    def _write(self, servo: int, name: str, value: int) -> None:
        register = self._register(name)
        data = list(register.encode(value))

        def call() -> tuple[bytes, int, int]:
            return b"", *self._handler.writeTxRx(self.port, servo, register.address, register.size, data)

        self._ask(servo, name, call, 0)
        if register.address < self.profile.eeprom_below:
            self.pause(self.options.settle * register.size)

    def _ask(self, servo: int, register: str | None, call: Callable[[], tuple[bytes, int, int]], count: int) -> bytes:
        """An answer, asked for again and again; its error byte is the servo's alarms, or a refusal."""
        joint, result = self.joints.get(servo), COMM_SUCCESS
        for attempt in range(self.options.tries):
            data, result, error = self._using_port(call)
            if result == COMM_SUCCESS and len(data) == count:
                if attempt:
                    self.retries[servo] += attempt
                refused = self._look(servo, error)
                if refused:
                    raise BusError(f"refused: {refused}", servo, joint, register)
                return data
            if result in (COMM_RX_CORRUPT, COMM_SUCCESS):
                self._using_port(lambda: wire.wait_for_silence(self.port))
        how = "only broken answers" if result in (COMM_RX_CORRUPT, COMM_SUCCESS) else "no answer"
        raise NoAnswerError(f"{how} in {self.options.tries} tries", servo, joint, register)

    def _look(self, servo: int, error: int) -> str:
        """Records the alarms in an error byte; returns the reason why the instruction was refused, or ""."""
        profile = self.profile
        if profile.protocol == 1:
            self.alarms[servo] = tuple(name for bit, name in profile.alarms.items() if error >> bit & 1)
            return ", ".join(name for bit, name in profile.refusals.items() if error >> bit & 1)
        if error & 0x80 and "hardware_error" in profile.registers:
            register = profile.registers["hardware_error"]
            data, result, _ = self._using_port(
                lambda: self._handler.readTxRx(self.port, servo, register.address, register.size))
            bits = register.decode(bytes(data)) if result == COMM_SUCCESS and data else 0
            self.alarms[servo] = tuple(name for bit, name in profile.alarms.items() if bits >> bit & 1) or ("unknown",)
        else:
            self.alarms[servo] = ()
        return profile.refusals.get(error & 0x7F, f"error {error & 0x7F}") if error & 0x7F else ""

    def _using_port(self, call: Callable[[], T]) -> T:
        """Whatever happens, the port may be used again afterwards."""
        try:
            return call()
        except BusError:
            raise
        except GONE as e:
            raise port_gone(e) from None
        finally:
            self.port.is_using = False


def _split(items: list[bytes], size: int) -> Iterable[list[bytes]]:
    for k in range(0, len(items), max(size, 1)):
        yield items[k:k + size]
