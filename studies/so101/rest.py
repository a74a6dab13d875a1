"""Each joint at rest: the remaining error by approach and load, and the reading of the current register."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.so101.response import DRAWS, Value
from studies.so101.rows import Rows
from workbench.recording.formats.sage import JOINTS
from workbench.types import Array

LEAST_HOLDS = 5


@dataclass(frozen=True)
class Holds:
    """Stretches in which a joint stood under a goal that stood, one row each. of: index of the programme; error: goal less
    position [rad]; load: size of gravity's torque on the joint [N m]; approach: 1 or -1, where the goal came from below or above.
    """

    of: NDArray[np.int_]
    error: Array
    load: Array
    approach: Array


def holds(joint: str, rows: Sequence[Rows]) -> Holds:
    """All holds of a joint whose goal has moved before."""
    i = JOINTS.index(joint)
    found = []
    for k, r in enumerate(rows):
        goal = r.of.sent[r.frame, i]
        still = r.standing[:, i] & (np.abs(np.diff(goal, prepend=np.nan)) < 1e-9) & (r.approach[:, i] != 0)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
        for a, b in zip(edges[::2], edges[1::2]):
            s = slice(a, b)
            found.append((k, np.mean(r.error(i)[s]), np.mean(np.abs(r.gravity[s, i])), r.approach[a, i]))
    k, error, load, approach = np.array(found).reshape(-1, 4).T
    return Holds(k.astype(int), error, load, approach)


@dataclass(frozen=True)
class NamePosterior:
    """One joint at rest. up, down: mean error after the goal rose or fell [rad]; width: half their distance [rad]; load: mean
    size of gravity's torque [N m]; over so many holds."""

    joint: str
    up: Value
    down: Value
    width: Value
    load: float
    count: int


def standing(joint: str, rows: Sequence[Rows], seed: int = 0) -> NamePosterior | None:
    """Errors at rest of one joint; None where it hardly ever stood."""
    h = holds(joint, rows)
    if min((h.approach > 0).sum(), (h.approach < 0).sum()) < LEAST_HOLDS:
        return None
    rng = np.random.default_rng(seed)
    drawn = []
    programmes = np.unique(h.of)
    while len(drawn) < DRAWS:
        picked = np.concatenate([np.flatnonzero(h.of == k) for k in rng.choice(programmes, len(programmes))])
        if len(np.unique(h.approach[picked])) == 2:
            drawn.append(_levels(h, picked))
    low, high = np.quantile(drawn, [0.05, 0.95], axis=0)
    up, down, width = (Value(*map(float, v)) for v in zip(_levels(h, np.arange(len(h.error))), low, high))
    return NamePosterior(joint, up, down, width, float(h.load.mean()), len(h.error))


def _levels(h: Holds, use: NDArray[np.int_]) -> tuple[float, float, float]:
    e, s = h.error[use], h.approach[use]
    up, down = float(e[s > 0].mean()), float(e[s < 0].mean())
    return up, down, (up - down) / 2


@dataclass(frozen=True)
class Current:
    """The register against the error of joints that stand: register = scale · |error|^power over errors beyond `least` [rad]."""

    joint: str
    power: Value
    scale: Value
    count: int


def current(joint: str, rows: Sequence[Rows], least: float = np.radians(1.5), seed: int = 0) -> Current | None:
    """By a straight line through logarithms; scale [register/rad²] at power 2. None where the joint hardly ever stood loaded."""
    i = JOINTS.index(joint)
    parts = []
    for r in rows:
        e = np.abs(r.error(i))
        use = r.standing[:, i] & (e > least) & (r.of.register[r.frame, i] > 0)
        parts.append(np.column_stack([np.log(e[use]), np.log(r.of.register[r.frame[use], i])]))
    parts = [p for p in parts if len(p) > 20]
    if sum(map(len, parts)) < 200 or len(parts) < 3:
        return None
    rng = np.random.default_rng(seed)
    drawn = [_power(np.concatenate([parts[k] for k in rng.integers(0, len(parts), len(parts))])) for _ in range(DRAWS)]
    whole = np.concatenate(parts)
    low, high = np.quantile(drawn, [0.05, 0.95], axis=0)
    power, scale = (Value(*map(float, v)) for v in zip(_power(whole), low, high))
    return Current(joint, power, scale, len(whole))


def _power(xy: Array) -> tuple[float, float]:
    slope = float(np.polyfit(xy[:, 0], xy[:, 1], 1)[0])
    return slope, float(np.exp(np.median(xy[:, 1] - 2 * xy[:, 0])))


@dataclass(frozen=True)
class Fastest:
    """How fast a joint was asked to go and went over some programmes [rad/s of the servo], and the share of its moving frames in
    which it stood at that most."""

    joint: str
    asked: float
    went: float
    share: float


def fastest(joint: str, rows: Sequence[Rows], scale: float = 1.0) -> Fastest:
    """scale: servo angle per recorded unit (the jaw's range)."""
    i = JOINTS.index(joint)
    asked = max(float(np.abs(np.diff(r.of.sent[:, i])).max() / r.of.period) for r in rows) * scale
    speed = np.concatenate([np.abs(r.of.speed[:, i]) for r in rows])
    went = float(speed.max())
    return Fastest(joint, asked, went, float(np.mean(speed[speed > 0] > 0.97 * went)))
