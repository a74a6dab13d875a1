"""Detects a joint's zero that shifts within a log: its readings step although no goal did, and stay there or step back."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from workbench.files.problem import CorrectedProblem
from workbench.recording.servo_log.following import JointLog
from workbench.recording.servo_log.response import fit_response, shapes
from workbench.types import Array


@dataclass(frozen=True)
class ShiftChecks:
    """least: smallest step between two rows, relative to its neighbours [deg], and `times` the difference of other steps from
    theirs in the `near` rows on each side. beyond: or so many times 99 % of the log's steps. agreement: largest difference, as a
    share of the step, between the level of the readings and that of the goals. goal: a goal that steps by that share of it
    within `before` explains it [s]. rows: fewest in a stretch. slowest: rows further apart are not used [s]. pause: steps across
    or next to rows that are so many medians apart are not used. explained: share of the position's variance that the goals must
    explain. doubt: of two levels, the one nearer to the goals counts as the right one, the first where they are equally near to
    that share."""

    least: float = 1.0
    times: float = 4.0
    near: int = 8
    beyond: float = 1.5
    agreement: float = 0.35
    goal: float = 0.4
    before: float = 0.3
    rows: int = 5
    slowest: float = 0.1
    pause: float = 3.0
    explained: float = 0.5
    doubt: float = 0.3


SHIFT = ShiftChecks()


def zero_shifts(log: JointLog, c: ShiftChecks = SHIFT) -> tuple[Array, list[str]]:
    """Correction to subtract from the positions of a log (K,) [rad], 0 where its zero is unchanged, and a line that reports
    it."""
    none = np.zeros(len(log.rows))
    if float(np.median(np.diff(log.time))) > c.slowest:
        return none, []
    steps = np.diff(log.position)
    extra = steps[1:-1] - (steps[:-2] + steps[2:]) / 2  # of step i + 1, beyond the mean of its neighbours
    large = np.flatnonzero(np.abs(steps) > np.deg2rad(c.least) / 2)
    apart = np.diff(log.time) > c.pause * float(np.median(np.diff(log.time)))
    large = large[(large >= 2) & (large < len(steps) - 2)]
    inside = large[~(apart[large - 1] | apart[large] | apart[large + 1])]
    sizes = np.abs(extra[inside - 1])
    alone = inside[(sizes > np.deg2rad(c.least)) & (np.abs(steps[inside + 1] - steps[inside - 1]) < sizes / 3)]
    far = max(c.beyond * float(np.quantile(np.abs(steps), 0.99)), np.deg2rad(2 * c.least))
    at = [k for k in alone.tolist() if _stands_out(extra, k, c) and not _goal_stepped(log, k, extra[k - 1], c)] or \
        [k for k in inside[sizes > far].tolist() if _is_complete(log, k) and not _goal_stepped(log, k, extra[k - 1], c)]
    if not at:
        return none, []
    edges = [0, *(k + 1 for k in at), len(log.rows)]
    jumps = extra[np.array(at) - 1]
    level = np.concatenate([[0.0], np.cumsum(jumps)])
    undone = log.position - np.repeat(level, np.diff(edges))
    fit = fit_response(shapes(log.time, log.goal), undone)
    if fit.explained < c.explained or fit.gain <= 0:
        return none, []
    away = log.position - fit.predicted
    middle = [float(np.median(away[a:b])) for a, b in pairwise(edges)]
    for i, jump in enumerate(jumps):
        if min(edges[i + 1] - edges[i], edges[i + 2] - edges[i + 1]) < c.rows:
            return none, []
        if abs(middle[i + 1] - middle[i] - jump) > c.agreement * abs(jump):
            return none, []
    true = _true_level(level, middle, fit.offset, c)
    off = np.repeat(level - level[true], np.diff(edges))
    return off, [_line(log, off, edges)]


def _is_complete(log: JointLog, k: int) -> bool:
    """Whether no row is missing around step `k`."""
    return bool(np.all(np.diff(log.rows[k - 2:k + 4]) == 1))


def _stands_out(extra: Array, k: int, c: ShiftChecks) -> bool:
    """Whether step `k` differs from its neighbours by more than nearby steps differ from theirs. extra: of step i + 1."""
    around = np.abs(np.concatenate([extra[max(k - 2 - c.near, 0):max(k - 2, 0)], extra[k + 1:k + 1 + c.near]]))
    return bool(abs(extra[k - 1]) > c.times * float(np.max(around, initial=0.0)))


def _goal_stepped(log: JointLog, k: int, step: float, c: ShiftChecks) -> bool:
    """Whether a goal stepped the same way shortly before."""
    first, end = np.searchsorted(log.time, log.time[k] - c.before), np.searchsorted(log.time, log.time[k + 1], side="right")
    goals = np.diff(log.goal[first:end])
    bend = goals[1:-1] - (goals[:-2] + goals[2:]) / 2
    return bool(len(bend) and np.max(bend * np.sign(step)) > c.goal * abs(step))


def _true_level(level: Array, middle: list[float], offset: float, c: ShiftChecks) -> int:
    """The stretch whose zero is right: the one nearest to the goals, or the first if they are almost equally near."""
    distance = np.abs(np.array(middle) + offset)
    best = int(np.argmin(distance))
    spread = max(float(np.ptp(level)), 1e-9)
    return 0 if distance[0] - distance[best] < c.doubt * spread else best


def _line(log: JointLog, off: Array, edges: list[int]) -> str:
    shifted = [(a, b) for a, b in pairwise(edges) if abs(off[a]) > 0]
    a, b = shifted[0]
    size = f"{np.rad2deg(off[a]):+.2f} deg"
    if len(shifted) == 1 and b == len(off):
        where = f"from {log.time[a]:.3f} s (row {log.rows[a] + 1}) on"
    elif len(shifted) == 1:
        where = f"from {log.time[a]:.3f} to {log.time[b - 1]:.3f} s (rows {log.rows[a] + 1} to {log.rows[b - 1] + 1})"
    else:
        where = f"in {len(shifted)} stretches, the first from {log.time[a]:.3f} s (row {log.rows[a] + 1})"
    return CorrectedProblem(f"its zero jumps: the readings stand {size} off {where}, no goal having stepped (a change of mode or "
                            "homing offset, a slipped horn or sensor); set right by that much")
