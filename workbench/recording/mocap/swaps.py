"""Finds labels of two rigid bodies that were exchanged for a while, by their leaps, and restores them."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from workbench.recording import quaternions as quat
from workbench.recording.mocap.tracks import Tracks
from workbench.robot import RobotModel
from workbench.types import Array

_ARM = 0.1
_LEAP = 0.01  # [m] least sum of both leaps
_FAR_BETTER = 0.3  # factor by which two bodies must fit better when exchanged
_STRAINED, _TORN = 0.002, 0.01  # [m] misfit of a joint, larger than any play, that starts a search for wrong labels
_WHOLE = 0.5  # the same of all joints together, their noise included
_NEAR = 3  # frames over which a body's path can be extrapolated


def unswap(tracks: Tracks, model: RobotModel | None) -> Tracks:
    """Restores labels that change places. A change is detected where each of two bodies continues where the other was; the frames
    between two changes are exchanged back. If the number of changes is odd, either the start or the end is wrong: the robot's
    tree decides (joints keep their links together); without a model, the start is taken as right."""
    known = _Seen(tracks)
    step = [known.miss(i, i, known.anywhere) for i in range(len(tracks.assets))]
    events: list[tuple[int, int, int]] = []
    for a, b in combinations(range(len(tracks.assets)), 2):
        stay = step[a] + step[b]  # NaN where there is no sample before or after
        maybe = np.flatnonzero((stay > _LEAP) & (known.seen[a] | known.seen[b]))
        cross = known.miss(a, b, maybe) + known.miss(b, a, maybe)
        events += [(int(f), a, b) for f in maybe[cross < _FAR_BETTER * stay[maybe]]]
    if events:
        starts, right, reverse = _histories(tracks, sorted(events))
        holds = right
        if model is not None and right[-1] != right[0]:
            holds = min((right, reverse), key=lambda h: _total_misfit(_restore(tracks, starts, h), model))
        tracks = replace(_restore(tracks, starts, holds), problems=(*tracks.problems, *_describe(tracks, starts, holds)))
    return tracks if model is None else _throughout(tracks, model)


class _Seen:
    """Each body's last samples before every frame and its first from there on, so that a gap next to a change does not hide
    it."""

    def __init__(self, tracks: Tracks) -> None:
        n = len(tracks.time)
        self.tracks, self.seen, self.anywhere = tracks, tracks.seen, np.arange(n)
        at = np.where(self.seen, self.anywhere, -1)
        self.last = np.full(self.seen.shape, -1)
        self.last[:, 1:] = np.maximum.accumulate(at, axis=1)[:, :-1]
        at = np.where(self.seen, self.anywhere, n)
        self.next = np.minimum.accumulate(at[:, ::-1], axis=1)[:, ::-1]

    def miss(self, a: int, b: int, frames: NDArray[np.int64]) -> Array:
        """Distance [m] of body a's next sample from b's last or extrapolated position; NaN if either is unknown."""
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


def _histories(tracks: Tracks, events: list[tuple[int, int, int]]) -> tuple[list[int], list[list[int]], list[list[int]]]:
    """Frames at which segments begin, and the body behind each label in each segment, assuming first that the start's labels are
    right, then the end's."""
    starts, holds = [0], [list(range(len(tracks.assets)))]
    for frame, a, b in events:
        now = holds[-1].copy()
        now[a], now[b] = now[b], now[a]
        starts.append(frame)
        holds.append(now)
    called = np.argsort(holds[-1])  # each body's label at the end
    return starts, holds, [[int(called[body]) for body in now] for now in holds]


def _restore(tracks: Tracks, starts: list[int], holds: list[list[int]]) -> Tracks:
    """Tracks in which each body has the samples recorded for it under any label."""
    p, q, mended = tracks.p.copy(), tracks.q.copy(), tracks.mended.copy()
    for first, end, now in zip(starts, [*starts[1:], len(tracks.time)], holds):
        p[now, first:end], q[now, first:end] = tracks.p[:, first:end], tracks.q[:, first:end]
        mended[first:end] |= now != sorted(now)
    return replace(tracks, p=p, q=np.stack([quat.continuous(track)[0] for track in q]), mended=mended)


