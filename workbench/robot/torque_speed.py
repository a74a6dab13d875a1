"""The torque-speed line of a servo at full duty (docs/formats.md, section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.types import Array


@dataclass(frozen=True)
class TorqueSpeedLine:
    """Constants of n servos as arrays (n,), or of one as floats: torque at full duty at the supply voltage [N m], back-EMF and
    viscous damping [N m s/rad], Coulomb friction [N m]."""

    full_torque: Array | float
    back_emf: Array | float
    viscous: Array | float
    coulomb: Array | float

    @property
    def no_load_speed(self) -> Array:
        """Speed (n,) [rad/s] at which full duty gives no motor torque at the supply voltage."""
        return np.asarray(self.full_torque / self.back_emf)

    @property
    def reachable_speed(self) -> Array:
        """Speed (n,) [rad/s] that the unloaded servo reaches at full duty against its own friction; below the no-load speed."""
        return np.asarray(np.maximum(self.full_torque - self.coulomb, 0.0) / (self.back_emf + self.viscous))

    def motor_torque(self, along: Array) -> Array:
        """Motor torque (N, n) [N m] at full duty. along: joint speed (N, n) [rad/s], positive in the torque's direction; a servo
        that is driven backwards has the back-EMF on its side."""
        return np.asarray(self.full_torque - self.back_emf * along)

    def available(self, torque: Array, speed: Array) -> Array:
        """Largest joint torque (N, n) [N m] in the direction of `torque` at a joint speed (N, n) [rad/s], at least 0: full duty
        less back-EMF, plus the gear's friction where the load drives the joint backwards."""
        along = speed * np.sign(torque)
        friction = np.where(along < 0, self.coulomb - self.viscous * along, 0.0)
        return np.asarray(np.maximum(self.motor_torque(along) + friction, 0.0))
