"""Rude partners of the controller's core: one session, one fault, one place, and the monitor's word (firmware/tests/rude.c)."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass

from tests.firmware.native import core

FAULTS = (
    "nothing", "answer lost", "stray bytes", "first byte lost", "answer flipped", "answer cut", "packet lost", "packet flipped",
    "late answer", "ten answers lost", "unplugged", "half unplugged", "servo restarted", "supply dip", "supply gone",
    "return level 1",
    "two of one ID", "hot", "overload", "low battery", "babble", "watchdog", "MODE", "brown-out", "blocked", "slow answers",
    "link flipped", "link cut", "STOP", "RELEASE", "PLAY", "remote 1", "remote 6", "START", "START held", "late boot",
    "hot after a reset",
)
MODES = ("at", "from", "now and then from")
WIRE = range(1, 9)
"""Faults of single packets and answers, which may come again."""
SESSIONS = ("walk and stop", "upload and release", "by remote", "by button", "bridged", "to the end")
RULES = (
    "", "torque returned after a release", "torque 50 ms after a release", "motion 50 ms after a stop", "a goal out of bounds",
    "a goal without or beyond its speed", "the first torque is full or fast", "a servo's fault was not found in 0.4 s",
)


class Run(ctypes.Structure):
    """struct rude_run."""

    _fields_ = [
        ("table", ctypes.c_char_p), ("second", ctypes.c_char_p), ("size", ctypes.c_uint32), ("second_size", ctypes.c_uint32),
        ("session", ctypes.c_uint32), ("fault", ctypes.c_uint32), ("k", ctypes.c_uint32), ("mode", ctypes.c_uint32),
        ("seed", ctypes.c_uint64), ("transactions", ctypes.c_uint32), ("rule", ctypes.c_uint32), ("rule_at", ctypes.c_uint32),
        ("rule_joint", ctypes.c_uint32), ("state", ctypes.c_uint32), ("reason", ctypes.c_uint32), ("ended_ms", ctypes.c_uint32),
        ("answered", ctypes.c_bool), ("injected", ctypes.c_bool),
    ]


@dataclass(frozen=True)
class Injection:
    """A fault at the k-th transaction on the servo bus of a session: once, from then on, or again and again (mode)."""

    session: int
    fault: int
    k: int
    seed: int = 1
    mode: int = 0

    def run(self, tables: tuple[bytes, bytes], library: ctypes.CDLL | None = None) -> Run:
        """The session with it, and what came of it. library: another build of the core."""
        run = Run(table=tables[0], size=len(tables[0]), second=tables[1], second_size=len(tables[1]), session=self.session,
                  fault=self.fault, k=self.k, seed=self.seed, mode=self.mode)
        (library or core()).rude_run(ctypes.byref(run))
        return run

    def __str__(self) -> str:
        return f"{SESSIONS[self.session]}, {FAULTS[self.fault]} {MODES[self.mode]} {self.k}, seed {self.seed}"


def complaint(run: Run) -> str:
    """The violation in a session, "" where nothing is."""
    if run.rule:
        return f"{RULES[run.rule]}: joint {run.rule_joint} at {run.rule_at} ms"
    if not run.answered and FAULTS[run.fault] not in ("link cut",):
        return "it does not answer any more"
    return ""


def injections(count: int, lengths: dict[int, int], skip: int = 0, step: int = 1) -> Iterator[Injection]:
    """So many faults, spread evenly over all sessions, faults and transactions; of these every `step`-th from `skip` on. lengths:
    transactions of each whole session."""
    kinds = [(fault, mode) for fault in range(1, len(FAULTS)) for mode in range(3 if fault in WIRE else 1)]
    cells = [(session, *kind) for session in lengths for kind in kinds]
    for n in range(skip, count, step):
        session, fault, mode = cells[n % len(cells)]
        turn, turns = n // len(cells), -(-count // len(cells))
        place = (turn * lengths[session] + n % len(cells) * 7) // turns % lengths[session]
        yield Injection(session, fault, 1 + place, seed=n, mode=mode)


class MonitorJoint(ctypes.Structure):
    """struct monitor_joint."""

    _fields_ = [
        ("low", ctypes.c_uint16), ("high", ctypes.c_uint16), ("fastest", ctypes.c_uint16), ("neutral", ctypes.c_uint16),
        ("ramp", ctypes.c_uint16), ("half", ctypes.c_uint16), ("near", ctypes.c_uint16),
        ("torque", ctypes.c_bool), ("answers", ctypes.c_bool), ("hot", ctypes.c_bool), ("overloaded", ctypes.c_bool),
        ("hears", ctypes.c_bool), ("goal", ctypes.c_uint16), ("speed", ctypes.c_uint16), ("limit", ctypes.c_uint16),
    ]


class MonitorState(ctypes.Structure):
    """struct monitor; the rest is its own."""

    _fields_ = [
        ("count", ctypes.c_uint32), ("rule", ctypes.c_uint32), ("rule_at", ctypes.c_uint32), ("rule_joint", ctypes.c_uint32),
        ("joint", MonitorJoint * 26), ("deaf", ctypes.c_bool), ("raw", ctypes.c_bool), ("own", ctypes.c_uint8 * 2048),
    ]


class Monitor:
    """The monitor of firmware/tests/monitor.c for whoever has a robot's servos at hand, a millisecond at a time."""

    def __init__(self, joints: int, allowed: bool = True) -> None:
        self.state = MonitorState()
        core().monitor_begin(ctypes.byref(self.state), joints, allowed)
        for joint in self.state.joint:
            joint.low, joint.high, joint.fastest, joint.neutral = 300, 900, 400, 512
            joint.ramp, joint.half, joint.near = 45, 512, 14
        self.joints(answers=True, hears=True, goal=512, speed=40, limit=1023)

    def joints(self, **values: int) -> None:
        """Sets the same of all joints."""
        for joint in self.state.joint:
            for name, value in values.items():
                setattr(joint, name, value)

    def look(self, ms: int, go: bool = False, stop: bool = False, release: bool = False, reset: bool = False) -> None:
        """A millisecond has gone by, with these requests."""
        core().monitor_look(ctypes.byref(self.state), ms, go + 2 * stop + 4 * release + 8 * reset)

    @property
    def rule(self) -> int:
        """The rule that was broken first, 0: none."""
        return int(self.state.rule)


def core_monitor(joints: int) -> Monitor:
    """A monitor of so many joints that a person has switched on."""
    return Monitor(joints)
