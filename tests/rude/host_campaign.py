"""The host's side of the campaign: a motion played on emulated servos while every k-th event goes wrong, in virtual time.

An event is a packet of the host's or an answer of a servo. Faults that pass (a lost answer, a stall) strike at every k-th event;
faults that stay (a servo that falls silent) strike once, at event k. `Run.play` says which invariants were violated.
"""

from __future__ import annotations

import atexit
import csv
import functools
import math
import random
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.device.servos import Robot, arm, robot
from tests.rude.host_faults import ASKED, AT_ANSWERS, AT_WRITES, ENDS_IT, FAULTS, PASSING, WHOLE_RUN
from tests.rude.monitor import Allowed, Held, Monitor, Sample
from workbench.device.bus import BusError
from workbench.device.bus.survey import survey
from workbench.device.play import PlayOptions, perform
from workbench.device.stop import Stop
from workbench.device.virtual import VirtualServo
from workbench.files import InputError
from workbench.motion import Motion
from workbench.motion.commands import Commands
from workbench.robot import RobotModel
from workbench.robot.servo_profile_file import servo_profile

JOINTS = ("one", "three", "two")
ANGLES = np.radians([[0.0, 0, 0], [12, -10, 8], [-6, 9, -12], [0, 4, 5], [10, -8, 0], [0, 0, 0]])
MOTION = Motion("wave", 0.1 * np.arange(6), JOINTS, ANGLES)
START = {"one": 0.25, "two": -0.2, "three": 0.1}
FOUND_WITHIN = 0.4
"""A silent, hot or overloaded servo ends the motion within so long [s]."""
LOG = np.radians(0.5)
"""Largest error of a filled cell of the joint log [rad]."""
EVERY = (3, 5, 7, 11, 17, 29, 53, 97)
"""Of the events, for faults that pass."""
CLOCKS = {"fast clock": 1.01, "slow clock": 0.99}
"""The host's seconds in one of the servos'."""
HOT = 69.0
"""A servo this hot is about to shut itself down, at 70 deg C."""
FULL = {"AX-12A": 1023, "XL-330": 885, "STS3215": 1000}
"""Torque limits as the servos leave the factory [counts]."""
FAMILIES = ("AX-12A", "XL-330", "STS3215")


@functools.cache
def _model() -> RobotModel:
    """The arm; one file for all runs, so that it is parsed once."""
    folder = tempfile.TemporaryDirectory()
    atexit.register(folder.cleanup)
    return arm(Path(folder.name))


def _allowed(family: str, commands: Commands) -> Allowed:
    """Limits that the player keeps in this motion, 5 % wider, as registers are rounded."""
    profile, options = servo_profile(family), PlayOptions()
    ramp = math.ceil(1.05 * 2 * options.ramp_speed / profile.speed_unit)
    fastest = math.ceil(1.05 * float(commands.speeds.max()) / profile.speed_unit)
    half = math.ceil(options.start_torque * FULL[family])
    return Allowed(0, 2 * profile.centre, profile.centre, fastest, ramp, half,
                   math.ceil(1.05 * options.seat / profile.count))


