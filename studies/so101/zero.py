"""Whether the URDF's zeros and signs are the recordings': predicted gravity, with each joint's zero moved, against the recorded.

As in `response`, without a constant: a servo has none beyond a count, and gravity over a narrow range of poses looks like one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studies.so101.response import DRAWS, Value
from studies.so101.rows import LOADED, Rows, gravity
from workbench.recording.formats.sage import JOINTS
from workbench.robot import Kinematics
from workbench.types import Array

OFFSETS = np.radians(np.arange(-60, 61, 5))


@dataclass(frozen=True)
class Zero:
    """One joint. sign: compliance [rad/(N m)] with which gravity's torque shows in its error, positive where the URDF's sign
    holds; offset: what added to the recorded angle explains most [rad]; gain: share by which squares fall below those at 0."""

    joint: str
    sign: Value
    offset: Value
    gain: float


def zeros(training: Sequence[Rows], arm: Kinematics, seed: int = 0) -> list[Zero]:
    """For the joints that gravity turns, one offset at a time, judged by the errors of all three."""
    rng = np.random.default_rng(seed)
    draws = rng.integers(0, len(training), (DRAWS, len(training)))
    out = []
    for joint in LOADED:
        moments = np.array([[[_moments(r, arm, joint, d, JOINTS.index(seen)) for seen in LOADED] for d in OFFSETS]
                            for r in training])
        cost = _cost(moments.sum(axis=0))
        best = [float(OFFSETS[np.argmin(_cost(moments[k].sum(axis=0)))]) for k in draws]
        at_zero = moments[:, len(OFFSETS) // 2, LOADED.index(joint)]
        sign = [_compliance(at_zero[k].sum(axis=0)) for k in draws]
        low, high = np.quantile(best, [0.05, 0.95])
        s_low, s_high = np.quantile(sign, [0.05, 0.95])
        least = int(np.argmin(cost))
        out.append(Zero(joint, Value(_compliance(at_zero.sum(axis=0)), float(s_low), float(s_high)),
                        Value(float(OFFSETS[least]), float(low), float(high)), float(1 - cost[least] / cost[len(OFFSETS) // 2])))
    return out


def _moments(r: Rows, arm: Kinematics, moved: str, offset: float, i: int) -> Array:
    """Sums of products of speed, direction, direction times load, gravity, and error, while joint i moves (5, 5)."""
    use = np.flatnonzero(r.moving[:, i])[::3]
    offsets = np.where(np.array(JOINTS) == moved, offset, 0.0)
    g = gravity(arm, r.q[use], offsets)[:, i]
    sign = np.sign(r.v[use, i])
    a = np.column_stack([r.v[use, i], sign, sign * np.abs(g), -g, r.error(i)[use]])
    return np.asarray(a.T @ a)


def _cost(moments: Array) -> Array:
    """Residual sum of squares (offsets,), over the three joints' own squares, of moments (offsets, 3, 5, 5)."""
    out = np.zeros(len(moments))
    for k, joints in enumerate(moments):
        for m in joints:
            x = np.linalg.lstsq(m[:-1, :-1], m[:-1, -1], rcond=1e-10)[0]
            out[k] += (m[-1, -1] - x @ m[:-1, -1]) / m[-1, -1]
    return out


def _compliance(m: Array) -> float:
    return float(np.linalg.lstsq(m[:-1, :-1], m[:-1, -1], rcond=1e-10)[0][-1])
