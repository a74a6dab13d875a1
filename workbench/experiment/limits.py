"""Limits of motions for a robot: joint ranges, speeds, and links that stay clear of each other."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np

from workbench.experiment.options import EXPERIMENT
from workbench.experiment.segment import Segment
from workbench.files import InputError
from workbench.motion import Motion
from workbench.robot import RobotModel
from workbench.robot.servo_profile_file import servo_profile
from workbench.robot.servo_units import units_of
from workbench.types import Array, Mask


class Reach:
    """Limits of one robot. speeds: (n,) [rad/s] that each servo can keep, units: (n,) its counts; in the model's order."""

    def __init__(self, model: RobotModel) -> None:
        self.model, self.units = model, units_of(model, model.joints)
        self.speeds = np.array([_reachable_speed(model, j) for j in model.joints])

    def within(self, joint: str, angle: float, room: float = 0.0) -> float:
        """The angle, cut to the joint's range less a margin and `room` [rad]."""
        low, high = self.range(joint)
        return float(np.clip(angle, min(low + room, 0.0), max(high - room, 0.0)))

    def range(self, joint: str) -> tuple[float, float]:
        """Range of goals [rad]; neutral is always inside."""
        frame = self.model.kinematics.frames[joint]
        lower, upper = (b if math.isfinite(b) else math.copysign(EXPERIMENT.widest, b) for b in (frame.lower, frame.upper))
        return min(max(lower + EXPERIMENT.margin, -EXPERIMENT.widest), 0.0), max(
            min(upper - EXPERIMENT.margin, EXPERIMENT.widest), 0.0
        )

    def allows(self, segment: Segment) -> bool:
        """Whether a motion table (docs/formats.md, section 2), ranges and speeds allow these segments."""
        try:
            table = Motion(segment.name, segment.times, self.model.joints, segment.angles, units=self.units).as_table()
        except InputError:
            return False
        ends = np.array([self.range(j) for j in self.model.joints])
        asked = np.abs(np.diff(segment.angles, axis=0)) / np.diff(segment.times)[:, None]
        angles = table.angles()
        return bool((angles > ends[:, 0] - table.count).all() and (angles < ends[:, 1] + table.count).all()
                    and (asked <= self.speeds * 1.001).all())

    def scaled_clear(self, segment: Segment) -> Segment | None:
        """The segment with its angles reduced until links stay clear of each other; None if that would reduce them too much."""
        for share in (1.0, 0.8, 0.6, 0.4):
            smaller = replace(segment, angles=segment.angles * share)
            at = np.arange(0, segment.duration, 0.03)
            q = np.column_stack([np.interp(at, segment.times, c) for c in smaller.angles.T])
            if self.clear(q).all() and self.allows(smaller):
                return smaller
        return None

    def clear(self, q: Array, share: float = 1.0) -> Mask:
        """Whether in poses (N, n) [rad] links that do not touch in neutral keep this share of their distance (N,)."""
        k = self.model.kinematics
        poses = k.forward(q, self.model.joints)
        at = {link: poses[link][0][:, None] + np.einsum("nij,mj->nmi", poses[link][1], points)
              for link, points in self._bones.items()}
        out = np.ones(len(q), dtype=bool)
        for (a, b), least in self._least.items():
            out &= _distance(at[a], at[b]) > share * least
        return out

    @cached_property
    def _bones(self) -> dict[str, Array]:
        """Points (M, 3) of each link, in its frame: on lines from its origin to the joints that it carries, or through its
        centre of mass to as far beyond."""
        k = self.model.kinematics
        ends: dict[str, list[Array]] = {link: [] for link in k.links}
        for f in k.frames.values():
            ends[f.parent].append(f.X_PF_p)
        share = np.linspace(0, 1, EXPERIMENT.points)[:, None]
        return {link: np.vstack([share * e for e in (to or [2 * k.centers[link]])]) for link, to in ends.items()}

    @cached_property
    def _least(self) -> Mapping[tuple[str, str], float]:
        k = self.model.kinematics
        neutral = k.forward(np.zeros((1, len(self.model.joints))), self.model.joints)
        at = {link: neutral[link][0][:, None] + np.einsum("nij,mj->nmi", neutral[link][1], p) for link, p in self._bones.items()}
        links = k.links
        out = {}
        for i, a in enumerate(links):
            for b in links[i + 1:]:
                have = float(_distance(at[a], at[b])[0])
                if have > 1e-3:  # else one carries the other
                    out[a, b] = min(EXPERIMENT.clear, EXPERIMENT.nearer * have)
        return out


def _distance(a: Array, b: Array) -> Array:
    """Least distance (N,) between points (N, M, 3) and (N, L, 3)."""
    apart = a[:, :, None] - b[:, None]
    return np.sqrt(np.einsum("nmli,nmli->nml", apart, apart).min(axis=(1, 2)))


def _reachable_speed(model: RobotModel, joint: str) -> float:
    servo = model.servo(joint)
    return EXPERIMENT.speed_share * min(float(servo.line.reachable_speed), _register_limit(servo.model))


def _register_limit(servo: str) -> float:
    """Highest speed [rad/s] that the servo's moving-speed register can hold; infinite for an unknown family."""
    try:
        family = servo_profile(servo)
    except InputError:
        return math.inf
    return family.largest_speed * family.speed_unit
