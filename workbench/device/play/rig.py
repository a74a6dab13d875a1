"""The servos of a robot, by its joints, in radians."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from workbench.device.bus.bus import Bus
from workbench.device.bus.errors import BusError, NoAnswerError
from workbench.device.play.journal import PlayJournal
from workbench.device.play.watch import Watch

STATE = ("present_position", "present_load", "present_voltage", "present_temperature")
ROUND = 0.02
"""Shortest time in which all servos are read once [s]: no faster than the log's rows."""
LIMP_EVERY = 5
"""Torque enable, and what a restart forgets, are read with every fifth reading of a servo: they lie far from the rest."""


@dataclass
class Rig:
    """ids: by joint. Reads in turn whenever there is time, and writes down everything."""

    bus: Bus
    ids: Mapping[str, int]
    watch: Watch
    journal: PlayJournal

    def __post_init__(self) -> None:
        self._joints = list(self.ids)
        self._turn = 0
        self._cost = 0.0
        self._round_began = -math.inf
        marker = self.bus.profile.marker
        self._limp = ("torque_enable", marker) if marker else ("torque_enable",)
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
        """Goals [rad] and moving speeds [rad/s], 0 for at once, in one packet; returns when it was handed over [s]."""
        profile = self.bus.profile
        time = "goal_time" in profile.registers
        sent = self.bus.sync_write({self.ids[j]: {
            "goal_position": profile.position(goals[j]), "moving_speed": profile.speed(speeds[j]) if speeds[j] else 0,
            **({"goal_time": 0} if time else {})} for j in goals})
        self.journal.write(t=sent, goal={j: [round(goals[j], 6), round(speeds[j], 6)] for j in goals})
        return sent

    def torque(self, on: bool) -> None:
        """Of all joints at once, and it is read back."""
        self.bus.sync_write({servo: {"torque_enable": int(on)} for servo in self.ids.values()})
        self.bus.pause(0.005)
        for joint, servo in self.ids.items():
            if self.bus.read(servo, "torque_enable")["torque_enable"] != int(on):
                self.bus.write(servo, {"torque_enable": int(on)})
            self.journal.write(t=self.bus.now(), torque={joint: on})

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
            if self._turn % len(self._joints) == 0 and before < self._round_began + ROUND:
                bus.wait_until(min(due, self._round_began + ROUND))
                before = bus.now()
            if due - before < 1.5 * self._cost:
                bus.wait_until(due)
                return
            if self._turn % len(self._joints) == 0:
                self._round_began = before
            self._read_next()
            self._cost = max(bus.now() - before, 0.9 * self._cost)

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
