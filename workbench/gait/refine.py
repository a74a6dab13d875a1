"""Gauss-Newton on a gait's joint angles at its poses, with compiled rollouts on several robots as the residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.files.option_checks import check_positive, check_whole
from workbench.gait.evaluate import Candidate, Evaluator
from workbench.gait.limits import allowed_rms
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import GaitMeasure
from workbench.gait.requirements import SLOWEST, drift
from workbench.gait.search import Found, Progress
from workbench.gait.shape import FAMILIES, GaitShape
from workbench.gait.table import paths_of

Array = NDArray[np.float64]

STRAIGHT = ("forward", "backward")
"""Ways whose left and right legs do the same, half a cycle apart or together."""
DAMPING = (1.0, 10.0, 100.0)
"""Weights against long steps that are tried, relative to a change of one radian in each harmonic."""
SHARES = (1.0, 0.5)
"""Of each step that are tried."""
FALLEN = 2.0
"""Each of the residuals of a robot that fell: about the speed's of one that stands still."""
ENOUGH = 1.7
"""Foot clearance by its limit, from which more is not better: draws vary by a third."""


KEPT = 2
"""How many refined gaits become finalists at most."""


@dataclass(frozen=True)
class RefineOptions:
    """Size of the refinement. InputError for a number out of range.

    iterations: Gauss-Newton steps; 0: none. robots: of the ensemble, in addition to the nominal one. harmonics: of the cycle
    in each joint's change, in addition to its mean. probe: change of a harmonic by which its effect is measured [rad]. target:
    speed that is aimed at, by the nominal robot's. speed, heading [by rad/m], slip, clearance, torque: weights of the
    residuals: speed is relative to the nominal robot's; slip and torque count from `near` of their limits on, clearance below
    ENOUGH of its own. cautions: factors of the weights of slip, clearance and torque, one after the other until a gait keeps
    the limits on all robots; parts: of the change that are tried on them.
    """

    iterations: int = 1
    robots: int = 2
    harmonics: int = 2
    probe: float = 0.026
    target: float = 1.3
    speed: float = 1.7
    heading: float = 0.3
    slip: float = 1.0
    clearance: float = 1.0
    torque: float = 3.0
    near: float = 0.85
    cautions: tuple[float, ...] = (1.0, 3.0)
    parts: tuple[float, ...] = (1.0, 0.6, 0.3)

    def __post_init__(self) -> None:
        check_whole(self, iterations=0, robots=0, harmonics=0)
        check_positive(self, "probe", "target", "speed", "heading", "slip", "clearance", "torque", "near")


def refined(evaluator: Evaluator, found: Found, options: RefineOptions, progress: Progress) -> Found:
    """The search's result with its best gait refined, if that is better on all of the evaluator's robots. Where the whole
    change breaks a limit on them, parts of it are tried, then a change that weighs the limits more. Gaits that are better come
    first, the gait before them next. Only gaits that go straight and aim at speed are refined: their mirror symmetry halves
    the unknowns."""
    request, best = evaluator.request, found.best
    if not options.iterations or request.way not in STRAIGHT or request.aim != "speed" or best.nominal is None:
        return found
    better: dict[GaitShape, Candidate] = {}
    for caution in options.cautions:
        weighed = {name: caution * getattr(options, name) for name in ("slip", "clearance", "torque")}
        shape = gauss_newton(evaluator, best.shape, replace(options, **weighed), progress)
        if shape == best.shape:
            continue
        progress("the refined gait on the ensemble", None)
        tried = evaluator.judged([_between(best.shape, shape, part) for part in options.parts], len(evaluator.draws), list)
        better |= {c.shape: c for c in tried if c.nominal is not None and c.rank() < best.rank()}
        if tried[0].shape in better:
            break
    first, *others = [*sorted(better.values(), key=Candidate.rank)[:KEPT], best]
    return replace(found, best=first, others=(*others, *found.others), rollouts=evaluator.rollouts)


def _between(start: GaitShape, end: GaitShape, part: float) -> GaitShape:
    """A shape with a part of the change of the angles."""
    after = np.array(end.offsets)
    before = np.array(start.offsets) if start.offsets else np.zeros_like(after)
    return replace(end, offsets=tuple(tuple(row) for row in (before + part * (after - before)).tolist()))


