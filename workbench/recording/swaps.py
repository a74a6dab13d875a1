"""Labels of two rigid bodies that were exchanged for a while, found by their leaps and put back."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from workbench.recording import quaternions as quat
from workbench.recording.tracks import Tracks
from workbench.robot import RobotModel

Array = NDArray[np.float64]
_ARM = 0.1
_LEAP = 0.01  # [m] both leaps together; less is no matter
_FAR_BETTER = 0.3  # exchanged, the two must fit this much better


def unswap(tracks: Tracks, model: RobotModel | None) -> Tracks:
    """Puts back labels that change places. A change is seen where each of two bodies goes on where the other was;
    the frames between two changes are exchanged back. Of an odd number of changes either the start or the end is wrong:
    the robot's tree decides (joints keep their links together), or without a model the start is believed."""
    seen = tracks.seen
    last = _last_seen(seen)
    n = len(tracks.time)
    events: list[tuple[int, int, int]] = []
    step = [_distance(tracks, i, np.arange(n), i, last[i]) for i in range(len(tracks.assets))]
    for a, b in combinations(range(len(tracks.assets)), 2):
        stay = step[a] + step[b]
        maybe = np.flatnonzero((stay > _LEAP) & seen[a] & seen[b])  # NaN where nothing came before
        if len(maybe):
            cross = _distance(tracks, a, maybe, b, last[b][maybe]) + _distance(tracks, b, maybe, a, last[a][maybe])
            events += [(int(f), a, b) for f in maybe[cross < _FAR_BETTER * stay[maybe]]]
    if not events:
        return tracks
    return _exchanged(tracks, sorted(events), model)


def _last_seen(seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(A, N) the last frame before each at which the body was seen; -1 if none."""
    at = np.where(seen, np.arange(seen.shape[1]), -1)
    out = np.full(seen.shape, -1, dtype=np.int64)
    out[:, 1:] = np.maximum.accumulate(at, axis=1)[:, :-1]
    return out


def _distance(tracks: Tracks, a: int, frames: NDArray[np.int64], b: int, others: NDArray[np.int64]) -> Array:
    d = np.linalg.norm(tracks.p[a, frames] - tracks.p[b, others], axis=1)
    d += _ARM * quat.angle_between(tracks.q[a, frames], tracks.q[b, others])
    return np.where(others >= 0, d, np.nan)


def _exchanged(tracks: Tracks, events: list[tuple[int, int, int]], model: RobotModel | None) -> Tracks:
    n = len(tracks.time)
    p, q, problems, mended = tracks.p.copy(), tracks.q.copy(), list(tracks.problems), tracks.mended.copy()
    by_pair: dict[tuple[int, int], list[int]] = {}
    for frame, a, b in events:
        by_pair.setdefault((a, b), []).append(frame)
    for (a, b), frames in by_pair.items():
        if len(frames) % 2:
            frames = _odd(tracks, a, b, frames, model)
        for first, end in zip(frames[::2], frames[1::2]):
            span = slice(first, end)
            p[[a, b], span], q[[a, b], span] = p[[b, a], span], q[[b, a], span]
            mended[span] = True
            problems.append(f"{tracks.assets[a]} and {tracks.assets[b]}: labels exchanged from {tracks.time[first]:.3f} s, "
                            f"{end - first} frame(s){' to the end' if end == n else ''}; put back")
    q = np.stack([quat.continuous(track)[0] for track in q])
    return replace(tracks, p=p, q=q, problems=tuple(problems), mended=mended)


def _odd(tracks: Tracks, a: int, b: int, frames: list[int], model: RobotModel | None) -> list[int]:
    """Completes an odd list of changes with the end (the start's labels were right) or the start (the end's were)."""
    n = len(tracks.time)
    to_end, from_start = [*frames, n], [0, *frames]
    if model is None:
        return to_end
    return min(to_end, from_start, key=lambda spans: _misfit(tracks, a, b, spans, model)) if len(frames) else to_end


def _misfit(tracks: Tracks, a: int, b: int, spans: list[int], model: RobotModel) -> float:
    p, q = tracks.p.copy(), tracks.q.copy()
    for first, end in zip(spans[::2], spans[1::2]):
        span = slice(first, end)
        p[[a, b], span], q[[a, b], span] = p[[b, a], span], q[[b, a], span]
    trial = replace(tracks, p=p, q=q)
    return sum(joint_misfit(trial, i, j) for i, j in neighbours(trial, model) if {i, j} & {a, b})


def neighbours(tracks: Tracks, model: RobotModel) -> list[tuple[int, int]]:
    """Rows (parent, child) of tracked links that one joint connects."""
    row = {model.rigid_bodies[asset]: i for i, asset in enumerate(tracks.assets) if asset in model.rigid_bodies}
    return [(row[f.parent], row[f.child]) for f in model.kinematics.frames.values() if f.parent in row and f.child in row]


def joint_misfit(tracks: Tracks, parent: int, child: int) -> float:
    """RMS [m] by which two bodies fail to share one joint centre: p_c = p_p + R_p a + R_c b with the best constant a and b."""
    seen = np.flatnonzero(tracks.seen[parent] & tracks.seen[child])
    seen = seen[:: max(1, len(seen) // 300)]
    if len(seen) < 6:
        return 0.0
    A = np.concatenate([quat.matrix(tracks.q[parent, seen]), quat.matrix(tracks.q[child, seen])], axis=2).reshape(-1, 6)
    y = (tracks.p[child, seen] - tracks.p[parent, seen]).reshape(-1)
    x, *_ = np.linalg.lstsq(A, y, rcond=1e-9)
    return float(np.sqrt(np.mean((A @ x - y) ** 2)))

