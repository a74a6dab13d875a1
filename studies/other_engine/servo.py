"""The nominal servo law (docs/formats.md, section 4), for a row of servos at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from workbench.robot import ServoConstants
from workbench.types import Array

_COUNT = np.deg2rad(300 / 1023)


class ServoBank:
    """The law from position error to duty, and the motor behind it, for n servos. Arrays are (n,), SI and radians."""

    def __init__(self, servos: Sequence[ServoConstants]) -> None:
        def column(name: str) -> Array:
            return np.array([0.0 if getattr(s, name) is None else getattr(s, name) for s in servos], dtype=float)

        proportional = np.array([s.proportional_gain is not None for s in servos], dtype=bool)
        self.margin = np.where(proportional, 0.0, column("compliance_margin") * _COUNT)
        self.punch = np.where(proportional, 0.0, column("punch") / 1023)
        with np.errstate(divide="ignore"):
            self.slope = np.where(proportional, 1 / column("proportional_gain"), column("compliance_slope") * _COUNT)
        """Error beyond the margin at which the duty is full [rad]."""
        self.supply = column("supply_voltage")
        self.full_torque = column("stall_torque") * column("supply_voltage") / column("rated_voltage")
        self.back_emf = column("stall_torque") / column("no_load_speed")
        self.viscous = column("viscous_friction")
        self.coulomb = column("coulomb_friction")
        self.inertia = column("reflected_inertia")
        self.derivative = column("derivative_gain")
        self.ramp = np.where(column("goal_ramp") > 0, np.deg2rad(column("goal_ramp")), np.inf)
        self.lag = column("command_filter")
        plain = np.where(proportional, column("minimum_duty"), 0.0)
        self.punch, self.slope = self.punch + plain, self.slope * (1 - plain)  # the gain beyond the dead zone is as given
        self.margin = self.margin + np.where(proportional, np.deg2rad(column("dead_zone")), 0.0)

    def duty(self, error: Array, speed: Array | float = 0.0) -> Array:
        """Duty, -1 to 1, at an error goal - position [rad] and a joint speed [rad/s], (..., n)."""
        beyond = np.abs(error) - self.margin
        size = np.where(beyond > 0, self.punch + (1 - self.punch) * beyond / self.slope, 0.0)
        return np.clip(np.copysign(size, error) - self.derivative * speed, -1.0, 1.0)

    def motor_torque(self, error: Array, speed: Array, enabled: Array | bool = True) -> Array:
        """Torque of the motor at the joint [N m] at a joint speed [rad/s]: the torque-speed line scaled by duty."""
        return np.where(enabled, self.duty(error, speed) * self.full_torque - self.back_emf * speed, 0.0)


class Reference:
    """Reference of each servo: from its last reference to the goal, at the moving speed (0 = at once) or its own ramp, behind
    its own low-pass filter. Times must not decrease."""

    def __init__(self, n: int, ramp: Array | float = np.inf, lag: Array | float = 0.0) -> None:
        self._now, self._goal, self._smooth, self._at = 0.0, np.zeros(n), np.zeros(n), np.zeros(n)
        self._ramp, self._lag = ramp, np.broadcast_to(np.asarray(lag, dtype=float), n)
        self._speed, self.enabled = np.full(n, np.inf), np.ones(n, dtype=bool)

    def command(self, t: float, goal: Array, speed: Array, enabled: NDArray[np.bool_], position: Array) -> None:
        """A command at time t [s]; a servo that is just enabled starts from its `position`."""
        self._at = np.where(enabled & ~self.enabled, position, self.at(t))
        self._now, self._goal, self.enabled = t, np.asarray(goal, dtype=float), np.asarray(enabled, dtype=bool)
        self._speed = np.minimum(np.where(np.asarray(speed) > 0, speed, np.inf), self._ramp)

    def at(self, t: float) -> Array:
        """The reference (n,) [rad] at t, not before the last command [s]."""
        elapsed = t - self._now
        with np.errstate(divide="ignore", invalid="ignore"):
            left = np.where(self._lag > 0, np.exp(-elapsed / self._lag), 0.0)
        smooth = self._goal + (self._smooth - self._goal) * left
        reach = self._speed * elapsed if elapsed > 0 else np.where(np.isinf(self._speed), np.inf, 0.0)
        at = self._at + np.minimum(np.maximum(smooth - self._at, -reach), reach)
        if self._lag.any():  # the ramp chases a goal that moves: step by step
            self._now, self._smooth, self._at = t, smooth, at
        return at
