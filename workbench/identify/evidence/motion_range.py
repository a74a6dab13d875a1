"""How fast a joint moved in the recordings that a diagnosis used: a law that was fitted there need not hold beyond it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import savgol_filter

from workbench.identify.evidence.options import RangeOptions
from workbench.identify.evidence.torque_law import course
from workbench.robot.law_covariance import MotionRange
from workbench.types import Array

if TYPE_CHECKING:
    from workbench.identify.problem import TakeEvidence
    from workbench.robot import RobotModel


def range_of(joint: str, evidence: Sequence[TakeEvidence], model: RobotModel, options: RangeOptions) -> MotionRange | None:
    """The joint's motion in some takes; None where it was hardly seen."""
    speeds, accelerations, duties = list[Array](), list[Array](), list[Array]()
    for time, angle, duty in course(joint, evidence, model):
        step = float(np.median(np.diff(time)))
        rows = max(options.fewest, 2 * math.ceil(0.5 * options.smoothed / step) + 1)
        gaps = np.flatnonzero(np.diff(time) > options.smoothed) + 1
        for t, q, u in zip(*(np.split(each, gaps) for each in (time, angle, duty))):
            if len(t) < 2 * rows:
                continue
            even = np.interp(np.arange(t[0], t[-1], step), t, q)
            speeds.append(np.abs(savgol_filter(even, rows, 3, 1, step)))
            accelerations.append(np.abs(savgol_filter(even, rows, 3, 2, step)))
            duties.append(np.minimum(np.abs(u), 1.0))
    if not speeds:
        return None
    most = [float(np.quantile(np.concatenate(each), options.seldom)) for each in (speeds, accelerations, duties)]
    return MotionRange(math.degrees(most[0]), math.degrees(most[1]), most[2])


def join_ranges(a: MotionRange | None, b: MotionRange | None) -> MotionRange | None:
    """The range of both, as far as they are told."""
    return a.joined(b) if a is not None and b is not None else a or b


def tell_faster(joint: str, before: MotionRange | None, now: MotionRange | None, margin: float) -> str:
    """Where a joint moves more than `margin` times faster than an earlier diagnosis saw it: what follows for a finding there, in
    words; else empty."""
    if before is None or now is None or now.within(before, margin):
        return ""
    return (f" Or it was so before: the earlier diagnosis saw {joint} at up to {before}, and it moves at up to {now} now. To "
            "find out, record the earlier motions again.")
