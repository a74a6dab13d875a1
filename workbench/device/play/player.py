"""From where the robot is to neutral, through the motion, and back; whatever happens, it ends in good order."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Literal

from workbench.device.bus.bus import Bus, BusOptions
from workbench.device.bus.errors import BusError
from workbench.device.bus.survey import Survey
from workbench.device.play.journal import PlayJournal
from workbench.device.play.options import Played, PlayOptions
from workbench.device.play.rig import DEAREST, Rig
from workbench.device.play.watch import Reaction, StopError, Watch, WatchOptions
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.robot.mounting import JointServo
from workbench.types import Progress

HOLDING = "the servos could not be told to let go and may hold their last goal: switch the robot's power off"
HELD = 0.1
"""Share of its time that has to be left of a pose when it is sent: with less, the robot hardly moves towards it."""


def play(bus: Bus, found: Survey, commands: Commands, journal: PlayJournal, stop: Callable[[], str],
         options: PlayOptions | None = None, watching: WatchOptions | None = None, progress: Progress | None = None) -> Played:
    """Plays commands on the servos of a survey that had no problems.

    stop(): the reason to end, "" while there is none; when it changes a second time, torque goes off at once. BusError where the
    bus fails before anything moved, or for good; all servos that can still be reached have then been released.
    """
    ids = {servo.joint: servo.id for servo in found.found.values() if servo.joint is not None}
    unknown = [joint for joint in commands.joints if joint not in ids]
    if unknown:
        raise InputError(None, f"the motion moves joint {unknown[0]}, which is not on the bus")
    limits = {servo.id: servo.registers.get("temperature_limit", 70) for servo in found.found.values()}
    watch = Watch(bus.profile, {i: j for j, i in ids.items()}, limits, watching)
    torque_limits = {s.joint: s.registers["torque_limit"] for s in found.found.values() if s.joint is not None}
    servos = {s.joint: JointServo(bus.profile, s.mounting) for s in found.found.values() if s.joint is not None}
    rig = Rig(bus, ids, watch, journal, torque_limits, servos)
    return _Performance(rig, stop, options or PlayOptions(), progress or (lambda what, done: None)).run(commands)


class _Performance:
    """One playing of one motion."""

    def __init__(self, rig: Rig, stop: Callable[[], str], options: PlayOptions, progress: Progress) -> None:
        self.rig, self.stop, self.options, self.progress = rig, stop, options, progress
        self.started, self.ended, self.poses, self.worst_late = math.nan, math.nan, 0, 0.0
        self.goals: dict[str, float] = {}
        self._asked = ""
        self.read_before: Counter[str] = Counter()
        self.read: Counter[str] = Counter()
        self.overtaken, self.missed_before = 0, 0
        self._energised = False
        self._log_start, self._rested = math.nan, False

    def run(self, commands: Commands) -> Played:
        rig, bus = self.rig, self.rig.bus
        neutral = dict.fromkeys(rig.ids, 0.0)
        kept, bus.options = bus.options, BusOptions(tries=1, settle=bus.options.settle)
        stopped, released = "", not self.options.hold
        unknown: tuple[str, ...] = ()
        try:
            try:
                self._take_hold(kept)
                self._to_neutral(neutral)
                self._rest()
                self._poses(commands)
                self._ramp(neutral, "back to neutral")
                self._wait_for_arrival(neutral)
                self._rest()
            except StopError as e:
                stopped, released = self._carry_out(e.reaction, neutral), True
            bus.options = kept
            if released and self._energised:
                unknown = rig.release()
            self._watchdog(0)
            rig.limit_torque(1)
            rig.mark(False)
            bus.pause(0.002)
        except BaseException as e:
            rig.journal.write(t=_time(bus), stopped=str(e) or type(e).__name__)
            if self._energised and not self._let_go() and isinstance(e, BusError):
                raise type(e)(f"{e.cause}; {HOLDING}", e.servo, e.joint, e.register) from None
            raise
        finally:
            bus.options = kept
        return Played(rig.journal.path, self.started, self.ended, self.poses, self.worst_late, stopped, released, unknown,
                      self._rates(), rig.repaired, self.overtaken + rig.missed - self.missed_before, log_start=self._log_start)

    def _rates(self) -> dict[str, float]:
        """Readings of each joint in the motion, a second."""
        seconds = self.ended - self.started
        return {j: self.read[j] / seconds for j in self.rig.ids} if seconds > 0 else {}

    def _take_hold(self, careful: BusOptions) -> None:
        """Torque on, each joint where it is: reads before it writes anything, with as many tries as it takes."""
        rig, bus = self.rig, self.rig.bus
        bus.options = careful
        self.progress("reading where each joint is", None)
        self.goals = rig.measure()
        self._keep_in_range()
        slow = dict.fromkeys(rig.ids, self.options.ramp_speed)
        self._look_at_stop()
        self._energised = True
        rig.limit_torque(self.options.start_torque, check=True)
        self._log_start = rig.send(self.goals, slow)
        rig.check_speeds()
        rig.torque(True)
        rig.send(self.goals, slow)  # families that forget a goal while torque is off
        self._watchdog(self.options.watchdog)
        rig.mark(True)
        bus.options = BusOptions(tries=1, settle=careful.settle)
        rig.watch.begin(bus.now())

    def _to_neutral(self, neutral: Mapping[str, float]) -> None:
        """The first way, with little torque; then with as much as the motion gets, so that the joints are where it begins."""
        self._ramp(neutral, "to neutral")
        self._wait_for_arrival(neutral)
        self.rig.limit_torque(self.options.torque)
        self._seat(neutral)

    def _keep_in_range(self) -> None:
        for joint, angle in self.goals.items():
            low, high = self.rig.servos[joint].range
            if not low <= angle <= high:
                raise BusError(f"is at {math.degrees(angle):.0f} deg, beyond the range of its goals; turn it back by hand",
                               self.rig.ids[joint], joint)

    def _ramp(self, target: Mapping[str, float], what: str) -> None:
        """Moves all joints to a pose, smoothly, the farthest at the ramp's speed."""
        start, options = dict(self.goals), self.options
        duration = max(max(abs(target[j] - start[j]) for j in start) / options.ramp_speed, 0.3)
        bus, last, gone = self.rig.bus, self.rig.bus.now(), 0.0
        speeds = dict.fromkeys(start, 2 * options.ramp_speed)
        while True:
            s = min(gone / duration, 1.0)
            weight = s * s * (3 - 2 * s)
            self.progress(what, s)
            self.goals = {j: start[j] + weight * (target[j] - start[j]) for j in start}
            self.rig.send(self.goals, speeds)
            if s >= 1:
                return
            self._read_until(bus.now() + options.step)
            gone += min(bus.now() - last, 2 * options.step)  # a computer that stood still goes on where it was
            last = bus.now()

    def _wait_for_arrival(self, target: Mapping[str, float]) -> None:
        """Waits until every joint is near its goal; a joint that never is ends it: something holds it, or it has no strength."""
        bus, end = self.rig.bus, self.rig.bus.now() + self.options.within
        while True:
            self._read_until(bus.now() + 0.1)
            far = {j: a for j, a in self.rig.angles.items() if abs(a - target[j]) > self.options.arrive}
            if not far:
                return
            if bus.now() >= end:
                joint, angle = next(iter(far.items()))
                stands, wanted = math.degrees(angle), math.degrees(target[joint])
                raise StopError(Reaction("release", f"servo {self.rig.ids[joint]} ({joint}): is at {stands:.0f} deg instead of "
                                                     f"{wanted:.0f}; what holds it?"))

    def _seat(self, target: Mapping[str, float]) -> None:
        """Brings each joint onto its goal itself, by as much beyond it as it hangs below, then tells all the goal at once. So
        they rest where they fall to from there, as the simulated robot does; one that comes from below is held lower by its
        friction, and a camera's zero with it."""
        half, most = 0.6 * self.rig.bus.profile.count, self.options.seat
        speeds = dict.fromkeys(target, self.options.ramp_speed)
        for _ in range(2):
            below = {j: target[j] - a for j, a in self.rig.angles.items() if abs(target[j] - a) > half}
            if not below:
                break
            self.progress("settling in neutral", None)
            self.goals = {j: g + min(max(below.get(j, 0.0), -most), most) for j, g in self.goals.items()}
            self._keep_in_range()
            self.rig.send(self.goals, speeds)
            self._read_until(self.rig.bus.now() + self.options.seat_seconds)
        if self.goals != dict(target):
            self.goals = dict(target)
            self.rig.send(self.goals, speeds)
            self._read_until(self.rig.bus.now() + self.options.seat_seconds)

    def _rest(self) -> None:
        self.progress("resting in neutral", None)
        now = self.rig.bus.now()
        if not self._rested:
            self._log_start, self._rested = now, True
        self.rig.journal.write(t=now, rest=True)
        self._read_until(self.rig.bus.now() + self.options.rest)

    def _poses(self, commands: Commands) -> None:
        """Sends each pose at its time after the first, however late the one before it was; its time is that of its packet's
        end."""
        rig, bus = self.rig, self.rig.bus
        self.started, self.read_before = bus.now(), Counter(self.rig.readings)
        packet, self.missed_before = 0.0, rig.missed
        ends = [*commands.times.tolist()[1:], commands.end]
        for k, time in enumerate(commands.times.tolist()):
            self._read_until(self.started + time - packet)
            begun = bus.now()
            self.progress("playing", time / commands.end)
            goals = dict(zip(commands.joints, commands.goals[k].tolist()))
            sent = self.rig.send(goals, dict(zip(commands.joints, commands.speeds[k].tolist())))
            self.goals |= goals
            self.poses += 1
            if not k:
                stalled = sent - begun > DEAREST  # it left before or after; the poses that follow count from now
                self.started, packet = sent, 0.0 if stalled else sent - begun
            self.overtaken += ends[k] - (sent - self.started) < HELD * (ends[k] - time)
            self.worst_late = max(self.worst_late, sent - self.started - time)
        self._read_until(self.started + commands.end)
        self.ended, self.read = bus.now(), rig.readings - self.read_before

    def _read_until(self, due: float) -> None:
        self.rig.read_until(due, lambda: self.stop() != self._asked)
        if self.rig.watch.reaction is not None:
            raise StopError(self.rig.watch.reaction)
        self._look_at_stop()

    def _look_at_stop(self) -> None:
        """Who asks once gets a ramp to neutral, who asks twice gets torque off at once."""
        asked = self.stop()
        if asked != self._asked:
            how: Literal["neutral", "release"] = "release" if self._asked else "neutral"
            self._asked = asked
            raise StopError(Reaction(how, asked))

    def _carry_out(self, reaction: Reaction, neutral: Mapping[str, float]) -> str:
        """Carries out the reaction and returns its reason, with any that came on the way to neutral; there, only reactions that
        release, or a second signal, count."""
        rig = self.rig
        if math.isnan(self.ended):
            self.ended, self.read = rig.bus.now(), rig.readings - self.read_before
        rig.journal.write(t=rig.bus.now(), stopped=reaction.reason)
        rig.doubt()
        if reaction.how == "release" or not self._energised:
            return reaction.reason
        rig.watch.only_release()
        self._watchdog(0)  # one that has stopped its servo refuses goals until it is cleared
        self._watchdog(self.options.watchdog)
        self.goals = {j: rig.angles[j] if abs(rig.angles[j] - g) > self.options.arrive else g for j, g in self.goals.items()}
        self._keep_in_range()
        try:
            self._ramp(neutral, f"stopping ({reaction.reason})")
        except StopError as e:
            rig.journal.write(t=rig.bus.now(), stopped=e.reaction.reason)
            more = e.reaction.reason
            return more if more.startswith(reaction.reason) else f"{reaction.reason}; then {more}"
        return reaction.reason

    def _watchdog(self, seconds: float) -> None:
        """Servos that have one are told to stop by themselves when the bus falls silent; 0 tells them not to."""
        profile = self.rig.bus.profile
        if profile.watchdog is not None:
            name, unit = profile.watchdog
            self.rig.bus.sync_write({i: {name: round(seconds / unit)} for i in self.rig.ids.values()})

    def _let_go(self) -> bool:
        """Releases all servos of a bus that may be gone; whether all have confirmed it."""
        try:
            unknown = self.rig.release()
            self.rig.limit_torque(1)
            self.rig.bus.pause(0.002)
        except (BusError, InputError):
            return False
        return not unknown


def _time(bus: Bus) -> float:
    try:
        return bus.now()
    except Exception:  # a port that is gone may not even have a clock
        return math.nan
