"""Which effects explain what a model leaves: screened by their signatures, fitted by rollouts, chosen on stretches no fit saw."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from workbench.gap.candidates import Candidate
from workbench.gap.evidence import Jury
from workbench.robot import RobotModel

Array = NDArray[np.float64]
MOST_SIZE = 20.0
"""In typical sizes; a signature is not believed beyond that."""
SCREENING_STEP = 2e-3
"""Signatures are differences of rollouts at the same step, in which most of its error cancels [s]."""


@dataclass(frozen=True)
class Fit:
    """Effects fitted together. x: sizes of all their numbers; covariance of x, infinite where the data say nothing.

    cost: chi squared by use ("fit", "choose", "validate"); residuals by take.
    """

    effects: tuple[Candidate, ...]
    x: Array
    covariance: Array
    cost: dict[str, float]
    residuals: list[Array] = field(repr=False)

    def slices(self) -> list[slice]:
        """Of x, for each effect."""
        ends = np.cumsum([0, *(len(c.neutral) for c in self.effects)]).tolist()
        return [slice(a, b) for a, b in pairwise(ends)]

    def model(self, nominal: RobotModel) -> RobotModel:
        """The nominal robot with these effects."""
        return with_effects(nominal, self.effects, self.x)


def with_effects(nominal: RobotModel, effects: Sequence[Candidate], x: Array) -> RobotModel:
    """The nominal robot with effects of sizes x, one after the other."""
    specs, at = [], 0
    for c in effects:
        n = len(c.neutral)
        specs.append(c.spec(x[at:at + n]))
        at += n
    return replace(nominal, effects=(*nominal.effects, *specs))


def _at_joint(c: Candidate) -> bool:
    return "joint" in c.effect.places and len(c.where) == 1


class Search:
    """Screening and fitting on one session."""

    def __init__(self, jury: Jury, nominal: RobotModel, pool: Sequence[Candidate]) -> None:
        self.jury, self.nominal, self.pool = jury, nominal, list(pool)
        self._signatures: dict[Candidate, list[list[Array]]] = {}

    def screen(self, report: Callable[[str, float], None] = lambda what, share: None) -> None:
        """Rolls every candidate out at its typical size; joint effects at all joints at once, each read at its own joint."""
        base = self.jury.residuals([self.nominal], time_step=SCREENING_STEP)[0]
        groups: dict[tuple[str, ...], list[Candidate]] = {}
        for c in self.pool:
            groups.setdefault((c.effect.name, *(() if _at_joint(c) else c.where)), []).append(c)
        for n, group in enumerate(groups.values()):
            report(group[0].effect.name, n / len(groups))
            takes = self.telling(group[0])
            together = replace(group[0], where=tuple(w for c in group for w in c.where))
            models = [with_effects(self.nominal, [together], x) for x in together.probes()]
            for residuals in self.jury.residuals(models, takes, SCREENING_STEP):
                of = dict(zip(takes, residuals))
                for c in group:
                    parts = [self._own(c, b - of[i], i) if i in of else np.zeros_like(b) for i, b in enumerate(base)]
                    self._signatures.setdefault(c, []).append(parts)

    def telling(self, c: Candidate) -> list[int]:
        """The takes on which a candidate is screened and fitted: what acts in one joint shows best where nothing else pushes
        the robot."""
        held = [i for i, e in enumerate(self.jury.evidence) if e.take.spec.base == "fixed"]
        return held if held and _at_joint(c) else list(range(len(self.jury.evidence)))

    def _own(self, c: Candidate, difference: Array, take: int) -> Array:
        """A joint effect's signature at its own joint alone, as the others of its rollout are other candidates'."""
        if not _at_joint(c):
            return difference
        channels = self.jury.evidence[take].channels
        out = np.zeros_like(difference)
        if c.where[0] in channels:
            i = channels.index(c.where[0])
            out[:, i] = difference[:, i]
        return out

    def rank(self, residuals: Sequence[Array]) -> list[tuple[float, Candidate, Array]]:
        """Candidates by how much of chi squared their signature could take away: (gain, candidate, sizes), best first.

        Fitted on the stretches for fitting, gained on those for choosing.
        """
        r_fit, r_choose = (self.jury.vector(residuals, use) for use in ("fit", "choose"))
        out = []
        for c, parts in self._signatures.items():
            S_fit = np.stack([self.jury.vector(p, "fit") for p in parts], axis=1)
            S_choose = np.stack([self.jury.vector(p, "choose") for p in parts], axis=1)
            x, *_ = np.linalg.lstsq(S_fit, r_fit, rcond=1e-8)
            sizes = c.start(np.clip(x, -MOST_SIZE, MOST_SIZE))
            gain = float(r_choose @ r_choose - np.sum((r_choose - S_choose @ c.probed(sizes)) ** 2))
            out.append((gain, c, sizes))
        return sorted(out, key=lambda row: -row[0])

    def fit(self, effects: Sequence[Candidate], x: Array, iterations: int = 4, takes: Sequence[int] | None = None,
            free: NDArray[np.int_] | None = None) -> Fit:
        """Levenberg-Marquardt on the stretches for fitting; the Jacobian by batched rollouts. takes: which enter the fit (all
        are judged at the end). free: indices of the sizes to fit; the others keep theirs."""
        low, high = self._bounds(effects)
        x = np.clip(np.asarray(x, dtype=float), low, high)
        free = np.arange(len(x)) if free is None else free
        if not len(free):
            return self._finished(effects, x, np.zeros((0, len(x))), 0)
        r = self._vectors(effects, [x], takes)[0]
        damping = 1e-3
        J = np.zeros((len(r), len(x)))
        for _ in range(iterations):
            step = 0.15 * np.maximum(np.abs(x), 0.3)
            step = np.where(x + step <= high, step, -step)
            moved = [x + np.eye(len(x))[i] * step[i] for i in free]
            J[:, free] = np.stack([(v - r) / step[i] for i, v in zip(free, self._vectors(effects, moved, takes))], axis=1)
            H, g = J[:, free].T @ J[:, free], J[:, free].T @ r
            trials = []
            for scale in (damping, damping * 30 + 0.3):
                trial = x.copy()
                trial[free] -= np.linalg.lstsq(H + scale * np.diag(np.maximum(np.diag(H), 1e-9)), g, rcond=None)[0]
                trials.append(np.clip(trial, low, high))
            tried = self._vectors(effects, trials, takes)
            costs = [float(v @ v) for v in tried]
            best, before = int(np.argmin(costs)), float(r @ r)
            if costs[best] >= before:
                break
            settled = before - costs[best] < 2e-3 * before
            damping = damping / 3 if best == 0 else damping * 10
            x, r = trials[best], tried[best]
            if settled:
                break
        return self._finished(effects, x, J, len(free))

    def _finished(self, effects: Sequence[Candidate], x: Array, J: Array, fitted: int) -> Fit:
        residuals = self.jury.residuals([with_effects(self.nominal, effects, x)])[0]
        cost = {use: float(np.sum(self.jury.vector(residuals, use) ** 2)) for use in ("fit", "choose", "validate")}
        samples = int(np.count_nonzero(self.jury.vector(residuals, "fit")))
        covariance = np.full((len(x), len(x)), np.inf)
        H = J.T @ J
        if fitted and np.any(H):
            scale = np.sqrt(np.maximum(np.diag(H), 1e-12))
            values, vectors = np.linalg.eigh(H / np.outer(scale, scale))
            covariance = (vectors / np.maximum(values, 1e-9)) @ vectors.T / np.outer(scale, scale)
            covariance *= max(1.0, cost["fit"] / max(1, samples))
        return Fit(tuple(effects), x, covariance, cost, residuals)

    def _vectors(self, effects: Sequence[Candidate], xs: Sequence[Array], takes: Sequence[int] | None) -> list[Array]:
        done = self.jury.residuals([with_effects(self.nominal, effects, x) for x in xs], takes)
        return [self.jury.vector(r, "fit", takes) for r in done]

    def _bounds(self, effects: Sequence[Candidate]) -> tuple[Array, Array]:
        ends = [c.bounds() for c in effects]
        return np.concatenate([e[0] for e in ends] or [np.empty(0)]), np.concatenate([e[1] for e in ends] or [np.empty(0)])
