"""Finds stretches of a single value to which readings leap and from which they leap back: a bus or driver writes it while a servo
is silent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.files.problem import RemovedReadings
from workbench.recording.runs import runs_of_equals
from workbench.types import Array


@dataclass(frozen=True)
class NoAnswerChecks:
    """times: the leaps to the value and back are larger than so many times the joint's motion in a row, in all rows but
    `share`, and larger than `least` [deg]. longest: share of the log that such a value may fill. beside: rows before and after it
    that are compared. slowest: rows further apart are not used [s]. fewest: least number of rows."""

    times: float = 1.5
    share: float = 0.02
    least: float = 3.0
    longest: float = 0.3
    slowest: float = 0.1
    fewest: int = 40


NO_ANSWER = NoAnswerChecks()


def without_no_answer(time: Array, position: Array, c: NoAnswerChecks = NO_ANSWER) -> tuple[Array, list[str]]:
    """Positions (N,) [rad] at times (N,) [s] with such stretches blanked (NaN), and a line that counts them."""
    seen = np.flatnonzero(np.isfinite(position))
    if len(seen) < c.fewest or float(np.median(np.diff(time))) > c.slowest:
        return position, []
    values = position[seen]
    steps = np.abs(np.diff(values))
    runs = [(a, b) for a, b in runs_of_equals(values) if a > 0 and b + 1 < len(values)]
    in_runs = np.zeros(len(steps), dtype=bool)
    for a, b in runs:
        in_runs[a - 1:b + 1] = True  # the leaps must not raise their own threshold
    usual = steps[~in_runs]
    if not len(usual):
        return position, []
    least = max(c.times * float(np.quantile(usual, 1 - c.share)), np.deg2rad(c.least))
    found = [(a, b) for a, b in runs if steps[a - 1] > least and steps[b] > least and _comes_back(values, a, b)]
    if not found:
        return position, []
    known = np.unique([values[a] for a, _ in found])
    found = [(a, b) for a, b in runs if values[a] in known and max(steps[a - 1], steps[b]) > least]
    rows = np.concatenate([np.arange(a, b + 1) for a, b in found])
    if len(rows) > c.longest * len(values):
        return position, []
    out = position.copy()
    out[seen[rows]] = np.nan
    value = np.rad2deg(values[found[0][0]])
    all_of = f"of exactly {value:.4g} deg" if len(known) == 1 else f"the first of {value:.4g} deg"
    first = seen[found[0][0]]
    return out, [RemovedReadings(f"{len(rows)} reading(s) in {len(found)} stretch(es) {all_of}, to which the joint leaps and "
                                 f"from which it leaps back, the first from {time[first]:.3f} s (row {first + 1}): as a bus or "
                                 "driver writes when a servo does not answer; taken out")]


def _comes_back(values: Array, first: int, last: int) -> bool:
    """Whether the readings before and after a stretch are nearer to each other than to it, or on one side of it."""
    before, after, here = values[first - 1], values[last + 1], values[first]
    return bool((before - here) * (after - here) > 0 and abs(after - before) < max(abs(before - here), abs(after - here)))
