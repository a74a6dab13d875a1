"""A robot whose residuals are linear in all numbers, so that fits and evidence have closed forms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from workbench.effects.registry import effect_named
from workbench.identify.evidence.hypothesis import Hypothesis, Uncertain, start
from workbench.identify.evidence.likelihood import Likelihood
from workbench.identify.evidence.region import Part, Region
from workbench.identify.evidence.rollouts import Rollouts
from workbench.identify.parameters import Candidate

JOINT = "j"
FRAME = 0.02


def candidate(name: str, options: tuple[str, ...] = ()) -> Candidate:
    """A known effect at the one joint, or of the whole robot."""
    effect = effect_named(name)
    neutral = tuple(np.inf if name in ("torque_ceiling", "torque_saturation") else p.typical if p.shapes else 0.0
                    for p in effect.parameters)
    return Candidate.of(effect, (JOINT,) if "joint" in effect.places else (), neutral, options=options)


def region(candidates: Sequence[Candidate], n: int = 400, takes: int = 4, noise: float = 1e-3, numbers: int = 1) -> Region:
    """Of `takes` takes of n frames."""
    parts = tuple(Part(i, np.ones(n, bool), np.array([0]), np.ones((n, 1), bool), np.full((n, 1), noise), 1, FRAME)
                  for i in range(takes))
    known = tuple(Uncertain(JOINT, f"number {k}", 0.1) for k in range(numbers))
    likelihood = Likelihood(np.full(n * takes, noise), np.full(n * takes, FRAME), FRAME / 2, 4.0, (1e-4, 0.3))
    return Region((JOINT,), parts, known, tuple(candidates), likelihood)


@dataclass(frozen=True)
class Linear(Rollouts):
    """truth (n,): what the nominal law leaves; does: by effect and number of the nominal law, what a unit of it takes off
    (n,); sticks [rad]: RMS of what jumps, by chance, at each change of theta however small."""

    truth: np.ndarray = field(default_factory=lambda: np.empty(0))
    does: Mapping[str, np.ndarray] = field(default_factory=dict)
    sticks: float = 0.0

    def around_here(self, step, horizon=None):
        return replace(self, step=step)

    def answers(self, wants):
        return [self.left(h) for _, h in wants]

    def left(self, h: Hypothesis) -> np.ndarray:
        r = self.truth.copy()
        for number, z in zip(h.numbers, h.z):
            r = r - z * self.does[number.name]
        for c, x in h.sizes():
            for k, size in enumerate(x):
                r = r - size * self.does.get(f"{c.name}.{c.parameters[k].name}", 0.0)  # a shape does nothing by itself
        if self.sticks:
            seed = np.frombuffer(h.theta.tobytes(), np.uint32).tolist()
            r = r + self.sticks * np.random.default_rng(seed).normal(size=len(r))
        return r


def linear(of: Region, truth: np.ndarray, does: Mapping[str, np.ndarray]) -> Linear:
    return Linear(None, None, (of,), (start(of.numbers),), None, None, truth=truth, does=does)  # type: ignore[arg-type]
