"""Finds errors of motion capture and repairs them where possible: sign flips, exchanged labels, spikes, gaps."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from workbench.cache import Cache
from workbench.files.problem import RoutineProblem
from workbench.recording import quaternions as quat
from workbench.recording.mocap.conventions import conventional
from workbench.recording.mocap.exchanged_axes import exchanged_components
from workbench.recording.mocap.swaps import unswap
from workbench.recording.mocap.tracks import Tracks, tracks_of
from workbench.recording.mocap.unseen import without_unseen
from workbench.recording.recording import Recording
from workbench.robot import RobotModel
from workbench.types import Array, Mask

LONGEST_MENDED = 0.05
"""Gaps up to this long [s] are filled. In longer ones a walking servo can start and stop, so they stay open."""
_SPIKE = 0.06
_ARM = 0.1  # [m] arm at which a rotation counts as a distance
KEPT, LONGEST_KEPT = 4, 100_000
"""Number of repaired recordings that are kept, and the most poses of each: 10 MB."""
_repaired: Cache[Tracks] = Cache(KEPT)


def repaired(recording: Recording, model: RobotModel | None) -> Tracks:
    """The recording's tracks, repaired by `mend`. Those of the last recordings are kept: a session's are asked for when it is
    checked, at each registration, and as takes."""
    def mended() -> Tracks:
        return mend(tracks_of(recording), model)

    if len(recording.time) * len(recording.rigid_bodies) > LONGEST_KEPT:
        return mended()
    known = () if model is None else (id(model.kinematics), *model.rigid_bodies.items())
    return _repaired.get((id(recording), *known), mended, (recording, model))


def mend(tracks: Tracks, model: RobotModel | None = None) -> Tracks:
    """Blanks poses that were not seen, corrects lengths and axes, undoes sign flips, restores exchanged labels, removes isolated
    spikes, and fills gaps up to LONGEST_MENDED (positions linearly, rotations by slerp). Everything is reported in `problems`;
    `model` allows lengths, axes and exchanged labels to be checked against the robot's tree."""
    tracks = without_unseen(tracks)
    if model is not None:
        tracks = conventional(tracks, model)
        if (text := exchanged_components(tracks, model)) is not None:
            tracks = replace(tracks, problems=(*tracks.problems, text))
    tracks = _continuous_signs(tracks)
    tracks = unswap(tracks, model)
    tracks = _without_spikes(tracks)
    return _fill(tracks)


def survey(recording: Recording) -> tuple[str, ...]:
    """The problems that `mend` finds in a recording, one line each, without a model; for markers, how much of each is unseen."""
    if recording.rigid_bodies:
        return mend(tracks_of(recording)).problems
    unseen = {name: int(np.isnan(p).any(axis=1).sum()) for name, p in recording.markers.items()}
    return tuple(f"{name}: {n} of {len(recording.time)} frames unseen" for name, n in unseen.items() if n)


def _continuous_signs(tracks: Tracks) -> Tracks:
    q, problems = tracks.q.copy(), list(tracks.problems)
    for i, asset in enumerate(tracks.assets):
        q[i], flips = quat.continuous(q[i])
        if flips:
            problems.append(f"{asset}: quaternion changed its sign {flips} time(s); undone")
    return replace(tracks, q=q, problems=tuple(problems))


def distance(p: Array, q: Array, p2: Array, q2: Array) -> Array:
    """Distance between two poses [m], with their rotation taken at an arm of 0.1 m."""
    return np.asarray(np.linalg.norm(p - p2, axis=-1) + _ARM * quat.angle_between(q, q2))


def _without_spikes(tracks: Tracks) -> Tracks:
    """Blanks short runs that leap away and back faster than any servo moves a link."""
    p, q, problems = tracks.p.copy(), tracks.q.copy(), list(tracks.problems)
    most = max(1, round(LONGEST_MENDED * tracks.rate))
    for i, asset in enumerate(tracks.assets):
        seen = np.flatnonzero(tracks.seen[i])
        if len(seen) < 3:
            continue
        step = distance(p[i, seen[1:]], q[i, seen[1:]], p[i, seen[:-1]], q[i, seen[:-1]])
        steady = np.diff(seen) <= most
        leaps = np.flatnonzero((step > _SPIKE) & steady)
        lost = 0
        for a, b in pairwise(leaps):
            before, after = seen[a], seen[b + 1]
            back = distance(p[i, before], q[i, before], p[i, after], q[i, after])
            if b - a <= most and back < 0.5 * min(step[a], step[b]):
                bad = seen[a + 1:b + 1]
                p[i, bad], q[i, bad] = np.nan, np.nan
                lost += len(bad)
        if lost:
            problems.append(f"{asset}: {lost} frame(s) leap away and back; taken out")
    return replace(tracks, p=p, q=q, problems=tuple(problems))


def gaps_of(seen: Mask) -> NDArray[np.int_]:
    """Runs of False in a mask (N,): (G, 2), first frame and one past the last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], seen, [True]]).astype(np.int8)))
    return edges.reshape(-1, 2)


def _fill(tracks: Tracks) -> Tracks:
    p, q, reach = tracks.p.copy(), tracks.q.copy(), tracks.seconds_squared.copy()
    mended, problems = tracks.mended.copy(), list(tracks.problems)
    n = len(tracks.time)
    for i, asset in enumerate(tracks.assets):
        gaps = gaps_of(tracks.seen[i])
        if not len(gaps):
            continue
        length = gaps[:, 1] - gaps[:, 0]
        inside = (gaps[:, 0] > 0) & (gaps[:, 1] < n)
        short = inside & (length <= LONGEST_MENDED * tracks.rate + 1e-6)
        for first, end in gaps[short]:
            at = np.arange(first, end)
            a, b = first - 1, end
            span = tracks.time[b] - tracks.time[a]
            f = (tracks.time[at] - tracks.time[a]) / span
            p[i, at] = p[i, a] + f[:, None] * (p[i, b] - p[i, a])
            q[i, at] = quat.interpolate(tracks.time[[a, b]], q[i, [a, b]], tracks.time[at])
            reach[i, at] = f * (1 - f) * span**2
            mended[at] = True
        left = gaps[~short]
        text = f"{asset}: {int(length.sum())} of {n} frames unseen in {len(gaps)} gap(s)"
        if short.any():
            text += f"; {int(short.sum())} filled, up to {int(length[short].max())} frames"
        if len(left):
            worst = left[np.argmax(left[:, 1] - left[:, 0])]
            text += f"; {len(left)} left open, the longest {worst[1] - worst[0]} frames from {tracks.time[worst[0]]:.3f} s"
        problems.append(RoutineProblem(text))
    return replace(tracks, p=p, q=q, seconds_squared=reach, mended=mended, problems=tuple(problems))
