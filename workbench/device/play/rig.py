"""The servos of a robot, by its joints, in radians."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from workbench.device.bus.bus import Bus
from workbench.device.bus.errors import BusError, NoAnswerError, PortGoneError
from workbench.device.play.journal import PlayJournal
from workbench.device.play.watch import Watch
from workbench.motion.lead_in import SLOW

STATE = ("present_position", "present_load", "present_voltage", "present_temperature")
ROUND = 0.02
"""Shortest time in which all servos are read once [s]: no faster than the log's rows."""
DECAY = 0.8
"""Of what a reading is thought to cost, with each pose that left no time for one: so one hiccup is soon forgotten."""
DEAREST = 0.04
"""What one reading may be thought to cost at most [s]: what took longer was no reading, but a computer that stood still."""
RELEASE = 1.0
"""How long torque off is said again to servos that do not confirm it [s]."""
LIMP_EVERY = 5
"""Torque enable, and what a restart forgets, are read with every fifth reading of a servo: they lie far from the rest."""


@dataclass
class Rig:
    """ids: by joint. Reads in turn whenever there is time, and writes down everything. torque_limits: of each joint's servo, in
    counts, as it was found."""

    bus: Bus
    ids: Mapping[str, int]
    watch: Watch
    journal: PlayJournal
    torque_limits: Mapping[str, int]

    def __post_init__(self) -> None:
        self._joints = list(self.ids)
        self._turn = 0
        self._cost = 0.0
        self._round_began = -math.inf
        profile = self.bus.profile
        self._limp = ("torque_enable", *([profile.marker] if profile.marker else []),
                      *([profile.watchdog[0]] if profile.watchdog else []))
        self._told: dict[str, tuple[int, int]] = {}
        self.angles: dict[str, float] = {}

    def measure(self) -> dict[str, float]:
        """Where each joint is [rad]: read twice, again where the two differ by more than a count can flicker."""
        out = {}
        profile = self.bus.profile
        for joint, servo in self.ids.items():
            last, agreed = -1, False
            for _ in range(10):
                position = self.bus.read(servo, "present_position")["present_position"]
                agreed = last >= 0 and abs(position - last) * profile.count < math.radians(2)
                last = position
                if agreed:
                    break
            if not agreed:
                raise BusError("two readings in a row never agree; does it move, or is its sensor bad?", servo, joint,
                               "present_position")
            out[joint] = self.angles[joint] = profile.angle(last)
        return out

    def send(self, goals: Mapping[str, float], speeds: Mapping[str, float]) -> float:
        """Goals [rad] and moving speeds [rad/s] in one packet; returns when it was handed over [s].

        Speed 0, at once, is never sent: a joint that was told this goal before keeps the speed at which it goes there, any other
        gets the slow one."""
        profile = self.bus.profile
        time = "goal_time" in profile.registers
        packet = {}
        for joint, goal in goals.items():
            count, kept = profile.position(goal), self._told.get(joint, (-1, 0))
            speed = profile.speed(speeds[joint]) if speeds[joint] else kept[1] if kept[0] == count else profile.speed(SLOW)
            self._told[joint] = count, speed
            packet[self.ids[joint]] = {"goal_position": count, "moving_speed": speed, **({"goal_time": 0} if time else {})}
        sent = self.bus.sync_write(packet)
        self.journal.write(t=sent, goal={j: [round(goals[j], 6), round(self._told[j][1] * profile.speed_unit, 6)] for j in goals})
        return sent

    def torque(self, on: bool) -> None:
        """Of all joints at once, and it is read back."""
        self.bus.sync_write({servo: {"torque_enable": int(on)} for servo in self.ids.values()})
        self.bus.pause(0.005)
        for joint, servo in self.ids.items():
            if self.bus.read(servo, "torque_enable")["torque_enable"] != int(on):
                self.bus.write(servo, {"torque_enable": int(on)})
            self.journal.write(t=self.bus.now(), torque={joint: on})

    def limit_torque(self, share: float) -> None:
        """Torque limits of all joints at a share of what was found."""
        self.bus.sync_write({self.ids[j]: {"torque_limit": round(share * found)} for j, found in self.torque_limits.items()})

    def release(self, seconds: float = RELEASE) -> tuple[str, ...]:
        """Torque off, of all at once, and read back; said again for so long [s] to those that do not answer. Returns the joints
        of which nobody knows."""
        bus, waiting, end = self.bus, dict(self.ids), self.bus.now() + seconds
        while True:
            bus.release(self.ids.values())
            for joint, servo in list(waiting.items()):
                try:
                    if not bus.read(servo, "torque_enable")["torque_enable"]:
                        del waiting[joint]
                except PortGoneError:
                    raise
                except BusError:
                    continue
            if not waiting or bus.now() >= end:
                break
            bus.pause(0.02)
        self.journal.write(t=bus.now(), torque=dict.fromkeys(self.ids, False))
        return tuple(waiting)

    def mark(self, on: bool) -> None:
        """Sets, or clears, what a restart forgets."""
        marker = self.bus.profile.marker
        if marker:
            self.bus.sync_write({servo: {marker: int(on)} for servo in self.ids.values()})

    def read_until(self, due: float, stop: Callable[[], bool]) -> None:
        """Reads one servo after the other until `due` [s], as long as there is time for one more; ends early on `stop()` or where
        the watch reacts."""
        bus = self.bus
        while not stop() and self.watch.reaction is None:
            before = bus.now()
            self.watch.check(before)
            if self._turn % len(self._joints) == 0 and before < self._round_began + ROUND:
                bus.wait_until(min(due, self._round_began + ROUND))
                before = bus.now()
            if due - before < 1.5 * self._cost:
                self._cost *= DECAY
                bus.wait_until(due)
                return
            if self._turn % len(self._joints) == 0:
                self._round_began = before
            self._read_next()
            self._cost = max(min(bus.now() - before, DEAREST), 0.9 * self._cost)

    def _read_next(self) -> None:
        joint = self._joints[self._turn % len(self._joints)]
        servo, limp = self.ids[joint], self._turn // len(self._joints) % LIMP_EVERY == 0
        self._turn += 1
        bus, before = self.bus, self.bus.now()
        try:
            values = bus.read(servo, *STATE)
            after = bus.now()
            if limp:
                values |= bus.read(servo, *self._limp)
        except NoAnswerError:
            self.watch.silent(servo, bus.now())
            return
        self.watch.answered(servo, after, values, bus.alarms.get(servo, ()))
        angle = bus.profile.angle(values["present_position"])
        self.angles[joint] = angle
        self.journal.write(t=round((before + after) / 2, 6), joint=joint, position=round(angle, 6),
                           duty=round(values["present_load"] * bus.profile.load_unit, 4),
                           voltage=values["present_voltage"] / 10, temperature=values["present_temperature"])
