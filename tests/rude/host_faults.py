"""Faults of the host's campaign: at its own packets, at the servos' answers, or in the whole run."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from workbench.device.virtual import SECOND, VirtualServo
from workbench.device.virtual.protocol import READ
from workbench.device.virtual.protocol import packet as packet1
from workbench.device.virtual.protocol2 import packet as packet2

if TYPE_CHECKING:
    from tests.rude.host_campaign import Run

# Faults at the host's packets: what becomes of one, None where nothing goes out.

def _stall(shortest: float, longest: float) -> Callable[[Run, list[int]], list[int] | None]:
    def strike(run: Run, packet: list[int]) -> list[int]:
        if run.due(once=longest > 0.1):
            run.robot.port.pause(run.rng.uniform(shortest, longest))
        return packet
    return strike


def _garbled_command(run: Run, packet: list[int]) -> list[int]:
    if run.due():
        packet[run.rng.randrange(len(packet))] ^= 1 << run.rng.randrange(8)
    return packet


def _lost_command(run: Run, packet: list[int]) -> list[int] | None:
    return None if run.due() else packet


def _once(do: Callable[[Run], None]) -> Callable[[Run, list[int]], list[int] | None]:
    def strike(run: Run, packet: list[int]) -> list[int]:
        if run.due(once=True):
            do(run)
        return packet
    return strike


def _mute(run: Run) -> None:
    run.robot.servos["two"].mute = True
    run.unheard.add(2)


def _hot(run: Run) -> None:
    run.robot.servos["two"].temperature = 69.0


def _overload(run: Run) -> None:
    run.robot.servos["two"].overload = True


def _cable(run: Run) -> None:
    run.robot.servos["two"].power(False)
    run.excused.add(2)


def _half_unplugged(run: Run) -> None:
    """A plug in the middle of the chain: the servos behind it are gone."""
    for joint in ("two", "three"):
        run.robot.servos[joint].power(False)
        run.excused.add(run.robot.model.bus_ids[joint])


def _restart(run: Run) -> None:
    run.robot.servos["two"].power(False)
    run.robot.servos["two"].power(True)


def _brown_out(run: Run) -> None:
    for servo in run.robot.servos.values():
        servo.power(False)
        servo.power(True)


def _twin(run: Run) -> None:
    """A servo with an ID that is taken is plugged in."""
    one = run.robot.servos["two"]
    twin = VirtualServo(run.robot.wire, one.profile, one.ident, run.robot.body, joint=99, seed=run.seed + 1)
    twin["return_delay_time"] = 0
    run.unheard.add(one.ident)


def _deaf(run: Run) -> None:
    """The host's own packets still go out."""
    run.robot.port.hear = lambda times, values, garbled, rate: None
    run.unheard |= set(run.robot.model.bus_ids.values())


def _level_1(run: Run) -> None:
    """Writes are no longer answered."""
    run.robot.servos["two"]["status_return_level"] = 1


class _Other:
    """A second program with an adapter of its own: reads a servo every few milliseconds, whoever talks."""

    def __init__(self, run: Run) -> None:
        self._run, self._wire = run, run.robot.wire
        packet = packet2(2, READ, bytes([132, 0, 4, 0])) if run.family == "XL-330" else packet1(2, READ, bytes([36, 2]))
        self._packet = packet
        self._wire.join(self)
        self._ask()

    def hear(self, times: object, values: bytes, garbled: object, rate: int) -> None:
        pass

    def _ask(self) -> None:
        self._wire.talk(self, self._packet, 1_000_000, self._wire.clock.now + 1)
        if self._run.armed:
            self._wire.clock.after(round(self._run.rng.uniform(0.004, 0.03) * SECOND), self._ask)


def _second_program(run: Run) -> None:
    _Other(run)


def _unplug(run: Run) -> None:
    run.robot.port.unplugged = True


def _ctrl_c(run: Run) -> None:
    run.stop.ask("Ctrl-C")


def _ctrl_c_twice(run: Run) -> None:
    run.stop.ask("Ctrl-C")
    run.robot.at(0.02, lambda: run.stop.ask("Ctrl-C"))


AT_WRITES: dict[str, Callable[[Run, list[int]], list[int] | None]] = {
    "short stall": _stall(0.005, 0.06),
    "stall": _stall(0.06, 0.3),
    "long stall": _stall(0.3, 0.6),
    "garbled command": _garbled_command,
    "lost command": _lost_command,
    "silent servo": _once(_mute),
    "hot servo": _once(_hot),
    "overload": _once(_overload),
    "cable": _once(_cable),
    "half unplugged": _once(_half_unplugged),
    "restart": _once(_restart),
    "brown-out": _once(_brown_out),
    "twin": _once(_twin),
    "return level 1": _once(_level_1),
    "second program": _once(_second_program),
    "deaf port": _once(_deaf),
    "unplugged": _once(_unplug),
    "ctrl-c": _once(_ctrl_c),
    "ctrl-c twice": _once(_ctrl_c_twice)}


# Faults at the servos' answers.

def _lost(run: Run, values: bytes, starts: list[int] | int) -> tuple[bytes, list[int] | int]:
    return b"", starts


def _cut(run: Run, values: bytes, starts: list[int] | int) -> tuple[bytes, list[int] | int]:
    n = run.rng.randrange(1, len(values))
    return values[:n], starts if isinstance(starts, int) else starts[:n]


def _flip(run: Run, values: bytes, starts: list[int] | int) -> tuple[bytes, list[int] | int]:
    k = run.rng.randrange(len(values))
    return values[:k] + bytes([values[k] ^ 1 << run.rng.randrange(8)]) + values[k + 1:], starts


def _stray(run: Run, values: bytes, starts: list[int] | int) -> tuple[bytes, list[int] | int]:
    first = starts if isinstance(starts, int) else starts[0]
    return bytes([run.rng.randrange(256)]) + values, [first, *(t + 720 for t in (range(
        first, first + 720 * len(values), 720) if isinstance(starts, int) else starts))]


AT_ANSWERS: dict[str, Callable[[Run, bytes, list[int] | int], tuple[bytes, list[int] | int]]] = {
    "lost answer": _lost, "cut answer": _cut, "flipped bit": _flip, "stray byte": _stray}

ENDS_IT = ("silent servo", "hot servo", "overload", "cable", "half unplugged", "restart", "brown-out", "deaf port", "twin")
"""Faults that have to end the motion."""
ASKED = ("ctrl-c", "ctrl-c twice")
WHOLE_RUN = ("slow adapter", "fast clock", "slow clock")
"""Of the whole run: latency of the adapter, the host's clock 1 % off the servos'."""
FAULTS = (*AT_WRITES, *AT_ANSWERS, *WHOLE_RUN)
PASSING = (*AT_ANSWERS, "short stall", "garbled command", "lost command")
"""Strike at every k-th event; the others once, at event k."""
