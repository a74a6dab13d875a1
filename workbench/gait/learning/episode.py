"""One robot that walks under a learner's actions, in the compiled station."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.files import InputError
from workbench.gait.drive.walk import lies
from workbench.gait.learning.actions import Actions
from workbench.gait.learning.options import LearningOptions
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig
from workbench.simulation.compiled import CompiledSteppedRun, NotCoveredError
from workbench.types import Array

MOST = 10.0
"""Observations are clipped to this; each is divided by its usual size below."""
TILT, HEADING, SPEED, ASIDE, JOINT = 0.2, 0.5, 0.3, 0.1, 0.2
"""Usual sizes: roll and pitch [rad], heading [rad], speed forward and to the left [m/s], distance from the x axis [m], goal less
angle of a joint [rad]."""


class Domains:
    """The robots on which a learner is trained. An episode begins at the end of the gait's start section, so that the start is
    simulated once for each robot.

    InputError, when an episode begins, for a robot that the compiled station does not cover or that falls in the start.
    """

    def __init__(self, actions: Actions, robots: Sequence[RobotModel], options: LearningOptions) -> None:
        if not robots:
            raise InputError(None, "expected at least one robot to learn on")
        self.actions, self.robots, self.options = actions, tuple(robots), options
        self._begun: dict[int, CompiledSteppedRun] = {}

    def begin(self, which: int) -> CompiledSteppedRun:
        """A run of a robot that has played the start."""
        if which not in self._begun:
            robot, start = self.robots[which], self.actions.start
            config = SimulationConfig(time_step=self.options.time_step, contact_period=0.0, log_period=0.01)
            try:
                run = CompiledSteppedRun(robot, config)
                run.send(start)
                run.advance(start.end)
            except NotCoveredError as e:
                raise InputError(robot.description, f"the compiled station does not cover this robot: {e}") from None
            self._begun[which] = run
        return self._begun[which].branch()


class Episode:
    """One walk of one robot. domains: the robots; which: the index of this one."""

    def __init__(self, domains: Domains, which: int) -> None:
        self.actions, self.options = domains.actions, domains.options
        self.run, self.k, self.fell = domains.begin(which), 0, False
        self.before = np.zeros(self.actions.size)
        self._goals = self.actions.start.goals[-1]
        self._pose, self._velocity = self._measure_pose(), np.zeros(2)

    @staticmethod
    def seen_by(actions: Actions) -> int:
        """How many numbers `seen` has."""
        return 8 + len(actions.family.machine.model.joints) + actions.size

    @property
    def over(self) -> bool:
        """Whether it has had all its cycles."""
        return self.k >= self.options.cycles * self.actions.in_cycle

    def step(self, action: Array) -> float:
        """Plays one action (size,), each number from -1 to 1. Returns the reward [cm]."""
        action = np.clip(np.asarray(action, dtype=float), -1.0, 1.0)
        o, commands = self.options, self.actions.commands(self.k, action, self.before)
        changed = float(np.mean(np.abs(action - self.before))) / 2 if self.k else 0.0
        try:
            self.run.send(commands)
            self.run.advance(commands.end)
        except NotCoveredError:  # something other than a foot touches the floor, or two links each other
            self.fell = True
            return -o.fall
        self.k, self.before, self._goals = self.k + 1, action, commands.goals[-1]
        was, self._pose = self._pose, self._measure_pose()
        moved = self._pose[:2] - was[:2]
        c, s = math.cos(was[2]), math.sin(was[2])
        self._velocity = np.array([c * moved[0] + s * moved[1], -s * moved[0] + c * moved[1]]) / commands.end
        self.fell = self._lies()
        reward = 100 * (moved[0] - o.lateral * abs(moved[1])) - o.heading * abs(self._pose[2]) - o.change * changed
        return float(reward - (o.fall if self.fell else 0.0))

    @property
    def seen(self) -> Array:
        """Sine and cosine of the gait's phase; roll, pitch, heading, speed forward and to the left, distance to the left of the x
        axis; goal less angle of each joint; the action before. All but the last are divided by their usual sizes."""
        phase = 2 * math.pi * (self.k % self.actions.in_cycle) / self.actions.in_cycle
        _, y, heading, roll, pitch = self._pose
        numbers = [math.sin(phase), math.cos(phase), roll / TILT, pitch / TILT, heading / HEADING, *(self._velocity / SPEED),
                   y / ASIDE]
        errors = (self._goals - self.run.servo_angles) / JOINT
        return np.clip(np.concatenate([numbers, errors, self.before]), -MOST, MOST).astype(np.float32)

    def take(self) -> Take:
        """The whole walk, the start section included."""
        return self.run.take("learned")

    def _lies(self) -> bool:
        base = self.run.base
        assert base is not None
        return lies(base.quat_WB)

    def _measure_pose(self) -> Array:
        """x, y [m], heading, roll and pitch [rad]."""
        base = self.run.base
        assert base is not None
        yaw, pitch, roll = Rotation.from_quat(base.quat_WB, scalar_first=True).as_euler("ZYX")
        return np.array([base.p_WB[0], base.p_WB[1], yaw, roll, pitch])
