"""Gauss-Newton on a gait's joint angles at its poses, with compiled rollouts on several robots as the residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.files.option_checks import check_positive, check_whole
from workbench.gait.draws import OVER_DRAWS, draw_margins, slip_margin
from workbench.gait.evaluate import Candidate, Evaluator
from workbench.gait.limits import clearance_margin, run_margins
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import GaitMeasure
from workbench.gait.requirements import SLOWEST, drift
from workbench.gait.search import Found
from workbench.gait.shape import FAMILIES, GaitShape
from workbench.gait.table import paths_of
from workbench.robot import RobotModel
from workbench.types import Progress

Array = NDArray[np.float64]

STRAIGHT = ("forward", "backward")
"""Ways whose left and right legs do the same, half a cycle apart or together."""
DAMPING = (1.0, 10.0, 100.0)
"""Weights against long steps that are tried, relative to a change of one radian in each harmonic."""
SHARES = (1.0, 0.5)
"""Of each step that are tried."""
FALLEN = 2.0
"""Residuals of speed and heading of a robot that fell: about the speed's of one that stands still."""
REPRODUCED = 0.05
"""By how much the use of a limit on the nominal robot may grow from the search's run to the certificate's, longer and at half the
step."""
ALIKE = 0.02
"""Least standard deviation of a limit's use over robots that counts."""


KEPT = 2
"""How many refined gaits become finalists at most."""


@dataclass(frozen=True)
class RefineOptions:
    """Size of the refinement. InputError for a number out of range.

    iterations: Gauss-Newton steps; 0: none. robots: the slowest of the ensemble, in addition to the nominal one, whose rollouts
    give the residuals. harmonics: of the cycle in each joint's change, in addition to its mean. probe: change of a harmonic by
    which its effect is measured [rad]. target: speed that is aimed at, by the nominal robot's. speed, heading [by rad/m]: weights
    of their residuals; speed is relative to the nominal robot's. limit: weight of a limit's use by its standard deviation over
    robots; it counts from `headroom` standard deviations below the limit on: that of nine robots in ten is known to
    half a standard deviation from eight. parts: of the change that are tried on all robots.
    """

    iterations: int = 1
    robots: int = 2
    harmonics: int = 2
    probe: float = 0.026
    target: float = 1.3
    speed: float = 1.7
    heading: float = 0.3
    limit: float = 1.0
    headroom: float = 1.0
    parts: tuple[float, ...] = (1.0, 0.6, 0.3)

    def __post_init__(self) -> None:
        check_whole(self, iterations=0, robots=0, harmonics=0)
        check_positive(self, "probe", "target", "speed", "heading", "limit", "headroom")


def refine(evaluator: Evaluator, found: Found, options: RefineOptions, progress: Progress) -> Found:
    """The search's result with its best gait refined, by the whole change or a part of it, where that is better on all of the
    evaluator's robots. Gaits that are better come first, the gait before them next. Only gaits that go straight and aim at speed
    are refined: their mirror symmetry halves the unknowns."""
    request, best = evaluator.request, found.best
    if not options.iterations or request.way not in STRAIGHT or request.aim != "speed" or best.nominal is None:
        return found
    shape = gauss_newton(evaluator, best.shape, options, progress)
    if shape == best.shape:
        return found
    progress("the refined gait on the ensemble", None)
    tried = evaluator.judge([_between(best.shape, shape, part) for part in options.parts], len(evaluator.draws), list)
    better = sorted((c for c in tried if c.nominal is not None and c.rank() < best.rank()), key=Candidate.rank)
    first, *others = [*better[:KEPT], best]
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
    for iteration in range(options.iterations):
        goal = Goal.of(evaluator, shape, options)
        counted = f"{basis.size} numbers on {len(goal.robots)} robots"
        progress(f"refining: step {iteration + 1} of {options.iterations}, {counted}", None)
        probes: Array = options.probe * np.eye(basis.size)
        r, *probed = goal.residuals([shape, *(basis.shape(x) for x in probes)])
        J = np.stack([(p - r) / options.probe for p in probed], axis=1)
        steps = [-np.linalg.solve(J.T @ J + damping * np.eye(basis.size), J.T @ r) for damping in DAMPING]
        points = [basis.shape(np.asarray(share * step, float)) for step in steps for share in SHARES]
        tried = goal.residuals(points)
        best = min(range(len(tried)), key=lambda k: float(tried[k] @ tried[k]))
        if tried[best] @ tried[best] >= r @ r:
            break
        shape = points[best]
        basis = replace(basis, offsets=np.array(shape.offsets))
    return shape