def gauss_newton(evaluator: Evaluator, shape: GaitShape, options: RefineOptions, progress: Progress) -> GaitShape:
    """The shape with other offsets, whose residuals on the nominal robot and some others are smaller; the same shape where no
    step makes them so."""
    basis = _Basis.of(evaluator.machine, shape, options.harmonics)
    robots = [evaluator.nominal, *evaluator.draws[:options.robots]]
    (nominal,) = evaluator.measured([(shape, evaluator.nominal)])
    speed = max(evaluator.request.progress(nominal), SLOWEST)

    def residuals(points: Sequence[Array]) -> list[Array]:
        shapes = [basis.shape(x) for x in points]
        measures = evaluator.measured([(s, robot) for s in shapes for robot in robots])
        each = [_residuals(evaluator, m, speed, options) for m in measures]
        return [np.concatenate(each[k:k + len(robots)]) for k in range(0, len(each), len(robots))]

    x = np.zeros(basis.size)
    (r,) = residuals([x])
    for iteration in range(options.iterations):
        progress(f"refining: step {iteration + 1} of {options.iterations}, {basis.size} numbers on {len(robots)} robots", None)
        probed = residuals([x + options.probe * e for e in np.eye(basis.size)])
        J = np.stack([(p - r) / options.probe for p in probed], axis=1)
        steps = [-np.linalg.solve(J.T @ J + damping * np.eye(basis.size), J.T @ r) for damping in DAMPING]
        points = [x + share * step for step in steps for share in SHARES]
        tried = residuals(points)
        best = min(range(len(tried)), key=lambda k: float(tried[k] @ tried[k]))
        if tried[best] @ tried[best] >= r @ r:
            break
        x, r = points[best], tried[best]
    return basis.shape(x) if x.any() else shape


def _residuals(evaluator: Evaluator, m: GaitMeasure, speed: float, o: RefineOptions) -> Array:
    """Of one robot (5,): to be made small. speed: the nominal robot's before [m/s]."""
    machine, request = evaluator.machine, evaluator.request
    if m.fell:
        return np.full(5, FALLEN)
    limits, gone = request.limits, max(request.progress(m), SLOWEST)
    slip = m.slip / gone / limits.slip if np.isfinite(m.slip) else 0.0
    high = m.clearance / limits.lift if np.isfinite(m.clearance) else 2.0
    torque = max(float(np.max(np.array(m.rms) / allowed_rms(machine, limits))), max(m.torque_use) / limits.torque)
    return np.array([o.speed * (o.target - gone / speed), o.heading * np.clip(drift(request, m), -1.5, 1.5),
                     o.slip * max(slip - o.near, 0.0), o.clearance * max(ENOUGH - high, 0.0),
                     o.torque * max(torque - o.near, 0.0)])


@dataclass(frozen=True, eq=False)
class _Basis:
    """Mirror-symmetric changes of a gait's angles: for each joint of the left legs its mean and harmonics, the right ones
    mirrored. pairs: columns left, right and the mirror's sign. waves (P, H)."""

    start: GaitShape
    offsets: Array
    pairs: tuple[tuple[int, int, int], ...]
    waves: Array
    shift: int

    @property
    def size(self) -> int:
        """How many numbers."""
        return len(self.pairs) * self.waves.shape[1]

    @staticmethod
    def of(machine: GaitMachine, shape: GaitShape, harmonics: int) -> _Basis:
        """Of a gait that goes straight."""
        phases = 2 * np.pi * np.arange(shape.poses) / shape.poses
        waves = [np.ones(shape.poses), *(f(k * phases) for k in range(1, harmonics + 1) for f in (np.cos, np.sin))]
        (even,) = paths_of(machine, [replace(shape, offsets=(), turn=0.0, side=0.0)])
        front_left, front_right = FAMILIES[shape.family][:2]
        shift = round((front_left - front_right) % 1.0 * shape.poses)
        offsets = np.array(shape.offsets) if shape.offsets else np.zeros_like(even.q)
        return _Basis(shape, offsets, _pairs(machine, even.q, shift), np.stack(waves, axis=1), shift)

    def shape(self, x: Array) -> GaitShape:
        """With the changes x (size,) [rad]."""
        out = self.offsets.copy()
        for (left, right, sign), numbers in zip(self.pairs, x.reshape(len(self.pairs), -1)):
            change = self.waves @ numbers
            out[:, left] += change
            out[:, right] += sign * np.roll(change, self.shift)
        return replace(self.start, offsets=tuple(tuple(row) for row in out.tolist()))


def _pairs(machine: GaitMachine, q: Array, shift: int) -> tuple[tuple[int, int, int], ...]:
    """Each joint of a left leg with its mirror image: columns, and 1 or -1 as they turn in equal or opposite directions in a
    straight
    gait's angles q (P, n)."""
    out, joints = [], machine.model.joints
    for left in (leg for leg in machine.legs if leg.neutral[1] > 0):
        image = left.neutral * [1, -1, 1]
        across = [leg for leg in machine.legs if leg.neutral[1] <= 0]
        right = across[int(np.argmin([np.linalg.norm(leg.neutral - image) for leg in across]))]
        for a, b in zip(map(joints.index, left.joints), map(joints.index, right.joints)):
            mine, theirs = np.roll(q[:, a], shift), q[:, b]
            out.append((a, b, 1 if np.abs(mine - theirs).sum() <= np.abs(mine + theirs).sum() else -1))
    return tuple(out)

