"""What tables of motion capture systems have in common: axes, rotations, and rigid bodies formed of markers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.files.listing import list_names
from workbench.recording import quaternions as quat
from workbench.recording.body_track import BodyTrack
from workbench.recording.formats.log_commands import order_problem
from workbench.recording.formats.numbers import rate_of
from workbench.recording.recording import Recording
from workbench.types import Array, Mask

METRES = {"m": 1.0, "meters": 1.0, "metres": 1.0, "cm": 0.01, "mm": 1e-3, "millimeters": 1e-3, "millimetres": 1e-3}
_FEWEST = 3
"""Least number of markers of a rigid body."""
_THIN = 0.05
"""A body whose markers lie on a line, to this share of its length, has no rotation about it."""
_SLOWEST, _FARTHEST = 0.5, 20.0
"""Frames this far apart [s], or positions this far from each other [m], cannot come from a small robot in a room."""

_FASTEST = 1e-4
"""The fastest cameras take a frame in 0.5 ms [s]."""
_AXES: tuple[Literal["x", "y", "z"], ...] = ("x", "y", "z")
_HALF_TURN = 0.97
"""Least component of a quaternion that is half a turn about an axis, to 28 deg."""
_LOST = 1.5
"""A step of more than so many usual ones lost a frame."""
_OFF, _STEADY = 0.3, 0.95
"""Of a steady clock's frames, this share lies closer to it than `_OFF` periods."""


@dataclass(frozen=True)
class Capture:
    """Content of a capture system's file. time: (N,) [s]. bodies: name -> (p (N, 3) [m], quat (N, 4) wxyz). markers: name ->
    (N, 3) [m]. up: which axis of the file is up, "y" or "z"; with z up, x and y are level."""

    time: Array
    bodies: Mapping[str, tuple[Array, Array]]
    markers: Mapping[str, Array]
    up: str = "z"
    version: str = ""
    units: str = "m"
    problems: tuple[str, ...] = ()


def recording_of(source: str, kind: str, capture: Capture) -> Recording:
    """The recording of a capture in the axes of recordings (y up); without rigid bodies, bodies are formed from its markers'
    names. InputError if its times do not increase."""
    time = capture.time
    if len(time) < 2:
        raise InputError(source, f"{len(time)} frame(s); expected two or more")
    if (problem := order_problem(time)) is not None:
        raise InputError(source, f"frame {problem.row + 1}: {problem.text}")
    frames, rate = _frames(source, time)
    markers = {name: _y_up(p) if capture.up == "z" else p for name, p in capture.markers.items()}
    bodies = {name: BodyTrack(p, q) for name, (p, q) in capture.bodies.items()}
    if capture.up == "z":
        bodies = {name: BodyTrack(_y_up(b.p), np.concatenate([b.quat[:, :1], _y_up(b.quat[:, 1:])], axis=1))
                  for name, b in bodies.items()}
    problems = [*capture.problems, *_doubts(capture)]
    unseen = [name for name, p in markers.items() if not np.isfinite(p).all(axis=1).any()]
    if unseen:
        problems.append(f"markers never seen: {list_names(unseen, 6)}")
    if not bodies and markers:
        bodies = bodies_of_markers(markers)
        if bodies:
            problems.append(f"rigid bodies are formed of markers with a common name: {', '.join(bodies)}; each is taken to be "
                            "upright, without a rotation, in the first frame that shows all its markers")
    return Recording(source=source, kind=kind, version=capture.version, time=time - time[0], frames=frames, rate=rate,
                     units=capture.units, rigid_bodies=bodies, markers=markers, problems=tuple(problems), sensing="mocap")


def _frames(source: str, time: Array) -> tuple[NDArray[np.int64], float]:
    """Numbers (N,) and rate [Hz] of frames at `time` (N,) [s], of which some may have been lost; InputError where no steady rate
    explains the times, as cameras have one."""
    rate, steps = rate_of(time), np.diff(time)
    if np.isfinite(rate) and steps.max() < _LOST * np.median(steps):
        return np.arange(len(time)), rate
    period = float(np.median(steps[steps < _LOST * np.percentile(steps, 10)]))
    for _ in range(3):
        frames = np.concatenate([[0], np.cumsum(np.maximum(np.round(steps / period), 1))])
        period, begin = np.polyfit(frames, time, 1)
    off = np.abs(time - begin - frames * period)
    if np.mean(off < _OFF * period) > _STEADY:
        return frames.astype(np.int64), float(1 / period)
    if np.isfinite(rate):
        return np.arange(len(time)), rate
    raise InputError(source, f"frames are {1e3 * steps.min():.3g} to {1e3 * steps.max():.3g} ms apart, and no steady rate with "
                             "lost frames explains their times; expected the camera's own times, or poses interpolated to a "
                             "steady rate")


