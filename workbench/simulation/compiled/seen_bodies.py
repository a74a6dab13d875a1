"""Bodies of a compiled run at the frames of a recording, without a take in between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RotationMatrix

from workbench.recording import quaternions as quat
from workbench.simulation.compiled.arrays import Array, Ints, Log
from workbench.simulation.compiled.station import CompiledJob
from workbench.simulation.compiled.structures import tables_of
from workbench.simulation.compiled.tables import NotCoveredError
from workbench.simulation.compiled.turns import Resampling, body_turns, resampling, turn_between

RESTING = -1e-9
"""Times before this are before the first command [s]."""


@dataclass(frozen=True)
class SeenBodies:
    """A run at N frames; `_rest`: its mean at rest before the first command. q (N, m) [rad]: of the joints, as servos turn them;
    p_WB (N, 3) [m], quat_WB (N, 4): of the base; turns (N, b, 4): orientations in W of the bodies that carry the requested
    links, in the frame of their joint. NaN after the run's end."""

    q: Array
    q_rest: Array
    p_WB: Array
    p_rest: Array
    quat_WB: Array
    quat_rest: Array
    turns: Array
    turns_rest: Array


@dataclass(frozen=True)
class _Frames:
    """From rows of a log to the times of a job, and from these to frames; resting (T,): times before the first command."""

    to_times: Resampling
    to_frames: Resampling
    resting: np.ndarray


def seen_bodies(compiled: CompiledJob, log: Log, links: Sequence[str], frames: Array) -> SeenBodies:
    """The bodies of `links` at `frames` (N,) [s] after the first command, from the log of a job, first at the job's `times`, as a
    take of that job has them. NotCoveredError where the robot's build differs from its model's in an unknown way."""
    reading = _reading(compiled, len(log.q), frames)
    joint = compiled.machine.servos.joint
    body = _carriers(compiled, links)
    if not compiled.between and not _as_in_the_file(compiled):
        raise NotCoveredError("an effect that turns links in the description")
    if compiled.free:
        p, root = log.base[:, 4:], log.base[:, :4]
        quat_WB, quat_rest = _turned_at(root[:, None], reading)
        quat_WB, quat_rest = quat_WB[:, 0], quat_rest[0]
    else:
        p = np.tile(compiled.tables.X_WBase.translation(), (len(log.q), 1))
        quat_rest = RotationMatrix(compiled.tables.X_WBase.rotation()).ToQuaternion().wxyz()
        quat_WB = np.where(np.isnan(reading.to_frames.share)[:, None], np.nan, quat_rest)
    q, q_rest = _mean_at(log.q, reading)
    p_WB, p_rest = _mean_at(p, reading)
    if compiled.between:  # orientations are interpolated, as those of a take's links are
        turns, turns_rest = _turned_at(_turns(compiled, log.q, _roots(compiled, log.base), body), reading)
    else:
        roots = np.vstack([quat_WB, quat_rest]) if compiled.free else _roots(compiled, q, 1)
        both = _turns(compiled, np.vstack([q, q_rest]), roots, body)
        turns, turns_rest = both[:-1], both[-1]
    return SeenBodies(q[:, joint], q_rest[joint], p_WB, p_rest, quat_WB, quat_rest, turns, turns_rest)


def _reading(compiled: CompiledJob, rows: int, frames: Array) -> _Frames:
    times = compiled.job.times
    assert times is not None
    resting = times < RESTING
    time = np.asarray(np.arange(rows) * compiled.config.logged_every - compiled.plan.lead, float)
    return _Frames(resampling(time, times),
                   resampling(times, np.maximum(frames, times[0])), resting if resting.any() else np.arange(len(times)) == 0)


def _carriers(compiled: CompiledJob, links: Sequence[str]) -> Ints:
    """Numbers of the bodies of which links are part."""
    n = len(compiled.tables.joints)
    number = {link.link: link.body if link.body >= 0 else n for link in compiled.tables.links}
    return np.array([number[link] for link in links], dtype=np.int64)


def _as_in_the_file(compiled: CompiledJob) -> bool:
    """Whether joints are where the model's own file has them: cameras look through the model's kinematics."""
    if compiled.physics.build is None:
        return True
    own, changed = tables_of(compiled.model, None, compiled.free).tree, compiled.tables.tree
    return all(np.array_equal(getattr(own, name), getattr(changed, name)) for name in ("parent", "R", "axis"))


def _mean_at(values: Array, reading: _Frames) -> tuple[Array, Array]:
    """Values (rows, c) of a log at the frames, and their mean at rest."""
    at_times = reading.to_times.linear(values)
    return reading.to_frames.linear(at_times), at_times[reading.resting].mean(axis=0)


def _turned_at(turns: Array, reading: _Frames) -> tuple[Array, Array]:
    """Orientations (rows, b, 4) of a log at the frames (N, b, 4), and their mean at rest (b, 4)."""
    at_times = _between(turns, reading.to_times)
    rest = np.array([quat.mean(at_times[reading.resting, b]) for b in range(turns.shape[1])])
    return _between(at_times, reading.to_frames), rest.reshape(-1, 4)


def _between(turns: Array, r: Resampling) -> Array:
    out = np.empty((len(r.row), *turns.shape[1:]))
    turn_between(np.ascontiguousarray(turns), r.row, r.following, r.share, out)
    return out


def _turns(compiled: CompiledJob, q: Array, root: Array, body: Ints) -> Array:
    tree = compiled.tables.tree
    out, n = np.empty((len(q), len(body), 4)), len(tree.parent)
    body_turns(tree.parent, quat.from_matrix(tree.R), tree.axis, np.ascontiguousarray(q), np.ascontiguousarray(root), body,
               np.empty((n + 1, 4)), out)
    return out


def _roots(compiled: CompiledJob, rows: Array, more: int = 0) -> Array:
    """Orientation of the root, (rows + more, 4): of a free base its own; a held robot's root is the world."""
    return rows[:, :4] if compiled.free else np.tile([1.0, 0.0, 0.0, 0.0], (len(rows) + more, 1))
