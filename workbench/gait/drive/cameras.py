"""Cameras that see a walking robot: those of the emulated robot, and a Motive server's stream."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.compare.metrics import heading
from workbench.device.capture import Recorder
from workbench.files import InputError
from workbench.gait.drive.walk import Cameras, Seen, lies, observe_base
from workbench.robot import RobotModel
from workbench.simulation.virtual_robot import VirtualRobot
from workbench.types import Array

STALE = 0.1
"""A pose older than this [s] is none: at 30 frames a second, the slowest cameras', three were lost."""
_FROM_Y_UP = Rotation.from_matrix([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotates y up to z up."""


class EmulatedCameras:
    """They see the base of an emulated robot, with noise and lost cycles. The robot starts at its world's origin."""

    def __init__(self, robot: VirtualRobot, cameras: Cameras, seed: int = 0) -> None:
        self._robot, self._cameras, self._rng = robot, cameras, np.random.default_rng(seed)

    def rest(self) -> None:
        """Nothing to do: poses count from the world's origin."""

    def seen(self) -> Seen:
        """The robot's pose now."""
        return observe_base(self._robot.body.base(self._robot.clock.now), self._cameras, self._rng)


class MotiveCameras:
    """The rigid body on the base link, from a stream that `recorder` receives in its own thread (y up, metres).

    Its pose at rest is the origin, so its pivot and rotation on the robot need not be known. Which way the robot faces follows
    from the positions of its rigid bodies at rest; at least two are needed.
    """

    def __init__(self, recorder: Recorder, model: RobotModel) -> None:
        names = [asset for asset, link in model.rigid_bodies.items() if link == model.base]
        if not names or len(model.rigid_bodies) < 2:
            raise InputError(model.description, f"rigid_bodies: expected one on the base '{model.base}' and one elsewhere, so "
                                                "that cameras see where the robot is and which way it faces")
        self._recorder, self._base, self._model = recorder, names[0], model
        self._rest: tuple[Rotation, Array] | None = None
        self._to_robot = _FROM_Y_UP

    def rest(self) -> None:
        """Takes the present pose as the origin; InputError where the robot's base, or any other of its bodies, is not seen."""
        self._to_robot = _FROM_Y_UP
        seen = {asset: pose for asset in self._model.rigid_bodies if (pose := self._now(asset)) is not None}
        if self._base not in seen or len(seen) < 2:
            raise InputError(None, f"the cameras see {', '.join(sorted(seen)) or 'no rigid body'} of the robot; expected "
                                   f"'{self._base}' and at least one other")
        neutral = self._model.kinematics.forward(np.zeros(len(self._model.joints)), self._model.joints)
        model = np.array([neutral[self._model.rigid_bodies[a]][0][0] for a in seen])
        turn = _turn(model[:, :2], np.array([p for _, p in seen.values()])[:, :2])
        self._to_robot = Rotation.from_euler("z", -turn) * _FROM_Y_UP
        self._rest = self._now(self._base)

    def seen(self) -> Seen:
        """The robot's pose now, from that at rest."""
        assert self._rest is not None, "rest first"
        now = self._now(self._base)
        if now is None:
            return Seen(np.full(3, np.nan), np.full(3, np.nan))
        R0, p0 = self._rest
        quat = (now[0] * R0.inv()).as_quat(scalar_first=True)
        pose = np.array([*(now[1] - p0)[:2], float(heading(quat[None])[0])])
        return Seen(pose, pose, lies(quat))

    def _now(self, asset: str) -> tuple[Rotation, Array] | None:
        latest = self._recorder.latest.get(asset)
        if latest is None or not latest[1].tracked or self._recorder.link.now() - latest[0] > STALE:
            return None
        body = latest[1]
        if not all(math.isfinite(v) for v in (*body.p, *body.quat)):
            return None
        return self._to_robot * Rotation.from_quat(body.quat), self._to_robot.apply(body.p)


def _turn(model: Array, seen: Array) -> float:
    """The rotation about the vertical [rad] that takes points (N, 2) of the model to where they are seen, least squares."""
    a, b = model - model.mean(axis=0), seen - seen.mean(axis=0)
    return float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
