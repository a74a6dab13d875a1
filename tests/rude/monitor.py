"""Judges a playing from outside: from what servos hold and where joints are, sampled, and from when somebody asked for something.

Shares no code with the player, the bus or the emulated servos: all it gets are numbers.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Sample:
    """At a time [s]: by servo, whether it has torque, its goal and angle [rad], and its commanded speed [rad/s] (0: no limit)."""

    time: float
    torque: dict[int, bool]
    goal: dict[int, float]
    angle: dict[int, float]
    speed: dict[int, float]


@dataclass
class Monitor:
    """samples: in order of time. excused: servos that nobody can reach any more (power or cable gone). fastest: allowed speed of
    a goal [rad/s]."""

    fastest: float
    samples: list[Sample] = field(default_factory=list)
    excused: set[int] = field(default_factory=set)

    def after_release(self, time: float, grace: float = 0.05) -> list[str]:
        """What moved, or had torque again, later than `grace` after all torque was asked to go [s]."""
        out = []
        late = [s for s in self.samples if s.time > time + grace]
        for servo in self._judged():
            on = [s.time for s in late if s.torque[servo]]
            if on:
                out.append(f"servo {servo} has torque {on[0] - time:.3f} s after the release")
            moved = [s.angle[servo] for s in late]
            if moved and max(moved) - min(moved) > 0.02:
                out.append(f"servo {servo} moves by {max(moved) - min(moved):.3f} rad after the release")
        return out

    def after_stop(self, time: float, grace: float = 0.05) -> list[str]:
        """Goals that go away from neutral later than `grace` after a stop [s]."""
        out = []
        for servo in self._judged():
            last = None
            for s in self.samples:
                if s.time < time + grace or not s.torque[servo]:
                    continue
                if last is not None and abs(s.goal[servo]) > last + 0.01:
                    out.append(f"servo {servo}: goal goes from {last:.3f} to {abs(s.goal[servo]):.3f} rad from neutral "
                               f"{s.time - time:.3f} s after the stop")
                    break
                last = abs(s.goal[servo])
        return out

    def too_fast(self) -> list[str]:
        """Servos with torque that are told to go at once, or faster than allowed, to where they are not."""
        out = []
        for servo in self._judged():
            for s in self.samples:
                far = abs(s.goal[servo] - s.angle[servo]) > 0.05
                if s.torque[servo] and far and not 0 < s.speed[servo] <= self.fastest:
                    away = s.goal[servo] - s.angle[servo]
                    out.append(f"servo {servo}: {s.speed[servo]:.2f} rad/s to a goal {away:.2f} rad away, at {s.time:.3f} s")
                    break
        return out

    def torque_at_the_end(self) -> list[str]:
        """Servos that nobody released."""
        return [f"servo {servo} still has torque" for servo in self._judged() if self.samples[-1].torque[servo]]

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
        return [servo for servo in self.samples[0].torque if servo not in self.excused]
