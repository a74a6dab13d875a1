"""Orientations of a run's bodies, and each joint's angle between two of them, in compiled passes over all frames."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from workbench.simulation.compiled.arrays import Array, Ints
from workbench.simulation.compiled.kernel import kernel
from workbench.simulation.compiled.vectors import quat_inverse, quat_of_vector, quat_product, quat_unit, rotation_vector


class Resampling(NamedTuple):
    """Where new times are between old rows. row, following (M,): the rows before and after; share (M,): of the way between them,
    NaN for times outside."""

    row: Ints
    following: Ints
    share: Array

    def linear(self, values: Array) -> Array:
        """Values (N, ...) at the new times."""
        before = values[self.row]
        share = self.share.reshape(-1, *(1,) * (values.ndim - 1))
        return np.asarray(before + share * (values[self.following] - before))


def resampling(time: Array, wanted: Array) -> Resampling:
    """From rows at `time` (N,), increasing, to the times `wanted` (M,)."""
    row = np.clip(np.searchsorted(time, wanted, side="right") - 1, 0, len(time) - 1)
    following = np.minimum(row + 1, len(time) - 1)
    length = time[following] - time[row]
    share = np.divide(wanted - time[row], length, out=np.zeros(len(wanted)), where=length > 0.0)
    return Resampling(row, following, np.where((wanted < time[0]) | (wanted > time[-1]), np.nan, share))


@kernel
def body_turns(parent: Ints, fixed: Array, axis: Array, q: Array, root: Array, body: Ints, room: Array, out: Array) -> None:
    """Orientations out (N, b, 4) in W of bodies `body` (b,), numbered by their joint, the root last.

    parent (n,); fixed (n, 4): the joint's frame in its carrier's; axis (n, 3); q (N, n) [rad]; root (N, 4); room (n + 1, 4)."""
    n = parent.shape[0]
    for k in range(q.shape[0]):
        room[n, 0], room[n, 1], room[n, 2], room[n, 3] = root[k, 0], root[k, 1], root[k, 2], root[k, 3]
        for i in range(n):
            a = parent[i] if parent[i] >= 0 else n
            s, c = math.sin(0.5 * q[k, i]), math.cos(0.5 * q[k, i])
            frame = quat_product((room[a, 0], room[a, 1], room[a, 2], room[a, 3]),
                                 (fixed[i, 0], fixed[i, 1], fixed[i, 2], fixed[i, 3]))
            w, x, y, z = quat_unit(quat_product(frame, (c, s * axis[i, 0], s * axis[i, 1], s * axis[i, 2])))
            room[i, 0], room[i, 1], room[i, 2], room[i, 3] = w, x, y, z
        for b in range(body.shape[0]):
            for r in range(4):
                out[k, b, r] = room[body[b], r]


@kernel
def turn_between(quats: Array, row: Ints, following: Ints, share: Array, out: Array) -> None:
    """Orientations quats (N, b, 4) at other times, out (M, b, 4), by the shortest turn at an even rate between two rows."""
    for k in range(row.shape[0]):
        for b in range(quats.shape[1]):
            p, q = quats[row[k], b], quats[following[k], b]
            before, after = (p[0], p[1], p[2], p[3]), (q[0], q[1], q[2], q[3])
            x, y, z = rotation_vector(quat_product(quat_inverse(before), after))
            w, x, y, z = quat_product(before, quat_of_vector(share[k] * x, share[k] * y, share[k] * z))
            out[k, b, 0], out[k, b, 1], out[k, b, 2], out[k, b, 3] = w, x, y, z


@kernel
def joint_turns(turns: Array, rest: Array, frame: Array, parent: Ints, child: Ints, axis: Array, out: Array) -> None:
    """Each joint's angle and its rotation vector across the axis, out (N, j, 4) [rad], as cameras tell them from bodies.

    turns (N, b, 4), rest (b, 4): bodies' orientations, and those at rest; frame (b, 4): an extra turn of each asset's frame in
    its own axes; parent, child (j,): bodies on either side, parent -1 where that is a base which stands still; axis (j, 3)."""
    for k in range(turns.shape[0]):
        for j in range(child.shape[0]):
            relative = (1.0, 0.0, 0.0, 0.0)
            for b in (parent[j], child[j]):
                if b >= 0:
                    now, was = turns[k, b], rest[b]
                    turn = quat_product((now[0], now[1], now[2], now[3]), (was[0], -was[1], -was[2], -was[3]))
                    turn = quat_product(turn, (frame[b, 0], frame[b, 1], frame[b, 2], frame[b, 3]))
                    relative = quat_product(quat_inverse(relative), turn)
            w, x, y, z = relative
            angle = 2.0 * math.atan2(x * axis[j, 0] + y * axis[j, 1] + z * axis[j, 2], w)
            angle -= 2.0 * math.pi * math.floor(0.5 * (angle / math.pi + 1.0))
            s, c = math.sin(0.5 * angle), math.cos(0.5 * angle)
            out[k, j, 0] = angle
            back = (c, -s * axis[j, 0], -s * axis[j, 1], -s * axis[j, 2])
            out[k, j, 1], out[k, j, 2], out[k, j, 3] = rotation_vector(quat_product(relative, back))


def compile_turns() -> None:
    """Compiles these passes, unless this machine keeps them for this checkout: of one body at one frame."""
    first, level, out = np.zeros(1, np.int64), np.array([[[1.0, 0.0, 0.0, 0.0]]]), np.empty((1, 1, 4))
    axis = np.zeros((1, 3))
    body_turns(first - 1, level[0], axis, np.zeros((1, 1)), level[0], first, np.empty((2, 4)), out)
    turn_between(level, first, first, np.zeros(1), out)
    joint_turns(level, level[0], level[0], first - 1, first, axis, out)
