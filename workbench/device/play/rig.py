"""The servos of a robot, by its joints, in radians."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from workbench.device.bus.bus import Bus
from workbench.device.bus.errors import BusError, NoAnswerError
from workbench.device.bus.group import answer_length
from workbench.device.play.journal import PlayJournal
from workbench.device.play.log import possible
from workbench.device.play.watch import Watch
from workbench.motion.lead_in import SLOW
from workbench.robot.mounting import JointServo

STATE = ("present_position", "present_load", "present_voltage", "present_temperature")
POSITION = ("present_position",)
GOAL = "goal_position"
"""Read back in turn with load, voltage and heat: nobody answers a Sync Write, so that a lost pose would go unnoticed."""
ROUND, ROUND_AT_ONCE = 0.018, 0.003
"""Shortest time in which all servos are read once [s], one after the other, and by one question: more would show nothing new of a
joint that swings a few times a second."""
STATE_EVERY = 6
"""Where all are asked at once, load, voltage and heat are read with every sixth question, as they make it twice as long."""
SPAN = 32
"""Bytes that are worth reading in one packet rather than asking twice."""
MARGIN = 1.3
"""Share of a reading's estimated cost that must remain before a pose, so that the pose is not late."""
DECAY = 0.8
"""Decay of a reading's estimated cost with each pose that left no time for one: so one hiccup is soon forgotten."""
DEAREST = 0.04
"""Largest estimated cost of a reading [s]: a longer one was no reading, but a computer that stalled."""
RELEASE = 1.0
"""How long torque off is said again to servos that do not confirm it [s]."""
DOUBTED = 0.1
"""How much longer than it may stay silent a doubted servo's readings are left out of the log [s]: the time a reaction takes."""
STARTS = 0.05
"""A servo that was heard this recently has not restarted [s]: a start takes 0.2 to 0.4 s (emanual issue 1698 for an XC-330)."""
LIMP_EVERY = 5
"""Torque enable, and the marker that a restart clears, are read with every fifth reading of a servo: their addresses are far
off."""


