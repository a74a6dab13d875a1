"""Estimates the time of the first command, to a fraction of a frame, by aligning measured joints with predicted ones around their
first motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.recording.mocap.yaw import weighted_median
from workbench.recording.take import Take
from workbench.types import Array

_LAG = 45.0
"""Natural frequency [rad/s] of the second-order lag that replaces a servo if nothing was simulated."""
_BEFORE, _AFTER = 0.05, 0.25  # [s] window around a joint's first motion
_FINE = 0.06  # [s] largest difference of a joint from the common start
_LEAST = np.deg2rad(1.0)  # joints that move less in their window are not used
_STAYS = 0.05  # [s] least time away from rest of a joint that has begun to move
_FIRST = 0.08  # [s] largest difference of the start from the joints' first motions: some joints start late
_ASTRAY = 0.03  # [s] largest difference from the joints' first motions at which their speeds can be as predicted


@dataclass(frozen=True)
class StartEstimate:
    """time: of the first command on the recording's clock [s]. sigma [s]: of the median, from the spread over joints.
    by_joint: estimate from each joint alone [s]."""

    time: float
    sigma: float
    by_joint: dict[str, float]


def lagged_reference(commands: Commands) -> Take:
    """A substitute for a simulated take, at 1 kHz from 0.3 s before the first command: the servos' reference passed through a
    critically damped second-order lag."""
    time = np.arange(-0.3, commands.end + 0.5, 1e-3)
    keep = np.exp(-_LAG * 1e-3)
    recursion = np.array([np.ones(len(time)), np.full(len(time), -keep)])  # q[k] - keep q[k-1] is the new share of the goal
    q = commands.reference(time)
    from scipy.linalg import solve_banded  # slow to import, and for captures alone

    for _ in range(2):
        q = np.asarray(solve_banded((1, 0), recursion, (1 - keep) * q))
    return Take(name="reference", source="reference", time=time, joints=commands.joints, q=q, starts_at=0.0,
                zeroed=True, commands=commands)


def find_start(time: Array, joints: tuple[str, ...], q: Array, noise: Array, predicted: Take) -> StartEstimate:
    """Aligns each measured joint q (N, n) [rad] (zero at rest, unless a marker frame is turned) at `time` (N,) with `predicted`
    (zeroed, 0 = first command).

    First all joints together on a coarse grid of starts, each joint's misfit bounded, so that none decides alone; then each joint
    on its own around its first motion, to a fraction of a frame; then the median over joints, weighted by the precision of each
    (a bad joint, or one that starts late, moves a mean by milliseconds, the median hardly). If that is far from the time at which
    joints leave rest, they do not move at the predicted speeds, and the time of leaving rest is used instead.
    """
    q = q - _initial_angles(time, q, noise)
    columns = [(i, predicted.column(j)) for i, j in enumerate(joints) if j in predicted.joints]
    shift = predicted.starts_at
    tp = predicted.time - (0.0 if np.isnan(shift) else shift)
    moving = [(i, c, onset) for i, c in columns if (onset := _onset(tp, predicted.q[:, c])) is not None]
    moving = [m for m in moving if np.isfinite(q[:, m[0]]).sum() > 10]
    if not moving:
        raise InputError(predicted.name, "start: no joint that was seen is moved by the commands; give starts_at")
    setting_out = _setting_out(time, q, tp, predicted.q, [(i, c) for i, c, _ in moving])
    coarse = _coarse(time, q, tp, predicted.q, moving, setting_out)
    starts, weights, names = [], [], []
    for i, c, onset in moving:
        fine = _fine(time, q[:, i], tp, predicted.q[:, c], onset, coarse, max(float(noise[i]), 1e-5))
        if fine is not None:
            starts.append(fine[0])
            weights.append(fine[1])
            names.append(joints[i])
    if not starts:
        return StartEstimate(*(setting_out or (coarse, _FINE / 2)), {})
    s, w = np.array(starts), np.sqrt(np.array(weights))
    middle = weighted_median(s, w)
    if setting_out is not None and abs(middle - setting_out[0]) > _ASTRAY + setting_out[1]:
        return StartEstimate(*setting_out, dict(zip(names, starts)))
    spread = 1.4826 * weighted_median(np.abs(s - middle), w)
    effective = float(w.sum() ** 2 / np.sum(w**2))
    step = float(np.median(np.diff(tp)))  # simulated commands take effect at whole steps
    sigma = float(np.hypot(max(1.25 * spread / np.sqrt(effective), float(np.sum(w**2) ** -0.5)), step / 2))
    return StartEstimate(middle, sigma, dict(zip(names, starts)))


def _initial_angles(time: Array, q: Array, noise: Array) -> Array:
    """Angles of joints q (N, n) in the first frames (n,), if clearly not zero because a body's marker frame is turned. Zero for
    joints that are already moving, or unseen."""
    first = q[time < time[0] + _STAYS]
    half, out = len(first) // 2, np.zeros(q.shape[1])
    for c in np.flatnonzero(np.isfinite(noise)):
        before, after = (part[np.isfinite(part)] for part in (first[:half, c], first[half:, c]))
        if len(before) and len(after) and abs(np.median(after) - np.median(before)) < 2 * noise[c]:
            stands = float(np.median([*before, *after]))
            out[c] = stands if abs(stands) > 2 * noise[c] else 0.0
    return out


def _onset(t: Array, q: Array) -> float | None:
    """When the predicted joint first leaves rest, if it then moves enough to be distinguished from noise."""
    away = np.flatnonzero((np.abs(q) > 0.2 * _LEAST) & (t >= 0))
    if not len(away):
        return None
    start = float(t[away[0]])
    window = (t >= start - _BEFORE) & (t <= start + _AFTER)
    return start if np.ptp(q[window]) > _LEAST else None


def _coarse(time: Array, q: Array, tp: Array, qp: Array, moving: list[tuple[int, int, float]],
            setting_out: tuple[float, float] | None) -> float:
    """Start [s] on the grid of frames at which most joints agree over the first second of motion. It must be close to the time at
    which joints leave rest, if that is seen, because a robot at rest at the end looks like one that has not begun."""
    step = float(np.median(np.diff(time)))
    horizon = min(1.0 + min(onset for *_, onset in moving), float(tp[-1]))
    candidates = np.arange(time[0], max(time[-1] - 0.3 * horizon, time[0] + step), step)
    if setting_out is not None:
        near = np.abs(candidates - setting_out[0]) < _FIRST
        candidates = candidates[near] if near.any() else candidates
    offsets = np.arange(-0.2, horizon, 2 * step)
    total = np.zeros(len(candidates))
    for i, c, _ in moving:
        good = np.isfinite(q[:, i])
        track = np.interp(time, time[good], q[good, i])
        model = np.interp(offsets, tp, qp[:, c], left=0.0)
        # before the recording the robot stood still
        seen = np.interp(candidates[:, None] + offsets, time, track, left=0.0, right=np.nan)
        error = np.nanmean(np.square(seen - model), axis=1) / max(float(np.mean(np.square(model))), _LEAST**2)
        total += np.minimum(np.nan_to_num(error, nan=1.0), 1.0)
    return float(candidates[np.argmin(total)])


def _setting_out(time: Array, q: Array, tp: Array, qp: Array, pairs: list[tuple[int, int]]) -> tuple[float, float] | None:
    """Start [s] and its uncertainty [s] from the times at which joints leave rest, recorded (columns q) against predicted (qp),
    regardless of their speeds: the median over joints; None if fewer than two (or one, of few) are seen to leave rest."""
    departures = [(_leaves_rest(time, q[:, i]), _leaves_rest(tp, qp[:, c])) for i, c in pairs]
    late = np.array([seen - commanded for seen, commanded in departures if seen is not None and commanded is not None])
    if len(late) < min(2, len(pairs)):
        return None
    middle = float(np.median(late))
    return middle, float(1.4826 * np.median(np.abs(late - middle)) / np.sqrt(len(late)) + np.median(np.diff(time)) / 2)


def _leaves_rest(t: Array, q: Array) -> float | None:
    """When a joint q (N,) leaves rest for good: where a line through its first degrees meets the rest position. None if it does
    not, or was never at rest before."""
    frames = max(1, round(_STAYS / float(np.median(np.diff(t)))))
    away = np.abs(np.nan_to_num(q)) > _LEAST
    stays = np.convolve(away, np.ones(frames), mode="valid") == frames
    at = int(np.argmax(stays))
    if not stays.any() or at < frames:
        return None
    way = np.abs(q[at:at + 2 * frames]) * (np.sign(q[at:at + 2 * frames]) == np.sign(q[at]))
    past = np.flatnonzero(way > 3 * _LEAST)
    rows = slice(at, at + max(3, int(past[0]) + 1 if len(past) else 2 * frames))
    seen = np.isfinite(q[rows])
    rise, first = np.polyfit(t[rows][seen] - t[at], np.abs(q[rows][seen]), 1) if seen.sum() > 2 else (0.0, 0.0)
    return float(t[at] - first / rise) if rise > 0 else float(t[at])


def _fine(time: Array, q: Array, tp: Array, qp: Array, onset: float, coarse: float, noise: float) -> tuple[float, float] | None:
    """Start [s] estimated from one joint, and its weight 1/variance [1/s^2]: least squares over the shift by Gauss-Newton."""
    slope = np.gradient(qp, tp)
    start = coarse
    for window in (_FINE, 0.03, 0.02, 0.02):
        use = (time >= start + onset - _BEFORE - window) & (time <= start + onset + _AFTER) & np.isfinite(q)
        if use.sum() < 8:
            return None
        at = time[use] - start
        g = -np.interp(at, tp, slope)
        sharpness = float(g @ g)
        if sharpness <= 0:
            return None
        move = float(g @ (q[use] - np.interp(at, tp, qp)) / sharpness)
        start += float(np.clip(move, -_FINE / 2, _FINE / 2))
    if abs(start - coarse) > _FINE:
        return None
    left = q[use] - np.interp(time[use] - start, tp, qp)
    variance = max(noise**2, float(np.mean(np.square(left))))  # a joint that the model fits badly weighs less
    return start, sharpness / variance
