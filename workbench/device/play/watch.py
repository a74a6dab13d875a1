"""What ends a motion before its time: the table of reactions. No single reading does."""

from __future__ import annotations

import math
from collections import Counter, defaultdict, deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from workbench.robot.servo_profile import ServoProfile


@dataclass(frozen=True)
class Reaction:
    """how: "neutral", ramp to neutral and then release; or "release", torque off at once."""

    how: Literal["neutral", "release"]
    reason: str


class StopError(Exception):
    """Ends a motion; carries the reaction."""

    def __init__(self, reaction: Reaction) -> None:
        super().__init__(reaction.reason)
        self.reaction = reaction


@dataclass(frozen=True)
class WatchOptions:
    """When a reading counts.

    confirm: how many readings, or unanswered questions, in a row of one servo. silent: how long it may go unheard [s], whether
    it was asked or not. failures, share: with at least so many unanswered questions within that time, and at least such a share
    of them, a motion ends even if the servo answered in between, which happens where two have its ID. cooler: how far below the
    limit at which it shuts itself down it has to stay [deg C], so that there is torque for the way to neutral. dead: share of
    the lowest voltage below which a ramp would only brown out again.
    """

    confirm: int = 2
    silent: float = 0.3
    failures: int = 4
    share: float = 0.5
    cooler: int = 3
    dead: float = 0.75


TRIPPED = 255
"""Value of a bus watchdog's register once it has stopped the servo, which then refuses goals."""
UNSTEADY = "answered only {} of {} questions within {:.1f} s; is its plug loose, or does another servo have its ID?"
HELD_UP = "could not be read for {:.1f} s, as the computer or the adapter was held up"
SUDDEN = ("electrical shock", "current")
"""Alarms of a servo that is being damaged: torque off at once."""


class Watch:
    """Judges readings as they come; the first that is confirmed is the reaction, and stays. doubted: a servo that ended the
    motion by its silence; two may have its ID, and readings of the time before may be the other's."""

    def __init__(self, profile: ServoProfile, joints: Mapping[int, str], limits: Mapping[int, int],
                 options: WatchOptions | None = None) -> None:
        self._profile, self._joints, self._limits = profile, dict(joints), dict(limits)
        self.options = options or WatchOptions()
        self._seen: Counter[tuple[int, str]] = Counter()
        self._failed: Counter[int] = Counter()
        self._answered: dict[int, float] = {}
        self._questions: defaultdict[int, deque[tuple[float, bool, bool]]] = defaultdict(deque)
        self._only_release = False
        self.doubted: int | None = None
        self.reaction: Reaction | None = None

    def begin(self, time: float) -> None:
        """Starts the watch: from this time [s] on, every servo counts as unheard until it answers."""
        self._answered = dict.fromkeys(self._joints, time)
        self._failed.clear()
        self._questions.clear()

    def only_release(self) -> None:
        """For the way back to neutral: forgets the reaction, and from now on only those that release are left."""
        self._only_release, self.reaction = True, None
        self._seen.clear()

    def failed(self, servo: int) -> int:
        """How many questions in a row a servo has left unanswered."""
        return self._failed[servo]

    def heard(self, servo: int) -> float:
        """When a servo last answered [s]."""
        return self._answered.get(servo, -math.inf)

    def answered(self, servo: int, time: float, values: Mapping[str, int], alarms: tuple[str, ...]) -> None:
        """A whole answer at a time [s]: registers in counts, and the alarms of its error byte."""
        since, self._failed[servo] = time - self._answered.get(servo, time), 0
        if since >= self.options.silent:
            self._react("neutral", servo, HELD_UP.format(since))
        self._answered[servo] = time
        self._count(servo, time, True, True)
        low = self._profile.supply[0]
        volts = values["present_voltage"] / 10 if "present_voltage" in values else None
        heat, limit = values.get("present_temperature"), self._limits.get(servo, 70)
        sudden = [a for a in alarms if a in SUDDEN]
        shut = [a for a in alarms if a not in (*SUDDEN, "voltage", "heat")]
        self._judge(servo, "sudden", bool(sudden), "release", f"alarm: {', '.join(sudden)}")
        self._judge(servo, "alarm", bool(shut), "neutral", f"alarm: {', '.join(shut)}")
        if heat is not None:
            self._judge(servo, "heat", heat > limit - self.options.cooler or "heat" in alarms, "neutral",
                        f"{heat} deg C, its limit is {limit}")
        if volts is not None:
            self._judge(servo, "dead", volts < low * self.options.dead, "release", f"{volts:.1f} V, the supply has failed")
            self._judge(servo, "low", volts < low, "neutral", f"{volts:.1f} V, below {low:g} V")
        marker = self._profile.marker
        if marker and marker in values:
            self._judge(servo, "restart", not values[marker], "neutral", "it restarted; did its supply break down?")
        if "torque_enable" in values:
            self._judge(servo, "limp", not values["torque_enable"], "neutral",
                        "its torque is off")
        if self._profile.watchdog and self._profile.watchdog[0] in values:
            self._judge(servo, "watchdog", values[self._profile.watchdog[0]] == TRIPPED, "neutral",
                        "its bus watchdog stopped it: it heard nothing for too long")

    def silent(self, servo: int, time: float) -> None:
        """A servo did not answer, or not readably, at a time [s]."""
        self._answered.setdefault(servo, time)
        self._failed[servo] += 1
        self._count(servo, time, False, False)
        self.check(time)

    def impossible(self, servo: int, time: float) -> None:
        """An answer that cannot be true counts as none, but the servo has been heard."""
        self._count(servo, time, False, True)

    def _count(self, servo: int, time: float, good: bool, heard: bool) -> None:
        """Counts a servo's latest questions and reacts where too many had no good answer; a servo that has fallen silent for good
        is left to `check`, and so is a single gap, as a restart or a stall leaves."""
        options, latest = self.options, self._questions[servo]
        latest.append((time, good, heard))
        while latest[0][0] <= time - options.silent:
            latest.popleft()
        failed = [k for k, (_, good, _) in enumerate(latest) if not good]
        if len(failed) < options.failures or len(failed) < options.share * len(latest):
            return
        since = list(latest)[failed[0]:]
        heard_between = any(heard for _, _, heard in since[:failed[-1] - failed[0] + 1])
        if heard_between and any(good for _, good, _ in since):
            self._doubt(servo, UNSTEADY.format(len(latest) - len(failed), len(latest), options.silent))

    def check(self, time: float) -> None:
        """Whether every servo was heard not too long before a time [s]: silent where it was asked, unread where it was not."""
        for servo, last in self._answered.items():
            since = time - last
            if since < self.options.silent:
                continue
            if self._failed[servo] >= self.options.confirm:
                self._doubt(servo, f"silent for {since:.1f} s")
            else:
                self._react("neutral", servo, HELD_UP.format(since))
            return

    def _doubt(self, servo: int, reason: str) -> None:
        if self.reaction is None and not self._only_release:
            self.doubted = servo
        self._react("neutral", servo, reason)

    def _judge(self, servo: int, what: str, bad: bool, how: Literal["neutral", "release"], reason: str) -> None:
        if not bad:
            self._seen[servo, what] = 0
            return
        self._seen[servo, what] += 1
        if self._seen[servo, what] >= self.options.confirm:
            self._react(how, servo, reason)

    def _react(self, how: Literal["neutral", "release"], servo: int, reason: str) -> None:
        if self.reaction is None and (how == "release" or not self._only_release):
            joint = self._joints.get(servo)
            self.reaction = Reaction(how, f"servo {servo}" + (f" ({joint})" if joint else "") + f": {reason}")