@dataclass
class Rig:
    """ids: by joint. Reads in turn whenever there is time, and writes down everything. torque_limits: of each joint's servo, in
    counts, as it was found. servos: what turns each joint's angles into counts. readings: of each joint's position, so far.
    repaired: goals that had to be sent again. missed: goals that had not arrived when the next one was sent."""

    bus: Bus
    ids: Mapping[str, int]
    watch: Watch
    journal: PlayJournal
    torque_limits: Mapping[str, int]
    servos: Mapping[str, JointServo]

    def __post_init__(self) -> None:
        self._joints = list(self.ids)
        self._turn = 0
        self._costs: dict[tuple[str, ...], float] = {}
        self._round_began = -math.inf
        profile = self.bus.profile
        self._limp = ("torque_enable", *([profile.marker] if profile.marker else []),
                      *([profile.watchdog[0]] if profile.watchdog else []))
        ends = [profile.registers[name] for name in (*STATE, *self._limp)]
        self._together = max(r.address + r.size for r in ends) - min(r.address for r in ends) <= SPAN
        self._told: dict[str, tuple[int, int]] = {}
        self._goals: dict[str, float] = {}
        self._suspects: list[str] = []
        self._open: set[str] = set()
        self._unanswered: Counter[str] = Counter()
        self._unsure: set[str] = set()
        self._limp_joints: set[str] = set()
        self.repaired, self.missed = 0, 0
        self._asked_since = self._heard_since = False
        self.readings: Counter[str] = Counter()
        self.angles: dict[str, float] = {}
        self._read_at: dict[str, float] = {}

    def measure(self) -> dict[str, float]:
        """Where each joint is [rad]: read twice, again where the two differ by more than a count can flicker."""
        out = {}
        profile = self.bus.profile
        for joint, servo in self.ids.items():
            last, agreed = math.inf, False
            for _ in range(10):
                position = self.bus.read(servo, "present_position")["present_position"]
                agreed = abs(position - last) * profile.count < math.radians(2)
                last = position
                if agreed:
                    break
            if not agreed:
                raise BusError("two readings in a row never agree; does it move, or is its sensor bad?", servo, joint,
                               "present_position")
            out[joint] = self.angles[joint] = self.servos[joint].angle(last)
        return out

    def send(self, goals: Mapping[str, float], speeds: Mapping[str, float]) -> float:
        """Goals [rad] and moving speeds [rad/s] in one packet; returns when it was handed over [s].

        Speed 0, at once, is never sent: a joint that was told this goal before keeps the speed at which it goes there, any other
        gets the slow one. A joint whose servo may have restarted gets none, as a goal might switch its torque on, at full force,
        until its registers show that it has not."""
        unsure = {joint for joint in self._unsure if joint in self._limp_joints or not self._mute(joint)}
        self.missed += len((self._open | unsure) & goals.keys())
        self._open -= goals.keys()
        if self._asked_since and not self._heard_since:  # nobody answered in the whole pose, so that nobody knows of its goals
            self.missed += len(self._goals.keys() & goals.keys())
        self._asked_since = self._heard_since = False
        sure = {joint: goal for joint, goal in goals.items() if joint not in unsure}
        return self._send(sure, speeds) if sure else self.bus.now()

    def _send(self, goals: Mapping[str, float], speeds: Mapping[str, float]) -> float:
        profile = self.bus.profile
        time = "goal_time" in profile.registers
        packet = {}
        for joint, goal in goals.items():
            count, kept = self.servos[joint].position(goal), self._told.get(joint, (-1, 0))
            speed = profile.speed(speeds[joint]) if speeds[joint] else kept[1] if kept[0] == count else profile.speed(SLOW)
            self._told[joint], self._goals[joint] = (count, speed), goal
            packet[self.ids[joint]] = {"goal_position": count, "moving_speed": speed, **({"goal_time": 0} if time else {})}
        sent = self.bus.sync_write(packet)
        self.journal.write(t=sent, goal={j: [round(goals[j], 6), round(self._told[j][1] * profile.speed_unit, 6)] for j in goals})
        return sent

    def _repair(self, joint: str) -> None:
        """A goal that did not arrive is sent again, unless the servo has lost its torque, which a goal might switch on."""
        servo = self.ids[joint]
        try:
            found = self.bus.read(servo, *self._limp)
        except NoAnswerError:
            return
        self.watch.answered(servo, self.bus.now(), found, self.bus.alarms.get(servo, ()))
        if self._runs(found):
            self._send({joint: self._goals[joint]}, {joint: 0.0})
            self.repaired += 1

    def torque(self, on: bool) -> None:
        """Switches the torque of all joints at once, and reads it back."""
        self.bus.sync_write({servo: {"torque_enable": int(on)} for servo in self.ids.values()})
        self.bus.pause(0.005)
        for joint, servo in self.ids.items():
            if self.bus.read(servo, "torque_enable")["torque_enable"] != int(on):
                self.bus.write(servo, {"torque_enable": int(on)})
            self.journal.write(t=self.bus.now(), torque={joint: on})

    def limit_torque(self, share: float, check: bool = False) -> None:
        """Torque limits of every joint at a share of the values found. check: read back, and written again where it did not
        arrive; BusError where it never does."""
        limits = {self.ids[j]: {"torque_limit": round(share * found)} for j, found in self.torque_limits.items()}
        self.bus.sync_write(limits)
        for servo, limit in limits.items() if check else ():
            if self.bus.read(servo, "torque_limit") != limit:
                self.bus.write(servo, limit)

    def check_speeds(self) -> None:
        """Before torque comes on: whether the speeds that were sent have arrived, as a servo without one moves as fast as it
        can."""
        for joint, (_, speed) in self._told.items():
            if self.bus.read(self.ids[joint], "moving_speed")["moving_speed"] != speed:
                self.bus.write(self.ids[joint], {"moving_speed": speed})

    def release(self, seconds: float = RELEASE) -> tuple[str, ...]:
        """Torque off, broadcast and read back; repeated for so long [s] for servos that do not answer. Returns the joints
        whose state is unknown."""
        unknown = self.bus.let_go(self.ids.values(), seconds)
        self.journal.write(t=self.bus.now(), torque=dict.fromkeys(self.ids, False))
        return tuple(joint for joint, servo in self.ids.items() if servo in unknown)

    def mark(self, on: bool) -> None:
        """Sets, or clears, the marker that a restart clears."""
        marker = self.bus.profile.marker
        if marker:
            self.bus.sync_write({servo: {marker: int(on)} for servo in self.ids.values()})

    def read_until(self, due: float, stop: Callable[[], bool]) -> None:
        """Reads one servo after the other until `due` [s], as long as there is time for one more; ends early on `stop()` or where
        the watch reacts."""
        bus = self.bus
        at_once = bool(bus.group_kind)
        turns, least = (1, ROUND_AT_ONCE) if at_once else (len(self._joints), ROUND)
        while not stop() and self.watch.reaction is None:
            before = bus.now()
            self.watch.check(before)
            if self._turn % turns == 0 and before < self._round_began + least:
                bus.wait_until(min(due, self._round_began + least))
                before = bus.now()
            names = self._names(at_once, turns)
            cost = self._costs.get(names, 0.0)
            if due - before < MARGIN * cost:
                self._costs[names] = DECAY * cost
                bus.wait_until(due)
                return
            if self._turn % turns == 0:
                self._round_began = before
            self._asked_since = True
            if at_once:
                self._read_all(names)
            else:
                self._read_one(self._joints[self._turn % turns], names)
            self._turn += 1
            self._costs[names] = max(min(bus.now() - before, DEAREST), 0.9 * cost)

    def _names(self, at_once: bool, turns: int) -> tuple[str, ...]:
        """The next reading."""
        doubtful = any(not self._unanswered[j] for j in self._unsure)
        if at_once:
            if doubtful and self._turn % 2:
                return self._limp
            turn = self._turn % (4 * STATE_EVERY)
            return self._limp if turn == 1 else (GOAL, *STATE) if turn % STATE_EVERY == 0 else POSITION
        turn = 0 if doubtful else self._turn // turns % LIMP_EVERY
        if turn == 0:
            return (*self._limp, GOAL, *POSITION) if self._together else (*STATE, *self._limp)
        return STATE if turn % 2 else (GOAL, *POSITION)

    def _read_all(self, names: tuple[str, ...]) -> None:
        """Asks all servos in one packet; whoever did not answer is asked alone first next time: it may keep others silent."""
        bus = self.bus
        if self._suspects:
            suspect = self._suspects.pop(0)
            self._read_one(suspect, STATE)
            if self.watch.failed(self.ids[suspect]):
                self._suspects.append(suspect)
        asked = [j for j in self._joints if j not in self._suspects]
        got = bus.read_all([self.ids[j] for j in asked], *names)
        begun, each = bus.asked, self._answer_seconds(names)
        for k, joint in enumerate(asked):
            values = got.get(self.ids[joint])
            if values is None:
                if not self._suspects:  # those after it may only have waited for its answer
                    self._suspects.append(joint)
                    self.watch.silent(self.ids[joint], bus.now())
                self._miss(joint)
                continue
            self._take(joint, values, begun + k * each, bus.now() - begun)

    def doubt(self) -> None:
        """Notes in the journal where the watch doubts a servo: from when on its readings may be another servo's."""
        since = self.bus.now() - self.watch.options.silent - DOUBTED
        self.journal.write(t=self.bus.now(), since=since, doubted=[j for j, i in self.ids.items() if i == self.watch.doubted])

    def _answer_seconds(self, names: tuple[str, ...]) -> float:
        """How long one of many answers takes [s]."""
        wanted = [self.bus.profile.registers[name] for name in names]
        count = max(r.address + r.size for r in wanted) - min(r.address for r in wanted)
        kind = self.bus.group_kind
        return answer_length(kind, count) * float(self.bus.port.tx_time_per_byte) / 1000 if kind else 0.0

    def _read_one(self, joint: str, names: tuple[str, ...]) -> None:
        servo, bus = self.ids[joint], self.bus
        apart = self._limp[0] in names and not self._together
        try:
            values = bus.read(servo, *(STATE if apart else names))
            asked = bus.asked
            took = bus.now() - asked
            if apart:
                values |= bus.read(servo, *self._limp)
        except NoAnswerError:
            self.watch.silent(servo, bus.now())
            self._miss(joint)
            return
        self._take(joint, values, asked, took)

    def _miss(self, joint: str) -> None:
        self._unanswered[joint] += 1
        since = self.bus.now() - self.watch.heard(self.ids[joint])
        if self._unanswered[joint] >= self.watch.options.confirm and since >= STARTS:
            self._unsure.add(joint)

    def _mute(self, joint: str) -> bool:
        """Whether it does not answer though it is doubted, or for longer than a start takes: it may hear all the same."""
        since = self.bus.now() - self.watch.heard(self.ids[joint])
        doubted = self.ids[joint] == self.watch.doubted
        return self._unanswered[joint] > 0 and (doubted or since >= self.watch.options.silent)

    def _runs(self, values: Mapping[str, int]) -> bool:
        """Whether its registers show torque, and that it has not restarted."""
        marker = self.bus.profile.marker
        return bool(values["torque_enable"] and (not marker or values[marker]))

    def _take(self, joint: str, values: Mapping[str, int], time: float, took: float = 0.0) -> None:
        """Judges a reading, and logs it; time: when the servo measured it [s]. took: until the answer was there [s]."""
        bus, servo = self.bus, self.ids[joint]
        self._heard_since = True
        self.watch.answered(servo, bus.now(), values, bus.alarms.get(servo, ()))
        self._unanswered[joint] = 0
        if "torque_enable" in values:
            for joints in (self._unsure, self._limp_joints):
                (joints.discard if self._runs(values) else joints.add)(joint)
        if "present_position" not in values:
            return
        angle = self.servos[joint].angle(values["present_position"])
        if joint in self._read_at and not possible(angle - self.angles[joint], time - self._read_at[joint]):
            self.watch.impossible(servo, bus.now())
            return
        self.angles[joint], self._read_at[joint] = angle, time
        if GOAL in values and joint in self._told:
            if values[GOAL] == self._told[joint][0]:
                self._open.discard(joint)
            else:
                self._open.add(joint)
                self._repair(joint)
        self.readings[joint] += 1
        more = {"took": round(took, 6)} if took else {}
        if "present_voltage" in values:
            more |= {"duty": round(values["present_load"] * bus.profile.load_unit, 4),
                     "voltage": values["present_voltage"] / 10, "temperature": values["present_temperature"]}
        self.journal.write(t=round(time, 6), joint=joint, position=round(angle, 6), **more)
