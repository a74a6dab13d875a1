"""Finds joints whose columns are exchanged: the position follows another joint's goals instead of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.recording.servo_log.following import JointLog
from workbench.recording.servo_log.response import fit_response, shapes


@dataclass(frozen=True)
class ExchangeChecks:
    """own: largest share of a position's variance explained by its own goals. other: least share explained by another joint's
    goals, which must also be `better` more; or its own goals leave `times` as much unexplained. The other joint's own goals then
    explain at most `neither`, or the two positions correlate by `same`. most: rows that are used, evenly chosen. goes: joints and
    goals that move less are not used [deg]."""

    own: float = 0.6
    other: float = 0.8
    better: float = 0.4
    neither: float = 0.95
    times: float = 10.0
    same: float = 0.995
    most: int = 1500
    goes: float = 4.0


EXCHANGE = ExchangeChecks()


def find_exchanged(logs: Mapping[str, JointLog], c: ExchangeChecks = EXCHANGE) -> dict[str, str]:
    """For each exchanged joint, the joint whose goals its position follows instead of its own."""
    far = {j: log for j, log in logs.items() if min(np.rad2deg(np.ptp(log.goal)), np.rad2deg(np.ptp(log.position))) >= c.goes}
    out = {}
    own_shares = {joint: abs(_explained_share(log, log, c)) for joint, log in far.items()}
    for joint, log in far.items():
        own = own_shares[joint]
        if own > c.neither:
            continue
        others = {other: _explained_share(that, log, c) for other, that in far.items() if other != joint}
        best = max(others, key=lambda o: abs(others[o]), default=None)
        if best is not None and _better(own, abs(others[best]), c) and (
                own_shares[best] <= c.neither or _same(far[best], log, c)):
            out[joint] = best
    return out


def _better(own: float, other: float, c: ExchangeChecks) -> bool:
    """Whether another joint's goals explain sufficiently more of a position's variance than its own."""
    plain = own <= c.own and other >= max(c.other, own + c.better)
    return plain or 1 - own > c.times * (1 - other)


def _same(one: JointLog, other: JointLog, c: ExchangeChecks) -> bool:
    """Whether two joints have the same position: a duplicated column."""
    position = np.interp(other.time, one.time, one.position)
    return bool(np.ptp(position) > 0 and np.corrcoef(position, other.position)[0, 1] > c.same)


def _explained_share(asked: JointLog, moved: JointLog, c: ExchangeChecks) -> float:
    """Share of a position's variance that a joint's goals explain; negative if it moves in the opposite direction."""
    each = max(1, len(moved.rows) // c.most)
    time, position = moved.time[::each], moved.position[::each]
    rows = np.clip(np.searchsorted(asked.time, time + 1e-9, side="right") - 1, 0, len(asked.time) - 1)
    fit = fit_response(shapes(time, asked.goal[rows]), position)
    left = float(np.mean((position - fit.predicted) ** 2))
    return float(np.sign(fit.gain)) * max(1 - left / max(float(np.var(position)), 1e-12), 0.0)
