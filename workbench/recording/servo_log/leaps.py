"""Finds leaps in positions that no servo can make: whole turns, wrapped registers, stray readings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from workbench.files.problem import CorrectedProblem, RemovedReadings
from workbench.recording.servo_log.state import count_of, resolution
from workbench.types import Array

TURN = 2 * np.pi
_FASTEST = 40.0
"""No hobby servo turns as fast [rad/s]; the fastest reach 17."""
_JITTER = 0.5
"""Least leap of a reading [rad], in addition to the motion at that speed."""
_SLOWEST = 0.1
"""Longest step between rows [s]: in a longer one a servo can move as far as a leap."""
_ASTRAY = 5
"""Most samples that may be removed as stray, or a fiftieth of the log if that is more."""
_OFF = 0.4
"""Allowed difference of a leap from whole turns [rad], as the joint keeps moving."""


def without_leaps(time: Array, position: Array) -> tuple[Array, list[str]]:
    """Positions (N,) [rad] at times (N,) [s] with stray readings blanked (NaN) and turns and 16-bit wraps undone; and a line for
    each."""
    seen = np.flatnonzero(np.isfinite(position))
    if len(seen) < 3 or float(np.median(np.diff(time))) > _SLOWEST:
        return position, []
    steps = np.diff(position[seen])
    leaps = np.abs(steps) > _JITTER + _FASTEST * np.diff(time[seen])
    if not leaps.any():
        return position, []
    part = np.concatenate([[0], np.cumsum(leaps)])  # (seen,) index of the stretch between leaps
    offset = np.concatenate([[0.0], np.cumsum(steps[leaps])])  # offset of each stretch from the first
    offset -= offset[_main(position[seen], part, offset)]
    count = count_of(position[seen][np.isin(part, np.flatnonzero(np.abs(offset) < _OFF + _JITTER))])
    wrap = 65536 * (count if np.isfinite(count) else resolution(position[seen]))
    out, report = position.copy(), _Said(time, position)
    short = max(_ASTRAY, len(seen) // 50)
    for k, jump in enumerate(offset):
        rows = seen[part == k]
        turns = round(jump / TURN)
        if abs(jump) < _OFF + _JITTER:
            continue
        whole = turns != 0 and abs(jump - turns * TURN) < _OFF * min(abs(turns), 2)
        if len(rows) <= short and not (wrap and abs(abs(jump) - wrap) < 0.02 * wrap):
            out[rows] = np.nan
            report.add("a whole turn" if whole else "more than a servo turns", rows, jump)
        elif whole and abs(turns) < 8:
            out[rows] -= turns * TURN
            report.add("turns", rows, jump)
        elif wrap and abs(abs(jump) - wrap) < 0.02 * wrap:
            out[rows] -= np.sign(jump) * wrap
            report.add("a 16-bit register that wrapped", rows, jump)
        else:
            report.add("no turn", rows, jump)
    return out, report.lines()


def _main(position: Array, part: NDArray[np.int_], offset: Array) -> int:
    """The stretch with the true offset: of the offsets that most rows share, the one nearest to the centre."""
    key = np.round(offset / TURN, 0)
    rows = {k: int(np.isin(part, np.flatnonzero(key == k)).sum()) for k in np.unique(key)}
    often = [k for k, n in rows.items() if n > 0.3 * len(position)] or [max(rows, key=lambda k: rows[k])]
    middle = {k: abs(float(np.median(position[np.isin(part, np.flatnonzero(key == k))]))) for k in often}
    best = min(often, key=lambda k: middle[k])
    return int(np.flatnonzero(key == best)[0])


class _Said:
    """The findings, by kind."""

    def __init__(self, time: Array, position: Array) -> None:
        self.time, self.position = time, position
        self.found: dict[str, list[tuple[NDArray[np.int_], float]]] = {}

    def add(self, kind: str, rows: NDArray[np.int_], jump: float) -> None:
        self.found.setdefault(kind, []).append((rows, jump))

    def lines(self) -> list[str]:
        out = list[str]()
        for kind, places in self.found.items():
            count, (rows, jump) = sum(len(r) for r, _ in places), places[0]
            at = f"{np.rad2deg(jump):+.1f} deg at {self.time[rows[0]]:.3f} s"
            if kind == "turns":
                out.append(CorrectedProblem(f"{count} reading(s) are whole turns off, first by {at}; turned back"))
            elif kind == "a 16-bit register that wrapped":
                out.append(CorrectedProblem(f"{count} reading(s) come from {kind}, first by {at}; undone"))
            elif kind == "no turn":
                out.append(f"{count} reading(s) lie where no servo gets that fast, first by {at}; left as they are"
                           f"{_much(count, len(self.time))}")
            else:
                out.append(RemovedReadings(f"{count} reading(s) leap away by {kind}, first by {at}; taken out"))
        return out


def _much(count: int, rows: int) -> str:
    """The likely reason for leaps that are too many to be exceptions."""
    return ": is it an angle, in degrees, and not a velocity, an error or an angle that wraps?" if count > 0.2 * rows else ""
