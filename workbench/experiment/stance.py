"""Short motions of a robot that stands on its feet: the body moves, the feet stay where they are."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property, partial

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from workbench.experiment.limits import Reach
from workbench.experiment.moves import Path
from workbench.experiment.options import EXPERIMENT
from workbench.experiment.segment import Segment
from workbench.robot import RobotModel, foot_points, legs
from workbench.types import Array

Body = tuple[float, float, float, float, float, float]
"""Displacement of the base: forward, left, up as shares of the legs' length; roll, pitch, yaw [deg]."""


class BodyMoves:
    """Segments for a robot on its feet; none for a robot without feet, or with a leg of fewer than two joints."""

    def __init__(self, model: RobotModel, reach: Reach) -> None:
        self.model, self.reach = model, reach

    def segments(self) -> list[Segment]:
        """All segments that its legs can execute."""
        if not self._legs:
            return []
        return [s for s in map(self.reach.scaled_clear, self._all()) if s is not None]

    def _all(self) -> Iterator[Segment]:
        low, calm, brisk = -0.15, EXPERIMENT.calm, EXPERIMENT.brisk
        down: Body = (0, 0, low, 0, 0, 0)
        moves: dict[str, tuple[float, Sequence[Body]]] = {
            "down and up, calm": (calm, [down, (0, 0, low / 2, 0, 0, 0), (0, 0, 1.4 * low, 0, 0, 0), down]),
            "down and up, brisk": (brisk, [down, (0, 0, low / 3, 0, 0, 0), (0, 0, 1.4 * low, 0, 0, 0), (0, 0, low / 3, 0, 0, 0)]),
            "forward and back": (calm, [down, (0.14, 0, low, 0, 0, 0), (-0.14, 0, low, 0, 0, 0), (0.07, 0, low, 0, 0, 0)]),
            "to both sides": (calm, [down, (0, 0.12, low, 0, 0, 0), (0, -0.12, low, 0, 0, 0), (0, 0.06, low, 0, 0, 0)]),
            "jerks": (brisk, [down, (0.1, 0, low, 0, 0, 0), (-0.1, 0, low, 0, 0, 0), (0, 0.09, low, 0, 0, 0),
                              (0, -0.09, low, 0, 0, 0), down]),
            "turned about": (calm, [down, (0, 0, low, 0, 0, 14), (0, 0, low, 0, 0, -14), down]),
            "tipped": (calm, [down, (0, 0, low, 0, 10, 0), (0, 0, low, 0, -10, 0), (0, 0, low, 8, 0, 0), (0, 0, low, -8, 0, 0)]),
        }
        for name, (speed, bodies) in moves.items():
            path = Path(self.model.joints, self.reach.speeds)
            poses = [self._pose(b) for b in bodies]
            if any(p is None for p in poses):
                continue
            for pose in poses:
                assert pose is not None
                path.to(pose, speed, least=0.12).hold(EXPERIMENT.pause)
            yield path.home(calm).segment(name, "free")
        k = self.model.kinematics
        carrying = {j for foot in self._legs for j in k.chain(self.model.foot_links[foot])}
        counterweights = [j for j in self.model.joints if j not in carrying]
        deep = self._pose(down)
        if counterweights and deep is not None:
            path = Path(self.model.joints, self.reach.speeds).to(deep, calm).hold(EXPERIMENT.pause)
            for share in (1, -1, 0.5):
                path.to({j: self.reach.within(j, share * math.radians(40)) for j in counterweights}, brisk).hold(0.25)
            yield path.home(calm).segment("counterweights", "free")

    @cached_property
    def _legs(self) -> Mapping[str, tuple[str, ...]]:
        """Foot -> the joints of its leg, from the trunk on."""
        of = legs(self.model)
        return of if all(len(joints) >= 2 for joints in of.values()) else {}

    def _pose(self, body: Body) -> dict[str, float] | None:
        """Angles of the legs' joints that move the base like this, with the feet where they are in neutral; None if
        unreachable."""
        k = self.model.kinematics
        out: dict[str, float] = {}
        length = self._length
        R_WB = Rotation.from_euler("ZYX", body[:2:-1], degrees=True).as_matrix()
        for foot, joints in self._legs.items():
            goal = R_WB.T @ (self._foot(foot, joints, np.zeros(len(joints))) - length * np.array(body[:3]))
            ends = np.array([self.reach.range(j) for j in joints])
            tries = []
            for bend in (1.0, -1.0):
                first = np.zeros(len(joints))
                # knees bend backwards: the shank's joint goes back of the line from hip to foot
                first[-2:] = bend * np.array([0.4, 0.8 * self._sign_of_knee(foot, joints)])
                tries.append(least_squares(partial(self._goal_error, foot, joints, goal),
                                           np.clip(first, ends[:, 0] + 1e-3, ends[:, 1] - 1e-3), bounds=(ends[:, 0], ends[:, 1])))
            good = [t.x for t in tries if np.linalg.norm(t.fun) < EXPERIMENT.missed * length]
            if not good:
                return None
            out |= dict(zip(joints, map(float, min(good, key=partial(self._knee, foot)))))
        assert set(out) <= set(k.joints)
        return out

    def _sign_of_knee(self, foot: str, joints: tuple[str, ...]) -> float:
        """-1 where hip and knee turn about the same axis, so that one has to move back as the other moves forward; else 1."""
        k = self.model.kinematics
        poses = k.forward(np.zeros((1, len(k.joints))))
        hip, knee = (poses[k.frames[j].parent][1][0] @ k.frames[j].axis_of_parent for j in joints[-2:])
        return -1.0 if float(hip @ knee) > 0 else 1.0

    def _goal_error(self, foot: str, joints: tuple[str, ...], goal: Array, x: Array) -> Array:
        """Vector from its goal to the foot (3,) [m]."""
        return self._foot(foot, joints, x) - goal

    def _foot(self, foot: str, joints: tuple[str, ...], x: Array) -> Array:
        """Middle of the foot's points (3,) [m] in the root link's frame."""
        k = self.model.kinematics
        p, R = k.forward(x[None], joints)[self.model.foot_links[foot]]
        return np.asarray(p[0] + R[0] @ foot_points(self.model)[foot][0].mean(axis=0))

    def _knee(self, foot: str, x: Array) -> float:
        """How far forward the knee is [m]."""
        k = self.model.kinematics
        joints = self._legs[foot]
        return float(k.forward(x[None], joints)[k.frames[joints[-1]].child][0][0, 0])

    @cached_property
    def _length(self) -> float:
        """Length of a leg, from the joint of its thigh to its foot [m]."""
        k = self.model.kinematics
        foot, joints = next(iter(self._legs.items()))
        hip = k.forward(np.zeros((1, 1)), joints[:1])[k.frames[joints[-2]].child][0][0]
        return float(np.linalg.norm(self._foot(foot, joints, np.zeros(len(joints))) - hip))
