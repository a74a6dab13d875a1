"""Uncertainty of a fit's parameters: from the scatter between stretches, and from errors common to all of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from workbench.identify.fitting.levenberg_marquardt import Solved
from workbench.identify.options import FIT
from workbench.identify.rollouts.evaluator import RolloutEvaluator, take_of
from workbench.types import Array


def covariance_of(
    evaluator: RolloutEvaluator, solved: Solved, takes: tuple[int, ...], joint: str | None = None, bent: bool = True
) -> Array:
    """Covariance of a block's numbers. joint: whose channels identify them, None for all; bent: whether contact bends what
    floating-base takes identify. Infinite where nothing depends on a number."""
    stretches = evaluator.stretches(takes, joint)
    engines = bent * FIT.contact_error * np.abs(solved.x) * _floating_share(evaluator, solved, takes, stretches)
    contact = _bent_by_contact(evaluator, solved, takes, joint)
    temper = FIT.overdispersion_free if bent and evaluator.any_floating(takes) else 1.0
    return np.asarray(cluster_covariance(solved, stretches, temper) + np.diag(engines**2 + contact**2))


def _floating_share(evaluator: RolloutEvaluator, solved: Solved, takes: Sequence[int], stretches: NDArray[np.int_]) -> Array:
    """Share of the information on each parameter that comes from floating-base takes."""
    free = [i for i in takes if evaluator.any_floating((i,))]
    information = np.sum(solved.J**2, axis=0)
    floating = np.sum(solved.J[np.isin(take_of(stretches), free)] ** 2, axis=0)
    return np.asarray(np.divide(floating, information, out=np.zeros_like(information), where=information > 0))


def _bent_by_contact(evaluator: RolloutEvaluator, solved: Solved, takes: Sequence[int], joint: str | None) -> Array:
    """Change of each parameter under the other contact model: both are equally valid, and the change is common to all
    stretches."""
    other = evaluator.vector({i: evaluator.evidence[i].contact / evaluator.evidence[i].sigma for i in takes}, "fit", joint)
    scale = np.sqrt(np.sum(solved.J**2, axis=0)) + 1e-9
    return np.asarray(np.linalg.lstsq(solved.J / scale, other, rcond=1e-6)[0] / scale)


def cluster_covariance(solved: Solved, stretches: NDArray[np.int_], temper: float = 1.0) -> Array:
    """Covariance of a block's sizes: from the scatter between stretches, since errors of neighbouring frames and joints are
    correlated (clustered sandwich; K.-Y. Liang and S. L. Zeger, Biometrika 73, 1986), and at least that from the scatter between
    frames and from chi squared over temper; infinite where nothing depends on them."""
    H = solved.J.T @ solved.J
    known = np.diag(H) > 1e-9
    out = np.full(H.shape, np.inf)
    if not known.any():
        return out
    scale = np.sqrt(np.diag(H)[known])
    values, vectors = np.linalg.eigh(H[np.ix_(known, known)] / np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1e-9)) @ vectors.T / np.outer(scale, scale)
    samples = max(1, int(np.count_nonzero(solved.r)))
    frames = inverse * max(temper, solved.cost / samples)
    _, which = np.unique(stretches, return_inverse=True)
    count = int(which.max()) + 1
    scores = np.zeros((count, int(known.sum())))
    np.add.at(scores, which, solved.J[:, known] * solved.r[:, None])
    between = inverse @ (scores.T @ scores) @ inverse * count / max(1, count - 1)
    wider = np.sqrt(np.maximum(1.0, np.diag(frames) / np.maximum(np.diag(between), 1e-30)))
    out[np.ix_(known, known)] = between * np.outer(wider, wider)
    return out
