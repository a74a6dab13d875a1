"""Judges a playing from outside. The rules for every robot are those of firmware/tests/monitor.c; those of poses and of the log,
which only the host's player has, are here.

Shares no code with the player, the bus or the emulated servos: all it gets are numbers.
"""

from __future__ import annotations

import ctypes
from bisect import bisect_left
from dataclasses import asdict, dataclass, field

from tests.firmware.native import core
from tests.rude.controller import RULES, MonitorState

LATER = 10_000
"""Added to all times [ms]: the monitor excuses servos that are silent in the first seconds, when they may still be starting."""


@dataclass(frozen=True)
class Held:
    """A servo's registers [counts], and how it truly is: answers in a way that could be understood; hears: has power and has
    started."""

    torque: bool
    goal: int
    speed: int
    limit: int
    answers: bool
    hears: bool
    hot: bool
    overloaded: bool


@dataclass(frozen=True)
class Sample:
    """At a time [s], by servo: its state, its goal and its angle [rad]. deaf: nobody can hear anything."""

    time: float
    held: dict[int, Held]
    goal: dict[int, float]
    angle: dict[int, float]
    deaf: bool = False


@dataclass(frozen=True)
class Allowed:
    """What every joint may do [counts]: bounds of its goals and neutral, its speed, a ramp's speed, the torque limit of the first
    ramp, and how far from neutral is no distance."""

    low: int
    high: int
    neutral: int
    fastest: int
    ramp: int
    half: int
    near: int


@dataclass
class Monitor:
    """samples: in order of time. excused: servos that nobody can release any more, as their power or cable is gone."""

    allowed: Allowed
    samples: list[Sample] = field(default_factory=list)
    excused: set[int] = field(default_factory=set)

    def broken(self, stops: list[float], releases: list[float]) -> list[str]:
        """The first of the rules for every robot that is broken. stops, releases: when they were asked for [s]; until the first
        the robot is meant to play."""
        state, judged = MonitorState(), list(self.samples[0].held)
        core().monitor_begin(ctypes.byref(state), len(judged), True)
        for joint in state.joint[:len(judged)]:
            for name, value in asdict(self.allowed).items():
                setattr(joint, name, value)
        first = min([*stops, *releases])
        requests = sorted([(time, 2) for time in stops] + [(time, 4) for time in releases])
        for sample in self.samples:
            asked = int(sample.time < first)
            while requests and requests[0][0] <= sample.time:
                asked |= requests.pop(0)[1]
            state.deaf = sample.deaf
            for joint, servo in zip(state.joint, judged):
                held = sample.held[servo]
                joint.torque, joint.answers, joint.hears = held.torque, held.answers, held.hears
                joint.hot, joint.overloaded = held.hot, held.overloaded
                joint.goal, joint.speed, joint.limit = held.goal, held.speed, held.limit
            core().monitor_look(ctypes.byref(state), LATER + round(1000 * sample.time), asked)
            if state.rule:
                return [f"{RULES[state.rule]}: servo {judged[state.rule_joint]} at {sample.time:.3f} s"]
        return []

    def moves_after_release(self, time: float, grace: float = 0.05) -> list[str]:
        """Joints that move later than `grace` after all torque was asked to go [s]."""
        out = []
        for servo in self._judged():
            angles = [s.angle[servo] for s in self.samples if s.time > time + grace]
            if angles and max(angles) - min(angles) > 0.02:
                out.append(f"servo {servo} moves by {max(angles) - min(angles):.3f} rad after the release")
        return out

    def torque_at_the_end(self) -> list[str]:
        """Servos that nobody released."""
        return [f"servo {servo} still has torque" for servo in self._judged() if self.samples[-1].held[servo].torque]

    def poses_missed(self, poses: list[tuple[float, float, dict[int, float]]], near: float) -> list[str]:
        """Poses, as from, to [s] and goals [rad], of which a servo never held the goal within `near` [rad] in that time."""
        out = []
        times = [s.time for s in self.samples]
        for begin, end, goals in poses:
            here = self.samples[bisect_left(times, begin):bisect_left(times, end)]
            out += [f"servo {servo} never had its goal of the pose at {begin:.3f} s" for servo, goal in goals.items()
                    if here and not any(abs(s.goal[servo] - goal) < near for s in here)]
        return out

    def log_errors(self, rows: list[tuple[float, int, float]], most: float) -> list[str]:
        """Cells of a log, as time [s], servo, angle [rad], that are more than `most` [rad] from where the joint was."""
        times = [s.time for s in self.samples]
        out = []
        for time, servo, angle in rows:
            k = bisect_left(times, time)
            near = [s.angle[servo] for s in self.samples[max(k - 2, 0):k + 2]]
            if near and not min(near) - most <= angle <= max(near) + most:
                out.append(f"servo {servo}: the log says {angle:.4f} rad at {time:.3f} s, it was at {near[len(near) // 2]:.4f}")
        return out

    def _judged(self) -> list[int]:
        return [servo for servo in self.samples[0].held if servo not in self.excused]
