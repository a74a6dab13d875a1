"""What stays the same while gaits of one robot are searched for: legs, ranges, servos, self-contact, inverse dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from workbench.dynamics import InverseDynamics, RobotTrajectory
from workbench.effects.apply import physics_of
from workbench.files import InputError
from workbench.gait.legs import Leg, legs_of
from workbench.gait.self_contact import SelfContact
from workbench.gait.shape import GaitShape, foot_path
from workbench.robot import GRAVITY, RobotModel
from workbench.robot.ranges import JointRange, joint_ranges
from workbench.robot.servo_units import ServoUnits, units_of
from workbench.servo import ServoLaw
from workbench.types import Array, Mask

CREEP = 0.3
"""Joint speed [rad/s] about which Coulomb friction changes sign in the inverse servo law, so that a pose at a turning point asks
for none of it."""


@dataclass(frozen=True)
class GaitMachine:
    """One robot, as gaits need it. InputError for a robot that cannot walk: no feet, or fewer than two legs."""

    model: RobotModel

    def __post_init__(self) -> None:
        if len(self.legs) < 2:
            raise InputError(self.model.description, f"expected at least two legs, found {len(self.legs)}")

    @cached_property
    def legs(self) -> tuple[Leg, ...]:
        """The legs, by foot."""
        return legs_of(self.model)

    @cached_property
    def ranges(self) -> dict[str, JointRange]:
        """How far joints turn."""
        return joint_ranges(self.model)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """The ranges' ends (n,), (n,) [rad], in the model's order of joints."""
        ranges = [self.ranges[j] for j in self.model.joints]
        return np.array([r.lower for r in ranges]), np.array([r.upper for r in ranges])

    @cached_property
    def law(self) -> ServoLaw:
        """The servos' law, effects included."""
        return physics_of(self.model).law

    @cached_property
    def self_contact(self) -> SelfContact:
        """Distances between links."""
        return SelfContact(self.model)

    @cached_property
    def inverse_dynamics(self) -> InverseDynamics:
        """Inverse dynamics of the robot on its feet."""
        return InverseDynamics(self.model)

    @property
    def leg_length(self) -> float:
        """Length of the shortest leg in neutral [m]."""
        return min(leg.length for leg in self.legs)

    @cached_property
    def arm(self) -> float:
        """Mean distance of the neutral feet from the middle between them, along the floor [m]."""
        feet = np.array([leg.neutral[:2] for leg in self.legs])
        return float(np.linalg.norm(feet - feet.mean(axis=0), axis=1).mean())

    @property
    def natural_speed(self) -> float:
        """Root of gravity times leg length [m/s], by which speeds of robots of different sizes compare."""
        return float(np.sqrt(GRAVITY * self.leg_length))

    @cached_property
    def units(self) -> tuple[ServoUnits, ...]:
        """The counts (n,) of each joint's servo, which tables are written in."""
        return units_of(self.model, self.model.joints)

    @cached_property
    def speed_unit(self) -> Array:
        """One count of moving speed (n,) [rad/s]."""
        return np.array([u.speed_unit for u in self.units])

    @cached_property
    def fastest(self) -> NDArray[np.int64]:
        """Moving speed (n,) [counts] that full duty just reaches against the servo's own friction: the most that is asked."""
        reached = np.floor(self.law.line.reachable_speed / self.speed_unit).astype(np.int64)
        return np.minimum(reached, [u.fastest for u in self.units])

    def angles(self, shape: GaitShape, phases: Array, size: Array | float = 1.0) -> tuple[Array, Array, Mask]:
        """Joint angles (N, n) [rad] that put the feet on the shape's path at phases (N,), joints outside legs at zero; how far
        each foot stays from it (N, F) [m]; and which feet should stand (N, F)."""
        return self.angles_of([(shape, phases, size)])[0]

    def angles_of(self, wanted: Sequence[tuple[GaitShape, Array, Array | float]]
                  ) -> list[tuple[Array, Array, Mask]]:
        """`angles` of many shapes at once: the same, in a fraction of the time."""
        if not wanted:
            return []
        paths = [foot_path(shape, self.legs, phases, size) for shape, phases, size in wanted]
        places = np.concatenate([path.p for path in paths])
        q, off = np.zeros((len(places), len(self.model.joints))), np.empty(places.shape[:2])
        middle = float(np.mean([leg.neutral[0] for leg in self.legs]))
        for i, leg in enumerate(self.legs):
            end = 0 if leg.neutral[0] > middle else 1
            bend = np.repeat([shape.knees[end] for shape, _, _ in wanted], [len(path.p) for path in paths])
            q_leg, off[:, i] = leg.solve(places[:, i], bend)
            q[:, [self.model.joints.index(j) for j in leg.joints]] = q_leg
        ends = np.cumsum([len(path.p) for path in paths])
        return [(q[b - len(path.p):b], off[b - len(path.p):b], path.stance) for path, b in zip(paths, ends)]

    def droop(self, shape: GaitShape, q: Array, stance: Mask) -> Array:
        """Lead of the reference over the joints (P, n) [rad], such that the servos' duty gives the torque of the gait at its
        poses: the inverse of the servo law on inverse dynamics of the joints' periodic path q (P, n), at constant body
        velocity."""
        P, period = len(q), shape.period
        v = _periodic(q, period, 1)
        a = _periodic(q, period, 2)
        advance = np.array([shape.stride, shape.side, 0.0]) / (shape.duty * period)
        V = np.tile([0.0, 0.0, shape.turn / (shape.duty * period), *advance], (P, 1))
        height = -min(float(leg.neutral[2]) for leg in self.legs) - shape.crouch
        trajectory = RobotTrajectory(np.arange(P) * period / P, self.model.joints, q, v, a, np.tile([0, 0, height], (P, 1)),
                                     np.tile([1.0, 0, 0, 0], (P, 1)), V, np.zeros((P, 6)))
        feet = {leg.foot: stance[:, i] for i, leg in enumerate(self.legs)}
        torque = self.inverse_dynamics.of(trajectory, feet).torque
        law = self.law
        needed = torque + law.inertia * a + law.viscous * v + law.coulomb * np.clip(v / CREEP, -1, 1) + law.back_emf * v
        return law.rest_error(np.clip(needed, -law.full_torque, law.full_torque))


def _periodic(q: Array, period: float, order: int) -> Array:
    """Time derivative of a periodic path (P, n) at its samples, by its Fourier series."""
    P = len(q)
    factor = (2j * np.pi * np.fft.fftfreq(P, 1 / P) / period) ** order
    if P % 2 == 0 and order % 2 == 1:
        factor[P // 2] = 0.0
    return np.asarray(np.fft.ifft(factor[:, None] * np.fft.fft(q, axis=0), axis=0).real)
