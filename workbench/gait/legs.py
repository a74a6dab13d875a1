"""A robot's legs: which joints move which foot, and which angles put the foot where it should be."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.dynamics.machine import Machine
from workbench.files import InputError
from workbench.robot import RobotModel
from workbench.robot.kinematics import Kinematics, cross, rotation_about
from workbench.types import Array

_STEPS = 12
"""Of Newton's method; the guess is within a few degrees, so that four usually do."""
_DAMPING = 1e-6
"""[m^2] of the least squares, so that a stretched leg gives the nearest angles and not huge ones."""
_NEAR = 1e-7
"""Within which a tip is where it should be [m]."""
_STRIDE = 0.4
"""Longest step of one joint angle in one iteration [rad]."""


@dataclass(frozen=True)
class Leg:
    """One leg. foot: its name (its last joint's). joints: from the body on, those that move this foot alone. tip: (3,) [m] where
    it touches the ground in neutral, in the last link's frame. neutral: (3,) [m] the tip in the base link's frame with all
    joints at zero. hip: (3,) [m] where its first joint is, in the same. spheres: (S, 3) [m] in the last link's frame, with
    their radii (S,) [m], by which it can touch the ground."""

    foot: str
    joints: tuple[str, ...]
    tip: Array
    neutral: Array
    hip: Array
    kinematics: Kinematics
    link: str
    spheres: Array
    radii: Array

    def place(self, q: Array) -> Array:
        """Position of the tip in the base link's frame (N, 3) [m] for angles (N, k) [rad], other joints at zero."""
        return self._place(q)[0]

    def jacobian(self, q: Array) -> Array:
        """How the tip moves with the angles (N, 3, k) [m/rad]."""
        return self._place(q)[1]

    def solve(self, targets: Array, bend: Array | int) -> tuple[Array, Array]:
        """Angles (N, k) [rad] that put the tip at `targets` (N, 3) [m] in the base link's frame, other joints at zero, and how
        far it stays from them (N,) [m]; of each target the same, whatever the others are. bend: +1 the knee points back, -1
        forward, (N,) or for all."""
        targets = np.asarray(targets, dtype=float)
        q = self._guess(targets, bend)
        off = np.arange(len(targets))
        for _ in range(_STEPS):
            p, J = self._place(q[off])
            error = targets[off] - p
            far = np.abs(error).max(axis=1) >= _NEAR
            off, error, J = off[far], error[far], J[far]
            if not len(off):
                break
            step = J.transpose(0, 2, 1) @ np.linalg.solve(J @ J.transpose(0, 2, 1) + _DAMPING * np.eye(3), error[..., None])
            q[off] += np.clip(step[..., 0], -_STRIDE, _STRIDE)
        p, _ = self._place(q)
        return np.angle(np.exp(1j * q)), np.linalg.norm(targets - p, axis=1)

    @property
    def length(self) -> float:
        """Distance from the first joint down to the ground in neutral [m]."""
        return float(self.hip[2] - self.neutral[2])

    def _place(self, q: Array) -> tuple[Array, Array]:
        """The tip (N, 3) and its Jacobian (N, 3, k)."""
        N, k = q.shape
        p, R = np.zeros((N, 3)), np.broadcast_to(np.eye(3), (N, 3, 3))
        origins, axes = np.empty((N, k, 3)), np.empty((N, k, 3))
        for joint in self._chain:
            f = self.kinematics.frames[joint]
            p, R = p + R @ f.X_PF_p, R @ f.X_PF_R
            if joint in self.joints:
                i = self.joints.index(joint)
                origins[:, i], axes[:, i] = p, R @ f.axis
                R = R @ rotation_about(f.axis, q[:, i])
            p, R = p + R @ f.X_MB_p, R @ f.X_MB_R
        p = p + R @ self.tip
        return p, cross(axes, p[:, None] - origins).transpose(0, 2, 1)

    def _guess(self, targets: Array, bend: Array | int) -> Array:
        """The last two joints as a planar pair of bones, the first turned to the side where the foot is."""
        k = len(self.joints)
        zero = np.zeros((1, k))
        tip, J = self._place(zero)
        q = np.zeros((len(targets), k))
        if k < 2:
            return q
        origins = self._origins
        upper, lower = float(np.linalg.norm(origins[-1] - origins[-2])), float(np.linalg.norm(tip[0] - origins[-1]))
        reach = np.clip(np.linalg.norm(targets - origins[-2], axis=1), 0.3 * upper, upper + lower)
        inside = np.arccos(np.clip((reach**2 - upper**2 - lower**2) / (2 * upper * lower), -1, 1))
        forward = 1.0 if J[0, 0, -1] >= 0 else -1.0  # the sense in which the last joint brings the foot forward
        q[:, -1] = forward * bend * np.maximum(inside, 0.05)
        for column in (k - 2, *range(k - 2)):  # each further joint turns the foot towards its target
            p, J = self._place(q)
            slope = np.einsum("ni,ni->n", J[..., column], J[..., column])
            q[:, column] += np.einsum("ni,ni->n", J[..., column], targets - p) / np.maximum(slope, 1e-6)
        return q

    @cached_property
    def _chain(self) -> list[str]:
        return self.kinematics.chain(self.link)

    @cached_property
    def _origins(self) -> list[Array]:
        """Positions of the joints in the base link's frame in neutral (3,) [m]."""
        poses = self.kinematics.forward(np.zeros((1, len(self.kinematics.joints))))
        frames = [self.kinematics.frames[j] for j in self.joints]
        return [np.asarray(poses[f.parent][0][0] + poses[f.parent][1][0] @ f.X_PF_p) for f in frames]


def legs_of(model: RobotModel) -> tuple[Leg, ...]:
    """The robot's legs, in the order of their feet's names. InputError for a robot without feet, or with a foot that no joint of
    its own moves."""
    points, k = Machine(model).points, model.kinematics
    chains = {foot: k.chain(points.links[int(np.argmax(points.foot == i))]) for i, foot in enumerate(points.feet)}
    if not chains:
        raise InputError(model.description, "the robot has no foot: no leaf link with a shape that can touch the ground")
    out = []
    for i, foot in enumerate(points.feet):
        others = {j for name, chain in chains.items() if name != foot for j in chain}
        joints = tuple(j for j in chains[foot] if j in model.joints and j not in others)
        if not joints:
            raise InputError(model.description, f"foot '{foot}': expected a joint that moves this foot alone")
        own = points.foot == i
        link = points.links[int(np.argmax(own))]
        p, R = k.forward(np.zeros((1, len(k.joints))))[link]
        places = p[0] + points.p_LS[own] @ R[0].T
        lowest = np.array([*places[:, :2].mean(axis=0), float((places[:, 2] - points.radius[own]).min())])
        f = k.frames[joints[0]]
        p_P, R_P = k.forward(np.zeros((1, len(k.joints))))[f.parent]
        out.append(Leg(foot, joints, R[0].T @ (lowest - p[0]), lowest, p_P[0] + R_P[0] @ f.X_PF_p, k, link,
                       points.p_LS[own], points.radius[own]))
    return tuple(out)
