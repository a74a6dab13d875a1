"""Who walks: the simulated robot with its cameras, one cycle at a time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from workbench.compare.metrics import heading
from workbench.gait.drive.family import STRAIGHT, GaitFamily, Steer
from workbench.motion import Commands
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import Simulation, SimulationConfig
from workbench.simulation.compiled import CompiledSteppedRun, NotCoveredError
from workbench.simulation.rollout import BaseState
from workbench.simulation.stepped import SteppedRun
from workbench.types import Array

FALLEN = math.cos(math.radians(45))
"""Upward component of the base's z axis below which the robot lies."""


@dataclass(frozen=True)
class Cameras:
    """Noise of a captured heading [rad] and position [m], and the share of cycles without a pose."""

    heading: float = 0.0021
    position: float = 1e-4
    lost: float = 0.0


@dataclass(frozen=True, eq=False)
class Seen:
    """The end of a cycle. pose, captured (3,): x, y [m], heading [rad], true (of a real robot: as captured) and by the cameras;
    NaN where unknown. fell: whether the robot lies."""

    pose: Array
    captured: Array
    fell: bool = False


class StoppedError(Exception):
    """The walk ended before it was told to; `reason` in words."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(reason)


class Walk(Protocol):
    """A robot that plays a start, cycles and a stop; each is requested one cycle ahead. All may raise StoppedError."""

    def begin(self) -> Seen:
        """Plays the start section."""
        ...

    def cycle(self, steer: Steer, after: Steer | None) -> Seen:
        """Plays a cycle steered by `steer`, as requested before, while one with `after`, or with None the stop, is made ready."""
        ...

    def end(self) -> None:
        """Plays the stop section."""
        ...

    def take(self) -> Take:
        """Everything from the start on."""
        ...


class SimulatedWalk:
    """`robot` plays the family's cycles in simulation: by the compiled station, and by Drake where that gives up.

    seed: of the cameras' noise.
    """

    def __init__(self, family: GaitFamily, robot: RobotModel, cameras: Cameras | None = None, seed: int = 0) -> None:
        self.family, self.cameras, self._rng = family, cameras or Cameras(), np.random.default_rng(seed)
        period_ms, start_ms = round(1000 * family.period), round(1000 * family.start_seconds)
        self.config = SimulationConfig(time_step=1e-3, contact_period=0.0, log_period=math.gcd(period_ms, start_ms, 10) / 1000)
        self._robot, self._steer = robot, STRAIGHT
        self._played: list[tuple[Commands, float]] = []
        self._run: SteppedRun | CompiledSteppedRun
        try:
            self._run = CompiledSteppedRun(robot, self.config)
        except NotCoveredError:
            self._run = Simulation(robot, self.config).stepped()

    def begin(self) -> Seen:
        """Plays the start section."""
        self._play(self.family.start.commands(1), self.family.start_seconds)
        return self._seen()

    def cycle(self, steer: Steer, after: Steer | None) -> Seen:
        """Plays a cycle; `after` needs no preparation here."""
        self._play(self.family.cycle(steer, self._steer).commands(1), self.family.period)
        self._steer = steer
        return self._seen()

    def end(self) -> None:
        """Plays the stop section."""
        stop = self.family.stop(self._steer).commands(1)
        self._play(stop, stop.end)

    def take(self) -> Take:
        """Everything from the start on."""
        return self._run.take("driven")

    def _play(self, commands: Commands, seconds: float) -> None:
        self._played.append((commands, seconds))
        try:
            self._run.send(commands)
            self._run.advance(seconds)
        except NotCoveredError:  # something other than a foot touches: from the beginning in Drake
            self._run = Simulation(self._robot, self.config).stepped()
            for sent, lasted in self._played:
                self._run.send(sent)
                self._run.advance(lasted)

    def _seen(self) -> Seen:
        return observe_base(self._run.base, self.cameras, self._rng)


def observe_base(base: BaseState | None, cameras: Cameras, rng: np.random.Generator) -> Seen:
    """A free base as it is and as the cameras see it."""
    assert base is not None, "the base is free"
    pose = np.array([*base.p_WB[:2], float(heading(base.quat_WB[None])[0])])
    noise = rng.normal(size=3) * [cameras.position, cameras.position, cameras.heading]
    lost = rng.random() < cameras.lost
    return Seen(pose, np.full(3, np.nan) if lost else pose + noise, lies(base.quat_WB))


def lies(quat: Array) -> bool:
    """Whether the z axis of a body with this rotation (4,) wxyz is farther than 45 deg from upright."""
    return bool(1 - 2 * (quat[1]**2 + quat[2]**2) < FALLEN)
