"""The nominal law of a position servo (docs/formats.md, section 4; AX-12A manual, compliance figure), on plain arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from workbench.robot import ServoConstants
from workbench.robot.torque_speed import TorqueSpeedLine
from workbench.robot.torque_table import TorqueTable
from workbench.types import Array, Mask

LEAST_LAG = 1e-4
"""A filter of the goal that is faster than this [s] counts as none: turned back by a step of milliseconds, it would divide by
nothing."""


@lru_cache(maxsize=256)  # robots that a fit compares differ in few servos
def _constants(s: ServoConstants) -> tuple[float, ...]:
    """Of one servo, in the order of `ServoLaw`."""
    return (s.gain, s.margin, s.punch_duty, s.torque_at_full_duty, s.back_emf, s.viscous_friction, s.coulomb_friction,
            s.reflected_inertia, s.stall_torque / s.rated_voltage, s.derivative_gain, s.ramp, s.command_filter, s.load_friction)


@dataclass(frozen=True)
class ServoLaw:
    """Constants of n servos as arrays (n,): gain [duty/rad], margin [rad], punch [duty], torque at full duty [N m] and that per
    volt of supply, back-EMF and viscous damping [N m s/rad], Coulomb friction [N m], reflected inertia [kg m^2]; derivative gain
    [duty per rad/s], speed of the goal's ramp [rad/s] (infinite: none), time constant of the goal's lag [s] (0 if below
    LEAST_LAG), and friction as a share of the load; tables: torques beyond all that, each with the number of its servo.
    A goal's delay is not here: it is in when commands come (`workbench.effects.apply.played`)."""

    gain: Array
    margin: Array
    punch: Array
    full_torque: Array
    back_emf: Array
    viscous: Array
    coulomb: Array
    inertia: Array
    torque_per_volt: Array
    derivative: Array
    ramp: Array
    lag: Array
    load_friction: Array
    tables: tuple[tuple[int, TorqueTable], ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "lag", np.where(self.lag < LEAST_LAG, 0.0, self.lag))

    @staticmethod
    def of(servos: Sequence[ServoConstants]) -> ServoLaw:
        """Stacks the constants of one servo a joint."""
        columns = np.array([_constants(s) for s in servos], dtype=float).reshape(-1, 13).T.copy()
        tables = tuple((i, table) for i, s in enumerate(servos) for table in s.torque_tables)
        return replace(ServoLaw(*columns), tables=tables) if tables else ServoLaw(*columns)

    @property
    def line(self) -> TorqueSpeedLine:
        """The torque-speed lines at full duty and the supply voltage."""
        return TorqueSpeedLine(self.full_torque, self.back_emf, self.viscous, self.coulomb)

    @property
    def damping(self) -> Array:
        """Damping of a joint whose servo is on: back-EMF and viscous friction [N m s/rad]."""
        return self.back_emf + self.viscous

    def duty(self, error: Array, velocity: Array | float = 0.0) -> Array:
        """Duty of the H-bridge, -1 to 1, for the error reference - measured [rad] at a velocity [rad/s]; shapes (..., n)."""
        beyond = np.abs(error) - self.margin
        if not self.derivative.any():
            size = np.minimum(self.punch + self.gain * beyond, 1.0)
            return np.copysign(np.where(beyond > 0, size, 0.0), error)
        size = np.where(beyond > 0, self.punch + self.gain * beyond, 0.0)
        return np.asarray(np.clip(np.copysign(size, error) - self.derivative * velocity, -1.0, 1.0))

    def motor_torque(self, error: Array, velocity: Array, enabled: Mask | bool = True) -> Array:
        """Torque of the motor at the joint [N m], before friction: duty torque less back-EMF, 0 with torque disabled."""
        torque = self.duty(error, velocity) * self.full_torque - self.back_emf * velocity
        return np.asarray(np.where(enabled, torque, 0.0), dtype=float)

    def rest_error(self, torque: Array) -> Array:
        """Error reference - measured [rad] at which duty alone balances `torque` [N m] (without friction)."""
        size = np.abs(torque) / self.full_torque
        return np.copysign(self.margin + np.maximum(size - self.punch, 0.0) / self.gain, torque)