def _doubts(capture: Capture) -> list[str]:
    """Values that cannot come from a small robot in a room: frames too far apart in time or too close, positions too far from
    each other, and quaternions whose components are exchanged."""
    out = []
    apart = float(np.median(np.diff(capture.time)))
    if apart > _SLOWEST:
        out.append(f"time: frames are {apart:g} apart: are the times frame numbers or milliseconds? (seconds are expected)")
    elif apart < _FASTEST:
        out.append(f"time: frames are {apart:.3g} s apart, faster than cameras are: are the times, or the file's rate, in "
                   "another unit? (seconds and frames per second are expected)")
    seen = [p[np.isfinite(p).all(axis=1)] for p in (*(p for p, _ in capture.bodies.values()), *capture.markers.values())]
    places = np.concatenate([p for p in seen if len(p)]) if any(map(len, seen)) else np.zeros((1, 3))
    if (size := float(np.ptp(places, axis=0).max())) > _FARTHEST:
        out.append(f"positions are up to {size:.4g} m apart: are they in millimetres? (expected: metres, or columns BODY.x_mm)")
    axis = half_turned([q for _, q in capture.bodies.values()])
    if axis == "z":
        out.append("every body starts half a turn about z from neutral (qw near 0, qz near 1): are the quaternions written "
                   "x, y, z, w?")
    elif axis is not None:
        out.append(f"every body starts half a turn about {axis} from neutral (qw near 0, q{axis} near 1): are the columns of the "
                   "quaternions exchanged?")
    return out


def half_turned(quats: Sequence[Array]) -> Literal["x", "y", "z"] | None:
    """The axis about which all bodies begin half a turn from no rotation, by their quaternions (N, 4) wxyz; None if they do
    not."""
    first = [q[seen][0] for q in quats if (seen := np.isfinite(q).all(axis=1)).any()]
    for axis in _AXES if first else ():
        if all(abs(float(q[1 + _AXES.index(axis)])) > _HALF_TURN for q in first):
            return axis
    return None


def _y_up(v: Array) -> Array:
    """(N, 3) of x, y, z with z up as x, z, -y: y up."""
    return np.stack([v[:, 0], v[:, 2], -v[:, 1]], axis=1)


def bodies_of_markers(markers: Mapping[str, Array]) -> dict[str, BodyTrack]:
    """Rigid bodies of markers (N, 3) [m] that are called BODY_1, BODY:top, BODY.front and so on, three of each at least that
    were ever seen, and not on a line. A body's pivot is the middle of its markers; its rotation is none in the first frame that
    shows them all."""
    groups: dict[str, list[str]] = {}
    for name in (n for n, p in markers.items() if np.isfinite(p).all(axis=1).any()):
        found = re.fullmatch(r"(.+?)(?:[:._\- ][^:._\- ]+|\d+)", name)
        if found:
            groups.setdefault(found.group(1), []).append(name)
    out = {}
    for body, names in groups.items():
        at = np.stack([markers[n] for n in names], axis=1)  # (N, M, 3)
        whole = np.flatnonzero(np.isfinite(at).all(axis=(1, 2)))
        if len(names) < _FEWEST or not len(whole):
            continue
        shape = at[whole[0]] - at[whole[0]].mean(axis=0)
        sizes = np.linalg.svd(shape, compute_uv=False)
        if sizes[1] < _THIN * sizes[0]:
            continue
        out[body] = _fit_body(at, shape)
    return out


def _fit_body(at: Array, shape: Array) -> BodyTrack:
    """The path of a body whose markers (M, 3) [m] about their middle are seen at (N, M, 3): least squares, in frames that show
    three of them at least."""
    p, q = np.full((len(at), 3), np.nan), np.full((len(at), 4), np.nan)
    seen: Mask = np.asarray(np.isfinite(at).all(axis=2))
    for k in np.flatnonzero(seen.sum(axis=1) >= _FEWEST):
        a, b = shape[seen[k]], at[k][seen[k]]
        u, _, vt = np.linalg.svd((a - a.mean(axis=0)).T @ (b - b.mean(axis=0)))
        turn = (vt.T * np.array([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T)) or 1.0])) @ u.T
        p[k] = b.mean(axis=0) - turn @ a.mean(axis=0)
        q[k] = quat.from_matrix(turn[None])[0]
    good = np.isfinite(q).all(axis=1)
    if good.any():
        q[good] = quat.continuous(q[good])[0]
    return BodyTrack(p, q)


def rotations(source: str, body: str, R: Array, line: int) -> Array:
    """Quaternions (N, 4) wxyz of rotation matrices (N, 3, 3), NaN where a matrix is zero or blank; InputError names the `body`
    and the line of the first that is no rotation. line: of the file's first frame."""
    seen = np.isfinite(R).all(axis=(1, 2)) & (np.abs(R).sum(axis=(1, 2)) > 0)
    off = np.abs(np.einsum("nij,nkj->nik", R, R) - np.eye(3)).max(axis=(1, 2)) > 0.02
    bad = np.flatnonzero(seen & (off | ~(np.linalg.det(np.where(seen[:, None, None], R, np.eye(3))) > 0)))
    if len(bad):
        raise InputError(source, f"line {bad[0] + line}: the nine numbers of '{body}' are no rotation matrix; expected 6D data "
                                 "as the capture system exports it")
    out = np.full((len(R), 4), np.nan)
    out[seen] = quat.from_matrix(R[seen])
    return out