def _describe(tracks: Tracks, starts: list[int], holds: list[list[int]]) -> list[str]:
    """A line for each set of exchanged labels, with the time."""
    n = len(tracks.time)
    spans: dict[tuple[int, ...], list[list[int]]] = {}
    for first, end, now in zip(starts, [*starts[1:], n], holds):
        for labels in _cycles(now):
            before = spans.setdefault(labels, [])
            if before and before[-1][1] == first:
                before[-1][1] = end
            else:
                before.append([first, end])
    return [f"{' and '.join(tracks.assets[i] for i in labels)}: labels exchanged from {tracks.time[first]:.3f} s, "
            f"{end - first} frame(s){' to the end' if end == n else ''}; put back"
            for labels, each in spans.items() for first, end in each if end > first]


def _cycles(holds: list[int]) -> list[tuple[int, ...]]:
    """Sets of labels that hold each other's bodies."""
    left, out = {i for i, body in enumerate(holds) if i != body}, []
    while left:
        cycle = [min(left)]
        while holds[cycle[-1]] != cycle[0]:
            cycle.append(holds[cycle[-1]])
        left -= set(cycle)
        out.append(tuple(sorted(cycle)))
    return out


def _total_misfit(tracks: Tracks, model: RobotModel) -> float:
    return sum(joint_misfit(tracks, i, j) for i, j in neighbours(tracks, model))


def _throughout(tracks: Tracks, model: RobotModel) -> Tracks:
    """Exchanges two labels that were wrong from the first frame to the last, if that makes the joints fit."""
    pairs = neighbours(tracks, model)
    now = _total_misfit(tracks, model)
    worst = max(pairs, key=lambda pair: joint_misfit(tracks, *pair), default=None)
    if worst is None or joint_misfit(tracks, *worst) < _STRAINED:
        return tracks
    n = len(tracks.assets)
    trials = []
    for a, b in combinations(range(n), 2):
        holds = list(range(n))
        holds[a], holds[b] = b, a
        trials.append((_total_misfit(_restore(tracks, [0], [holds]), model), holds))
    best = min(misfit for misfit, _ in trials)
    if best > _WHOLE * now:
        if joint_misfit(tracks, *worst) < _TORN:
            return tracks
        names = " and ".join(tracks.assets[i] for i in worst)
        return replace(tracks, problems=(*tracks.problems, f"{names}: their motion does not fit any joint of the model"))
    even = [holds for misfit, holds in trials if misfit < 1.5 * best]  # with two equal legs, the exchange may be at either joint
    holds = min(even, key=lambda h: _out_of_place(_restore(tracks, [0], [h]), model))
    fixed = _restore(tracks, [0], [holds])
    return replace(fixed, problems=(*tracks.problems, *_describe(tracks, [0], [holds])))


def _out_of_place(tracks: Tracks, model: RobotModel) -> float:
    """RMS distance [m] of the bodies' first positions from their links' centres of mass in the neutral pose, at the best yaw."""
    k = model.kinematics
    poses = k.forward(np.zeros((1, len(k.joints))))
    rows = [i for i, asset in enumerate(tracks.assets) if asset in model.rigid_bodies and tracks.seen[i].any()]
    links = [model.rigid_bodies[tracks.assets[i]] for i in rows]
    nominal = np.array([poses[link][0][0] + poses[link][1][0] @ k.centers[link] for link in links])
    found = np.array([tracks.p[i, np.argmax(tracks.seen[i])] for i in rows])
    nominal, found = nominal - nominal.mean(axis=0), found - found.mean(axis=0)
    a, b = nominal[:, 0] + 1j * nominal[:, 1], found[:, 0] + 1j * found[:, 1]
    across = np.abs(b - a * np.exp(1j * np.angle(np.vdot(a, b))))
    return float(np.sqrt(np.mean(across**2 + (found[:, 2] - nominal[:, 2]) ** 2)))


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

