"""Joints whose columns stand for each other: a position that follows another joint's goals, and not its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.recording.servo_log.following import JointLog, followed


@dataclass(frozen=True)
class ExchangeChecks:
    """own: share of a position's variance that its own goals give at most. other: and another joint's at least. most: rows that
    are looked at, evenly chosen. goes: joints and goals that move less tell nothing [deg]."""

    own: float = 0.6
    other: float = 0.93
    most: int = 1500
    goes: float = 4.0


EXCHANGE = ExchangeChecks()


def exchanged(logs: Mapping[str, JointLog], c: ExchangeChecks = EXCHANGE) -> dict[str, str]:
    """By joint, the joint whose goals its position follows instead of its own."""
    far = {j: log for j, log in logs.items() if min(np.rad2deg(np.ptp(log.goal)), np.rad2deg(np.ptp(log.position))) >= c.goes}
    out = {}
    for joint, log in far.items():
        if _explained(log, log, c) > c.own:
            continue
        others = {other: _explained(that, log, c) for other, that in far.items() if other != joint}
        best = max(others, key=lambda o: others[o], default=None)
        if best is not None and others[best] >= c.other:
            out[joint] = best
    return out


def _explained(asked: JointLog, moved: JointLog, c: ExchangeChecks) -> float:
    """Share of a position's variance that a joint's goals give."""
    each = max(1, len(moved.rows) // c.most)
    goal = np.interp(moved.time, asked.time, asked.goal)
    return followed(moved.time[::each], goal[::each], moved.position[::each]).explained
