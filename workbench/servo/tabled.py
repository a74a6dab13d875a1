"""Torques without a named cause, as tables of angle, duty or speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from workbench.robot.torque_table import DependsOn, TorqueTable
from workbench.servo.terms import Instant, ServoTerm, TermNumbers
from workbench.types import Array

TURNING = 0.15
"""Speed [rad/s] at which a torque that follows the direction of motion has 1/sqrt(2) of its size: above creep and a sensor's
quantum, below the speeds at which servos move."""
ANGLE, ANGLE_DIRECTION, DUTY, DUTY_DIRECTION, SPEED = range(5)
"""The arguments of a torque as numbers, in the order of `DependsOn`."""


class Tabled(ServoTerm):
    """tables: each with the number of its servo; n: how many servos there are."""

    def __init__(self, tables: Sequence[tuple[int, TorqueTable]], n: int) -> None:
        self.tables, self.n = tuple(tables), n
        self.servo, self.depends_on, self.at, self.by = arrays_of(self.tables)

    def more_torque(self, now: Instant) -> Array:
        """Sum of the tables, by servo [N m]."""
        out = np.zeros(self.n)
        for t, i in enumerate(self.servo.tolist()):
            out[i] += self._one(t, float(now.angle[i]), float(now.velocity[i]), float(now.duty[i]))
        return out

    def _one(self, t: int, angle: float, velocity: float, duty: float) -> float:
        kind = self.depends_on[t]
        x = angle if kind in (ANGLE, ANGLE_DIRECTION) else duty
        x = abs(duty) if kind == DUTY_DIRECTION else velocity if kind == SPEED else x
        value = np.interp(x, self.at[t], self.by[t])
        if kind in (ANGLE_DIRECTION, DUTY_DIRECTION):
            value *= velocity / np.sqrt(velocity * velocity + TURNING * TURNING)
        return float(value)

    def numbers(self) -> TermNumbers:
        """All numbers of the term."""
        return TermNumbers(tables=self.tables)


def arrays_of(tables: Sequence[tuple[int, TorqueTable]]) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
    """Number of the servo (t,), number of the argument (t,), the knots (t, K) in SI and the torques there (t, K). Shorter tables
    are filled up with their last torque, as a table is constant beyond its end."""
    longest = max((len(table.at) for _, table in tables), default=1)
    servo = np.array([i for i, _ in tables], dtype=np.int64)
    kinds = np.array([get_args(DependsOn).index(table.depends_on) for _, table in tables], dtype=np.int64)
    at, by = np.zeros((len(tables), longest)), np.zeros((len(tables), longest))
    for t, (_, table) in enumerate(tables):
        n, knots = len(table.at), np.array(table.at) * table.scale
        at[t, :n], by[t, :n] = knots, table.torque
        at[t, n:] = knots[-1] + np.arange(1, longest - n + 1)
        by[t, n:] = table.torque[-1]
    return servo, kinds, at, by
