"""Finds readings that repeat the last one while the joint keeps moving, as when the bus times out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.files.problem import RemovedReadings
from workbench.recording.runs import runs_of_equals
from workbench.types import Array


@dataclass(frozen=True)
class RepeatChecks:
    """rows: least number of repetitions after a value. longest: largest number, beyond which the sensor froze.
    counts: least motion of the joint in each row around [counts of the sensor]; slower joints stick and slip naturally. catches:
    the next reading leaps by this share of the motion during the repeated rows. slows: its steps before and after are at
    least that share of it. around: rows on each side, in lengths of the repetition. stretches: least number.
    slowest: rows further apart are not used [s]. regular: share of the stretches that have the same length, and of half the log
    that they fill, where the sensor is read at a lower rate."""

    rows: int = 2
    longest: int = 15
    counts: float = 1.5
    catches: float = 0.6
    slows: float = 0.4
    around: int = 2
    stretches: int = 3
    slowest: float = 0.1
    regular: float = 0.8


REPEATS = RepeatChecks()


def without_repeats(time: Array, position: Array, c: RepeatChecks = REPEATS) -> tuple[Array, list[str]]:
    """Positions (N,) [rad] at times (N,) [s] with readings that only repeat the last one blanked (NaN), and a line for them."""
    seen = np.flatnonzero(np.isfinite(position))
    if len(seen) < 20 or float(np.median(np.diff(time))) > c.slowest:
        return position, []
    values = position[seen]
    steps = np.abs(np.diff(values))
    moving = steps[steps > 1e-9]
    if len(moving) < c.stretches:
        return position, []
    count = float(moving.min())
    found = [(a, b) for a, b in runs_of_equals(values) if c.rows <= b - a < c.longest and _catches_up(values, a, b, count, c)]
    if len({values[a] for a, _ in found}) < c.stretches:  # a looped motion may rest at one angle again and again
        return position, []
    out = position.copy()
    for a, b in found:
        out[seen[a + 1:b + 1]] = np.nan
    lengths = [b - a + 1 for a, b in found]
    rows = sum(n - 1 for n in lengths)
    usual = int(np.median(lengths))
    if lengths.count(usual) > c.regular * len(lengths) and rows > c.regular * len(values) * (usual - 1) / usual / 2:
        return out, [RemovedReadings(f"is new only in every {usual}th row (in {len(found)} stretches at least): read more slowly "
                                     f"than the log is written; {rows} repeated reading(s) taken out")]
    lasts = f"{min(lengths)} to {max(lengths)}" if min(lengths) < max(lengths) else f"{lengths[0]}"
    return out, [RemovedReadings(f"repeats the same reading for {lasts} rows while the joint moves, in {len(found)} stretches, "
                                 f"the first from {time[seen[found[0][0]]]:.3f} s (row {seen[found[0][0]] + 1}): as a reader "
                                 f"does when the bus times out; {rows} repeated reading(s) taken out")]


def _catches_up(values: Array, first: int, last: int, count: float, c: RepeatChecks) -> bool:
    """Whether a joint that was moving before a repetition is, right after it, where it would be if it had kept moving."""
    if first < 1 or last + 2 >= len(values):
        return False
    n = last - first + 1
    leap = values[last + 1] - values[last]
    before = values[first] - values[max(first - c.around * n, 0)]
    after = values[min(last + 1 + c.around * n, len(values) - 1)] - values[last + 1]
    rates = before / min(c.around * n, first), after / min(c.around * n, len(values) - 2 - last)
    slower, faster = sorted(map(abs, rates))
    if slower < c.counts * count or leap * rates[0] <= 0 or leap * rates[1] <= 0:
        return False
    nexts = np.flatnonzero(values[last + 2:] != values[last + 1])
    if not len(nexts):
        return False
    arrives = values[first] - values[first - 1]
    leaves = (values[last + 2 + nexts[0]] - values[last + 1]) / (nexts[0] + 1)
    on_its_way = min(arrives * np.sign(leap), leaves * np.sign(leap)) > c.slows * slower  # otherwise the joint did stand still
    return bool(on_its_way and c.catches * n * slower < abs(leap) < 3 * n * faster)
