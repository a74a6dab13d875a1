"""A half-duplex bus in virtual time: who talks when, byte for byte; two at once garble each other, and it is written down."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Protocol

from workbench.device.virtual import protocol2
from workbench.device.virtual.clock import SECOND, Clock
from workbench.device.virtual.protocol import BROADCAST, BULK_READ, FAST_SYNC_READ, SYNC_READ, Instruction

if TYPE_CHECKING:
    from workbench.device.virtual.servo import VirtualServo

Line = Callable[[int], int]
"""Effect of a stretch of cable on a byte."""


class Talker(Protocol):
    """Whoever puts bytes on the bus and hears what others put there."""

    def hear(self, times: Sequence[int], values: bytes, garbled: Sequence[bool], rate: int) -> None:
        """Bytes of others, each with the time at which its stop bit ended [ticks]; rate: bit/s."""
        ...


@dataclass(eq=False)
class Burst:
    """Bytes of one talker, not yet all delivered: the ends of their stop bits [ticks]."""

    talker: object
    rate: int
    ends: list[int]
    values: bytearray
    garbled: list[bool]
    done: int = 0
    byte: int = field(init=False)

    def __post_init__(self) -> None:
        self.byte = byte_ticks(self.rate)


@dataclass(frozen=True)
class Collision:
    """Two talked at once: when [ticks], and who."""

    time: int
    first: object
    second: object


def byte_ticks(rate: int) -> int:
    """Duration of a byte with start and stop bit [ticks]."""
    return 10 * SECOND // rate


class ServoBus:
    """The wire with its servos; controllers and adapters talk by `talk` and listen by `join`.

    to_servos, from_servos: effect of the cable on bytes in each direction (`bit_flips`). All servos share one decoder for each
    bit rate, as they all hear the same.
    """

    def __init__(self, clock: Clock, to_servos: Line | None = None, from_servos: Line | None = None) -> None:
        self.clock = clock
        self.to_servos, self.from_servos = to_servos, from_servos
        self.servos: list[VirtualServo] = []
        self.collisions: list[Collision] = []
        self.supply = 11.1
        self._hosts: list[Talker] = []
        self._flying: list[Burst] = []
        self._decoders: dict[tuple[int, int], Callable[[int], Instruction | None]] = {}
        self._last_byte: dict[tuple[int, int], int] = {}
        self._talking_until: dict[int, int] = {}

    def join(self, host: Talker) -> None:
        """A controller or an adapter, that hears all but itself."""
        self._hosts.append(host)

    def add(self, servo: VirtualServo) -> None:
        """Adds a servo to the chain."""
        self.servos.append(servo)

    def talk(self, talker: object, values: bytes, rate: int, starts: Sequence[int] | int) -> int:
        """Puts bytes on the wire, back to back from one start, or each at its own [ticks]. Returns the end of the last."""
        length = byte_ticks(rate)
        if isinstance(starts, int):
            ends = list(range(starts + length, starts + length * len(values) + 1, length))
        else:
            ends = [start + length for start in starts]
        line = self.to_servos if talker in self._hosts else self.from_servos
        if line is not None:
            values = bytes(line(value) for value in values)
        burst = Burst(talker, rate, ends, bytearray(values), [False] * len(values))
        self.settle()
        for other in self._flying:
            if other.ends[-1] > ends[0] - length and ends[-1] > other.ends[0] - other.byte:
                self._collide(other, burst)
        self._flying.append(burst)
        self._talking_until[id(talker)] = max(ends[-1], self._talking_until.get(id(talker), 0))
        self.clock.at(ends[-1], self.settle)
        return ends[-1]

    def silence(self, talker: object) -> None:
        """Bytes that this talker has not sent yet are dropped, as when its power fails."""
        self.settle()
        self._flying = [b for b in self._flying if b.talker is not talker]

    @property
    def idle(self) -> bool:
        """Nobody talks, nobody is about to."""
        return not self._flying

    def settle(self) -> None:
        """Delivers every byte whose end has come."""
        now = self.clock.now
        for burst in list(self._flying):
            first = burst.done
            ends = burst.ends
            if ends[-1] <= now:
                last = len(ends)
                self._flying.remove(burst)
            else:
                last = first
                while ends[last] <= now:
                    last += 1
            if last > first:
                burst.done = last
                self._deliver(burst, first, last)

    def _deliver(self, burst: Burst, first: int, last: int) -> None:
        ends, values, garbled = burst.ends[first:last], bytes(burst.values[first:last]), burst.garbled[first:last]
        for host in self._hosts:
            if host is not burst.talker:
                host.hear(ends, values, garbled, burst.rate)
        if burst.talker in self.servos:  # an answer is no instruction, though its bytes look like one
            return
        for servo_rate, kind in {(s.rate, id(s.profile.protocol)): s.profile.protocol for s in self.servos}.items():
            self._decode(servo_rate, kind.decoder, burst, ends, values)

    def _decode(self, key: tuple[int, int], decoder: Callable[[], Callable[[int], Instruction | None]], burst: Burst,
                ends: list[int], values: bytes) -> None:
        """The servos of one bit rate hear; bytes at a rate more than 3 % off are noise that ends any packet."""
        if abs(burst.rate - key[0]) > 0.03 * key[0]:
            self._decoders.pop(key, None)
            return
        if ends[0] - self._last_byte.get(key, ends[0]) > PACKET_PAUSE:
            self._decoders.pop(key, None)
        self._last_byte[key] = ends[-1]
        if key not in self._decoders:
            self._decoders[key] = decoder()
        feed = self._decoders[key]
        for end, value in zip(ends, values):
            packet = feed(value)
            if packet is not None:
                self._dispatch(packet, end, burst, key)

    def _dispatch(self, packet: Instruction, end: int, burst: Burst, key: tuple[int, int]) -> None:
        start = end - burst.byte * (len(packet.parameters) + 6)
        if packet.instruction == SYNC_READ and packet.servo == BROADCAST and packet.intact:
            self._asked_in_turn(packet.parameters[:2], list(packet.parameters[2:]), key, end)
            return
        if packet.instruction == FAST_SYNC_READ and packet.servo == BROADCAST and packet.intact:
            what, ids = packet.parameters[:2], list(packet.parameters[2:])
            length = (len(ids) * (what[1] + 4) + 1).to_bytes(2, "little")
            self._one_packet(what, ids, key, end, protocol2.HEADER + b"\xfe" + length + bytes([protocol2.STATUS]), b"")
            return
        if packet.instruction == BULK_READ and packet.servo == BROADCAST and packet.intact:
            count, address = packet.parameters[1], packet.parameters[3]
            self._asked_in_turn(bytes([address, count]), list(packet.parameters[2::3]), key, end)
            return
        for servo in self.servos:
            if packet.servo not in (servo.ident, BROADCAST) or servo is burst.talker:
                continue
            if (servo.rate, id(servo.profile.protocol)) != key:
                continue
            if self._talking_until.get(id(servo), -1) > start:  # it was talking itself, and heard nothing
                continue
            servo.receive(packet, end)

    def _asked_in_turn(self, what: bytes, ids: list[int], key: tuple[int, int], time: int) -> None:
        """Sync Read: each answers when the one before it has; one that does not silences all after it."""
        if not ids:
            return
        ends = [servo.answer_in_turn(what, time) for servo in self.servos
                if servo.ident == ids[0] and (servo.rate, id(servo.profile.protocol)) == key]
        answered = [end for end in ends if end is not None]
        if answered:
            self.clock.at(max(answered), partial(self._asked_in_turn, what, ids[1:], key, max(answered)))

    def _one_packet(self, what: bytes, ids: list[int], key: tuple[int, int], time: int, head: bytes, so_far: bytes) -> None:
        """Fast Sync Read: each adds its block when the one before it has; the first sends the head, too."""
        if not ids:
            return
        there = [servo for servo in self.servos
                 if servo.ident == ids[0] and (servo.rate, id(servo.profile.protocol)) == key]
        blocks = [(end, data) for servo in there if (block := servo.add_block(what, time, head, so_far)) for end, data in [block]]
        if blocks:
            end, data = max(blocks)
            self.clock.at(end, partial(self._one_packet, what, ids[1:], key, end, head, so_far + data))

    def _collide(self, one: Burst, two: Burst) -> None:
        """Garbles bytes of two senders that overlap; the stop bit breaks."""
        k = one.done
        for i, end in enumerate(two.ends):
            start = end - two.byte
            while k < len(one.ends) and one.ends[k] <= start:
                k += 1
            j = k
            while j < len(one.ends) and one.ends[j] - one.byte < end:
                if not two.garbled[i] or not one.garbled[j]:
                    self.collisions.append(Collision(start, one.talker, two.talker))
                mixed = one.values[j] & two.values[i]
                differ = one.values[j] != two.values[i] or one.ends[j] != end
                one.values[j] = two.values[i] = mixed
                one.garbled[j] = one.garbled[j] or differ
                two.garbled[i] = two.garbled[i] or differ
                j += 1


PACKET_PAUSE = SECOND // 10
"""A packet that stops for longer is discarded by a servo [ticks]. Not documented; any value above a few ms is consistent."""