@dataclass(frozen=True, eq=False)
class Goal:
    """What is to be made small from a shape on: residuals of the nominal robot and of a few others, which stand for all.

    robots: the nominal one first. speed: the nominal robot's at the shape [m/s]. limits: by name, of the others. Nine of ten
    robots have to keep a limit: its use on the few counts as if the largest of theirs were that of nine in ten of all.
    """

    evaluator: Evaluator
    options: RefineOptions
    robots: tuple[RobotModel, ...]
    speed: float
    limits: Mapping[str, OverDraws]

    @staticmethod
    def of(evaluator: Evaluator, shape: GaitShape, options: RefineOptions) -> Goal:
        """The goal at a shape, from its runs on all of the evaluator's robots."""
        request, few = evaluator.request, options.robots
        nominal, *draws = evaluator.measure([(shape, robot) for robot in (evaluator.nominal, *evaluator.draws)])
        order = sorted(range(len(draws)), key=lambda k: request.progress(draws[k]))
        order = [k for k in order if not draws[k].fell] + [k for k in order if draws[k].fell]
        uses = [_largest(_uses(evaluator, draws[k], False)) for k in order if not draws[k].fell]
        limits = {}
        for m in draw_margins(evaluator.machine, request, draws):
            name = m.name.removesuffix(OVER_DRAWS)
            each = [use.get(name, 0.0) for use in uses]
            limits[name] = OverDraws(m.use - max(each[:few], default=m.use), max(float(np.std(each)), ALIKE))
        return Goal(evaluator, options, (evaluator.nominal, *(evaluator.draws[k] for k in order[:few])),
                     max(request.progress(nominal), SLOWEST), limits)

    def residuals(self, shapes: Sequence[GaitShape]) -> list[Array]:
        """Residuals of each shape (R,)."""
        measures = self.evaluator.measure([(s, robot) for s in shapes for robot in self.robots])
        n = len(self.robots)
        return [np.concatenate([self._of(m, nominal=i == 0) for i, m in enumerate(measures[k:k + n])])
                for k in range(0, len(measures), n)]

    def _of(self, m: GaitMeasure, nominal: bool) -> Array:
        """Residuals of one robot: speed and heading, then one for each limit and place."""
        o, request = self.options, self.evaluator.request
        uses = _uses(self.evaluator, m, nominal)
        if m.fell:
            return np.concatenate([[FALLEN, FALLEN], np.zeros(len(uses))])
        reached = [o.speed * (o.target - max(request.progress(m), SLOWEST) / self.speed),
                   o.heading * float(np.clip(drift(request, m), -1.5, 1.5))]
        own = OverDraws(0.0, REPRODUCED)
        beyond = [(use + limit.shift - 1) / limit.scatter + o.headroom
                  for (name, _), use in uses.items() for limit in [own if nominal else self.limits.get(name, own)]]
        return np.concatenate([reached, o.limit * np.maximum(beyond, 0.0)])


@dataclass(frozen=True)
class OverDraws:
    """Use of a limit over robots. shift: that which nine of ten keep to, beyond the largest of a few. scatter: standard
    deviation."""

    shift: float
    scatter: float


def _uses(evaluator: Evaluator, m: GaitMeasure, nominal: bool) -> dict[tuple[str, str], float]:
    """Use of each limit of a run by its name and place; those that were not measured count as kept."""
    machine, request = evaluator.machine, evaluator.request
    margins = [*run_margins(machine, m, request.limits), clearance_margin(request.limits, m),
               slip_margin(machine, request, m, None if nominal else request.limits.slip_on_draws)]
    return dict(sorted(((x.name, x.where), float(np.nan_to_num(x.use))) for x in margins if not x.advice))


def _largest(uses: Mapping[tuple[str, str], float]) -> dict[str, float]:
    """The largest of each name over its places."""
    out: dict[str, float] = {}
    for (name, _), use in uses.items():
        out[name] = max(use, out.get(name, 0.0))
    return out


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
        """The directions of a gait that goes straight."""
        phases = 2 * np.pi * np.arange(shape.poses) / shape.poses
        waves = [np.ones(shape.poses), *(f(k * phases) for k in range(1, harmonics + 1) for f in (np.cos, np.sin))]
        (even,) = paths_of(machine, [replace(shape, offsets=(), turn=0.0, side=0.0)])
        front_left, front_right = FAMILIES[shape.family][:2]
        shift = round((front_left - front_right) % 1.0 * shape.poses)
        offsets = np.array(shape.offsets) if shape.offsets else np.zeros_like(even.q)
        return _Basis(shape, offsets, _pairs(machine, even.q, shift), np.stack(waves, axis=1), shift)

    def shape(self, x: Array) -> GaitShape:
        """The shape with the changes x (size,) [rad]."""
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