@dataclass
class Run:
    """One playing with one kind of fault. k: of the events. seed: of a fault's random part."""

    family: str
    fault: str
    k: int
    seed: int = 0
    robot: Robot = field(init=False)
    struck: list[float] = field(init=False, default_factory=list)
    excused: set[int] = field(init=False, default_factory=set)
    unheard: set[int] = field(init=False, default_factory=set)
    """Servos whose answers cannot be understood from now on."""
    stop: Stop = field(init=False, default_factory=Stop)
    events: int = field(init=False, default=0)
    armed: bool = field(init=False, default=False)

    def __post_init__(self) -> None:
        self.rng = random.Random(f"{self.family}/{self.fault}/{self.k}/{self.seed}")

    # What goes wrong

    def due(self, once: bool = False) -> bool:
        """Counts an event; whether it is to fail."""
        if not self.armed:
            return False
        self.events += 1
        hit = self.events == self.k if once else self.events % self.k == 0
        if hit:
            self.struck.append(self.now)
        return hit

    @property
    def now(self) -> float:
        """The host's time [s]."""
        return self.robot.wire.clock.now / 72e6 * CLOCKS.get(self.fault, 1.0)

    def _set_clock(self) -> None:
        """The host's clock runs at its own rate."""
        port, ratio = self.robot.port, CLOCKS.get(self.fault, 1.0)
        pause = port.pause
        port.getCurrentTime = lambda: 1000 * self.now
        port.pause = lambda seconds: pause(seconds / ratio)

    def install(self) -> None:
        """Puts the fault between the host, the wire and the servos."""
        port, wire = self.robot.port, self.robot.wire
        write, talk = port.writePort, wire.talk
        servos = set(map(id, self.robot.servos.values()))

        def on_write(packet: list[int]) -> int:
            if self.fault in AT_WRITES:
                changed = AT_WRITES[self.fault](self, list(packet))
                if changed is None:
                    return len(packet)
                packet = changed
            return write(packet)

        def on_talk(talker: object, values: bytes, rate: int, starts: list[int] | int) -> int:
            if id(talker) in servos and self.fault in AT_ANSWERS and self.due():
                values, starts = AT_ANSWERS[self.fault](self, values, starts)
                if not values:
                    return starts if isinstance(starts, int) else starts[0]
            return talk(talker, values, rate, starts)

        port.writePort, wire.talk = on_write, on_talk

    # The run

    def play(self) -> list[str]:
        """Plays, and returns the violations, a line each."""
        with tempfile.TemporaryDirectory() as folder:
            return self._play(Path(folder))

    def _play(self, folder: Path) -> list[str]:
        self.robot = r = robot(self.family, START, model=_model())
        if self.fault == "slow adapter":
            r.port.latency, r.port.jitter = 1e-3 * (self.k % 17), 1e-3 * (self.k % 17) * (self.seed % 2)
        self._set_clock()
        commands = MOTION.commands(2)
        profile = servo_profile(self.family)
        monitor = Monitor(_allowed(self.family, commands))
        bus = r.bus()
        found = survey(bus, r.model, ids=())
        self.install()
        self.armed = True

        servos, sense = list(r.servos.values()), r.body.sense
        centre, count, hot = profile.centre, profile.count, HOT

        def held(v: VirtualServo, now: int) -> Held:
            hears = v.powered and not v.starting(now)
            return Held(v.powered and v["torque_enable"] != 0, v["goal_position"], v["moving_speed"], v["torque_limit"],
                        hears and v.joint not in self.unheard, hears, v.temperature >= hot, v.overload)

        def sample() -> None:
            now = r.wire.clock.now
            monitor.samples.append(Sample(
                self.now, {v.joint: held(v, now) for v in servos},
                {v.joint: (v["goal_position"] - centre) * count for v in servos},
                {v.joint: sense(v.joint, now).angle for v in servos}, r.port.unplugged))
            r.at(0.002 if self.armed else 0.01, sample)

        r.at(0.0, sample)
        result, said = None, ""
        try:
            result = perform(bus, found, commands, folder / "w.csv", lambda: self.stop.reason, PlayOptions(rest=0.3))
        except (BusError, InputError) as e:
            said = str(e)
        ended = self.now
        self.armed = False
        r.wire.clock.advance(r.wire.clock.now + 72_000_000)
        monitor.excused = self.excused
        asked = self.struck if self.fault in ASKED else []
        gone = r.port.unplugged
        out = monitor.broken(asked[:1], [*([asked[0] + 0.02] if asked and self.fault == "ctrl-c twice" else []), ended])
        if not gone:
            out += monitor.moves_after_release(ended) + monitor.torque_at_the_end()
        if result is None:
            return out if said else [*out, "ended without a word"]
        out += self._told(monitor, result, commands, ended)
        return out + self._logged(monitor, folder / "w.csv", result)

    def _told(self, monitor: Monitor, result: object, commands: object, ended: float) -> list[str]:
        """Success is only said where all was done; what should have ended it did."""
        ids = self.robot.model.bus_ids
        fine = not (result.stopped or result.unknown or result.missed)
        out = []
        if fine:
            near = 1.5 * servo_profile(self.family).count
            ends = [*commands.times.tolist()[1:], commands.end]
            poses = [(result.started + t, result.started + e, {ids[j]: a for j, a in zip(commands.joints, row)})
                     for t, e, row in zip(commands.times.tolist(), ends, commands.goals.tolist())]
            out += monitor.poses_missed(poses, near)
            if self.fault in ENDS_IT and self.struck and result.started < self.struck[0] < result.ended - 0.6:
                out.append(f"{self.fault} at {self.struck[0]:.3f} s, and all is said to be well")
        if self.fault in ENDS_IT and self.struck and result.started < self.struck[0] < result.ended:
            late = result.ended - self.struck[0]
            if late > FOUND_WITHIN:
                out.append(f"{self.fault} at {self.struck[0]:.3f} s ended the motion only {late:.3f} s later")
        return out

    def _logged(self, monitor: Monitor, log: Path, result: object) -> list[str]:
        if not log.exists():
            return [] if result.log_problem else ["no log, and nothing said of it"]
        rows = list(csv.DictReader(log.read_text().splitlines()))
        ids = self.robot.model.bus_ids
        cells = [(float(row["time"]) + result.log_start, ids[j], np.radians(float(row[f"position.{j}"])))
                 for row in rows for j in JOINTS if row[f"position.{j}"]]
        return monitor.log_errors(cells, LOG)


@functools.cache
def _packets(family: str) -> int:
    """The host's packets in a playing in which nothing goes wrong."""
    run = Run(family, "stall", 1_000_000)
    assert run.play() == []
    return run.events


def campaign(faults: int, seed: int = 0) -> tuple[int, list[tuple[Run, str]]]:
    """Runs until so many faults have struck. Returns their number, and the violations of each run."""
    rng, struck, out = random.Random(seed), 0, []
    n = 0
    while struck < faults:
        fault, family = FAULTS[n % len(FAULTS)], FAMILIES[n // len(FAULTS) % 3]
        k = rng.choice(EVERY) if fault in PASSING else rng.randrange(1, _packets(family))
        run = Run(family, fault, k, rng.randrange(1000))
        out += [(run, line) for line in run.play()]
        struck += len(run.struck) + (fault in WHOLE_RUN)
        n += 1
    return struck, out
