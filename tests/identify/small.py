"""Small real objects of a search, each made in a line: fits, takes, and a search of which nothing is rolled out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from workbench.compare.session import TakeSpec
from workbench.compare.session_takes import RegisteredTake
from workbench.effects.registry import known_effects
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.parameters import Candidate
from workbench.identify.problem import TakeEvidence
from workbench.identify.rollouts.evaluator import RolloutEvaluator
from workbench.recording.recording import Measurement, Recording
from workbench.recording.take import Take
from workbench.robot import puppy_model
from workbench.simulation import SimulationConfig

FRAMES = 300
"""Of each take, 10 ms apart; the last third is kept for validation, every third frame of the others chooses."""
JOINTS = ("one", "two")


def fit_of(effects: Sequence[Candidate] = (), residuals: Mapping[int, np.ndarray] | None = None, **cost: float) -> Fit:
    """A fit whose sizes are 1, each known to 1, with these residuals by take and these costs by use."""
    count = sum(c.size for c in effects)
    return Fit(tuple(effects), np.ones(count), np.eye(count), cost, dict(residuals or {}))


def candidate(name: str, *where: str) -> Candidate:
    """An effect of the puppy at a place."""
    effect = known_effects()[name]
    return Candidate.of(effect, where, effect.neutral(puppy_model()))


def evidence(base: str = "fixed", joints: tuple[str, ...] = JOINTS) -> TakeEvidence:
    """A take of joints that rest, with a sigma of 1 mrad."""
    time = 0.01 * np.arange(FRAMES)
    shape = (FRAMES, len(joints))
    recorded = Take(base, "recording", time, joints, np.zeros(shape), starts_at=0.0, zeroed=True, base=base)
    raw = Recording("small", "joint log", "1", time, np.arange(FRAMES), 100.0)
    take = RegisteredTake(TakeSpec(base, Path("small.csv"), base=base), puppy_model(), raw, None, Measurement(0.0), recorded)
    validate = np.arange(FRAMES) >= 2 * FRAMES // 3
    choose = ~validate & (np.arange(FRAMES) % 3 == 0)
    return TakeEvidence(take, joints, np.zeros(shape), np.full(len(joints), 1e-3), np.zeros(shape),
                        {"fit": ~validate & ~choose, "choose": choose, "validate": validate}, np.ones(len(joints)), False,
                        np.zeros(shape))


def search_on(*bases: str) -> Search:
    """A search on takes with these bases."""
    return Search(RolloutEvaluator([evidence(base) for base in bases], SimulationConfig()), puppy_model())


def leaving(chi_squared: float, joint: str | None = None) -> np.ndarray:
    """Residuals of a take whose choosing frames sum to this chi squared, in one joint or evenly in both."""
    r = np.zeros((FRAMES, len(JOINTS)))
    columns = range(len(JOINTS)) if joint is None else [JOINTS.index(joint)]
    for k in columns:
        r[:, k] = np.sqrt(chi_squared / len(columns) / np.count_nonzero(evidence().uses["choose"]))
    return r
