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
_NEAR = 3  # frames over which a velocity still tells where a body goes


def unswap(tracks: Tracks, model: RobotModel | None) -> Tracks:
    """Puts back labels that change places. A change is seen where each of two bodies goes on where the other was;
    the frames between two changes are exchanged back. Of an odd number of changes either the start or the end is wrong:
    the robot's tree decides (joints keep their links together), or without a model the start is believed."""
    known = _Seen(tracks)
    step = [known.miss(i, i, known.anywhere) for i in range(len(tracks.assets))]
    events: list[tuple[int, int, int]] = []
    for a, b in combinations(range(len(tracks.assets)), 2):
        stay = step[a] + step[b]  # NaN where nothing came before or comes after
        maybe = np.flatnonzero((stay > _LEAP) & (known.seen[a] | known.seen[b]))
        cross = known.miss(a, b, maybe) + known.miss(b, a, maybe)
        events += [(int(f), a, b) for f in maybe[cross < _FAR_BETTER * stay[maybe]]]
    return _exchanged(tracks, sorted(events), model) if events else tracks


class _Seen:
    """Each body's last samples before every frame and its first from there on, so that a gap beside a change does not hide it."""

    def __init__(self, tracks: Tracks) -> None:
        n = len(tracks.time)
        self.tracks, self.seen, self.anywhere = tracks, tracks.seen, np.arange(n)
        at = np.where(self.seen, self.anywhere, -1)
        self.last = np.full(self.seen.shape, -1)
        self.last[:, 1:] = np.maximum.accumulate(at, axis=1)[:, :-1]
        at = np.where(self.seen, self.anywhere, n)
        self.next = np.minimum.accumulate(at[:, ::-1], axis=1)[:, ::-1]

    def miss(self, a: int, b: int, frames: NDArray[np.int64]) -> Array:
        """How far [m] body a's next sample is from where b was, or was going; NaN where one of them is not known."""
        t = self.tracks
        after, before = self.next[a, frames], self.last[b, frames]
        good = (after < len(t.time)) & (before >= 0)
        out = np.full(len(frames), np.nan)
        after, before = after[good], before[good]
        earlier = self.last[b, before]
        earlier = np.where((earlier >= 0) & (before - earlier <= _NEAR) & (after - before <= _NEAR), earlier, before)
        ahead = ((after - before) / np.maximum(before - earlier, 1))[:, None]
        p, q = t.p[b, before], t.q[b, before]
        q_on = q + ahead * (q - t.q[b, earlier])
        on = _apart(t, a, after, p + ahead * (p - t.p[b, earlier]), q_on / np.linalg.norm(q_on, axis=1, keepdims=True))
        out[good] = np.minimum(on, _apart(t, a, after, p, q))
        return out


def _apart(tracks: Tracks, a: int, frames: NDArray[np.int64], p: Array, q: Array) -> Array:
    return np.asarray(np.linalg.norm(tracks.p[a, frames] - p, axis=1) + _ARM * quat.angle_between(tracks.q[a, frames], q))


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

