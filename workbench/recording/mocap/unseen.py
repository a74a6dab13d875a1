"""Poses that no camera saw, although the file contains numbers: lost bodies at the origin, and repeated poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench.recording.mocap.tracks import Tracks
from workbench.recording.runs import runs_of_true
from workbench.types import Array, Mask

_APART = 0.02
"""Least distance [m] from a lost body at the origin to where it is seen before or after: no walking robot gets as far in a
frame."""
_FEW = 20  # too few poses to estimate noise
_ALTERNATES = -0.4
"""Correlation of neighbouring third differences below which they are noise: -0.75 for white noise, towards 1 for motion."""
_ROUNDINGS = 1.5
"""With noise of at least this many units of the last digit, a pose of seven numbers never repeats by chance."""
_LEAST = 1e-7  # least noise [m]
_RUN, _LEAP, _LEAST_LEAP = 4, 3.0, 0.003
"""If noise is below the last digit, a body at rest counts as held if it rests for this many frames and then leaps by this
multiple of its largest other step, and this far [m]."""


def without_unseen(tracks: Tracks) -> Tracks:
    """Blanks the poses in which a body was not seen, and reports them in `problems`."""
    p, q, problems = tracks.p.copy(), tracks.q.copy(), list(tracks.problems)
    rate = None
    for i, asset in enumerate(tracks.assets):
        lost = _lost(p[i], q[i])
        if lost.any():
            problems.append(f"{asset}: {int(lost.sum())} frame(s) at the origin without a rotation: lost; treated as unseen")
            p[i, lost], q[i, lost] = np.nan, np.nan
        held = _repeats(p[i], q[i])
        if not held.any():
            continue
        p[i, held], q[i, held] = np.nan, np.nan
        share = held.sum() / np.isfinite(tracks.p[i, :, 0]).sum()
        if share > 0.4 and _longest(held)[1] <= max(2, round(share / (1 - share))):  # every second frame, or every n-th
            rate = tracks.rate * (1 - share)
            continue
        first, longest = _longest(held)
        problems.append(f"{asset}: {int(held.sum())} frame(s) repeat the pose before to the last digit, which noise never does: "
                        f"not seen (the longest {longest} frames from {tracks.time[first]:.3f} s)")
    if rate is not None:
        problems.append(f"poses change in only {rate:.0f} of {tracks.rate:.0f} frames a second: the others repeat them, and are "
                        "not seen")
    return replace(tracks, p=p, q=q, problems=tuple(problems))


def _lost(p: Array, q: Array) -> Mask:
    """(N,) frames exactly at the origin and unturned, in runs that begin or end with a leap."""
    at = (p == 0).all(axis=1) & (q[:, 1:] == 0).all(axis=1)
    seen = np.flatnonzero(np.isfinite(p).all(axis=1) & np.isfinite(q).all(axis=1))
    if not at.any() or at[seen].all():
        return np.zeros(len(p), dtype=bool)
    step = np.linalg.norm(np.diff(p[seen], axis=0), axis=1)
    edge = np.diff(at[seen].astype(int)) != 0
    return at if np.all(step[edge] > _APART) else np.zeros(len(p), dtype=bool)


def _repeats(p: Array, q: Array) -> Mask:
    """(N,) frames that repeat the pose seen before to the last digit, in a body whose poses are noisy."""
    held = np.zeros(len(p), dtype=bool)
    poses = np.hstack([p, q])
    seen = np.flatnonzero(np.isfinite(poses).all(axis=1))
    same = (poses[seen[1:]] == poses[seen[:-1]]).all(axis=1)
    if same.any() and _noisy(p[seen][np.concatenate([[True], ~same])]):
        held[seen[1:][same]] = True
    elif same.any():
        for first, last in runs_of_true(same):
            if last - first >= _RUN and _leaps(p[seen], last):
                held[seen[first + 1:last + 1]] = True
    return held


def _leaps(p: Array, last: int) -> bool:
    """Whether a body (N, 3) [m] leaves its rest at row `last` by a step larger than any other."""
    steps = np.linalg.norm(np.diff(p, axis=0), axis=1)
    others = np.delete(steps, last) if last < len(steps) else steps
    return last < len(steps) and bool(steps[last] > max(_LEAP * np.max(others, initial=0.0), _LEAST_LEAP))


def _noisy(places: Array) -> bool:
    """Whether two or more coordinates of the places (N, 3) [m] of poses that all differ jitter by more than rounding does."""
    if len(places) < _FEW:
        return False
    noisy = 0
    for values in places.T:
        third = np.diff(values, n=3)
        spread = 1.4826 * float(np.median(np.abs(third)))
        if spread / np.sqrt(20) <= max(_ROUNDINGS * _last_digit(values), _LEAST):
            continue
        third = np.clip(third, -4 * spread, 4 * spread)
        noisy += float(third[1:] @ third[:-1]) < _ALTERNATES * float(third @ third)
    return noisy >= 2


def _last_digit(values: Array) -> float:
    """One unit of the last decimal that values (N,) are written with; 0 where they have all digits of a float."""
    for digits in range(10):
        scaled = values * 10.0**digits
        if np.all(np.abs(scaled - np.round(scaled)) < 1e-3):
            return 10.0**-digits
    return 0.0


def _longest(held: Mask) -> tuple[int, int]:
    """First frame and length of the longest run."""
    first, end = max(runs_of_true(held), key=lambda run: run[1] - run[0])
    return first, end - first
