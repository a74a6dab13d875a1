"""Where the robot is and how it differs from the map: a Kalman filter of heading, turning bias and gain, and filtered strides.

The state of the controller is a vector; the names of its entries are here.
"""

from __future__ import annotations

import numpy as np

from workbench.gait.drive.options import DriveOptions
from workbench.gait.drive.step_map import StepMap
from workbench.types import Array

X, Y, HEADING, BIAS, GAIN, P00, P01, P02, P11, P12, P22, PLAYED, NEXT, AFTER, ALONG, LOST, STARTED, AHEAD, ASIDE, \
    PLAYED_SIDE, NEXT_SIDE, AFTER_SIDE = range(22)
"""Position [m]; heading [rad]; turning bias beyond the map's [rad per cycle]; share by which the response to a turn exceeds the
map's; covariance of the last three; turns of the cycle that has ended, of the one that plays next and of the one after [rad per
stance]; distance along the path [m]; cycles without a pose; whether there was a first pose; the robot's own distance ahead and
aside in a cycle [m]; sideways strides of the same three cycles [m per stance]."""
_COVARIANCE = np.array([[P00, P01, P02], [P01, P11, P12], [P02, P12, P22]])


def first_state(m: StepMap, options: DriveOptions) -> Array:
    """Before anything was seen: at the origin, as the map says, with bias and gain unknown."""
    x = np.zeros(22)
    x[P11], x[P22], x[AHEAD], x[ASIDE] = options.first_bias**2, options.first_gain**2, m.ahead, m.aside
    return x


def update_state(x: Array, pose: Array, before: float, m: StepMap, options: DriveOptions) -> Array:
    """The state after one more cycle: predicted by the map, corrected by the pose, if there is one.

    x: state whose PLAYED and PLAYED_SIDE are already those of this cycle; pose (3,): x, y [m], heading [rad], NaN where there is
    none; before: turn of the cycle before it [rad].
    """
    x = x.copy()
    was, off = x[[X, Y]].copy(), x[HEADING]
    side = x[ASIDE] + _steered_aside(x, m)
    x[X] += x[AHEAD] * np.cos(off) - side * np.sin(off)
    x[Y] += x[AHEAD] * np.sin(off) + side * np.cos(off)
    steered = m.gain * x[PLAYED] + m.memory * before
    x[HEADING] += m.bias + x[BIAS] + (1.0 + x[GAIN]) * steered + m.side_turns * x[PLAYED_SIDE]
    F = np.array([[1.0, 1.0, steered], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    P = F @ x[_COVARIANCE] @ F.T + np.diag([m.scatter[0]**2, options.drift**2, 0.0])
    if not np.isfinite(pose).all():
        x[LOST] += 1
    else:
        wrong = np.arctan2(np.sin(pose[2] - x[HEADING]), np.cos(pose[2] - x[HEADING]))
        if not x[STARTED]:  # the start of the gait turns the robot too: its first heading says nothing of bias and gain
            x[HEADING] += wrong
            P = np.diag([options.noise**2, options.first_bias**2, options.first_gain**2])
        else:
            K = P[:, 0] / (P[0, 0] + options.noise**2)
            x[[HEADING, BIAS, GAIN]] += K * wrong
            P = P - np.outer(K, P[0])
            if not x[LOST]:
                _learn_stride(x, pose[:2] - was, off, m, options)
        x[X], x[Y] = pose[:2]
        x[LOST], x[STARTED] = 0.0, 1.0
    x[_COVARIANCE] = P
    return x


def _learn_stride(x: Array, step: Array, heading: float, m: StepMap, options: DriveOptions) -> None:
    """Moves the estimates of the stride towards the step (2,) [m] that the cameras saw, taken at this heading [rad]."""
    c, s = np.cos(heading), np.sin(heading)
    x[AHEAD] += options.stride_gain * (c * step[0] + s * step[1] - x[AHEAD])
    x[ASIDE] += options.stride_gain * (-s * step[0] + c * step[1] - _steered_aside(x, m) - x[ASIDE])


def _steered_aside(x: Array, m: StepMap) -> float:
    """How far this cycle's steering moves the robot aside [m]."""
    return float((1.0 + x[GAIN]) * m.aside_gain * x[PLAYED] + m.side_gain * x[PLAYED_SIDE])
