"""BAM's friction models refitted to some gains' logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from studies.xl330 import bam
from studies.xl330.bam import Logs
from studies.xl330.fitting import Number, Problem, fit_all

_LEAST = {"armature": 1e-4, "q_offset": 0.005, "friction_base": 0.002, "friction_viscous": 0.001, "friction_stribeck": 0.005,
          "kt": 0.02, "R": 0.2, "dtheta_stribeck": 0.2, "alpha": 0.3, "load_friction_motor_quad": 0.002,
          "load_friction_external_quad": 0.002}


def training(logs: Logs, validated: int) -> NDArray[np.bool_]:
    """The logs (L,) at other gains."""
    return np.array(logs.gains) != validated


def fit_published(model: str, published: Mapping[str, float], logs: Logs, seen: Sequence[NDArray[np.bool_]],
                  starts: int = 3) -> list[dict[str, float]]:
    """Parameters of one of BAM's friction models refitted to each of some sets of logs: from the published ones and from around
    them, the best by cost."""
    rng = np.random.default_rng(0)
    sizes = {n: max(0.1 * abs(published[n]), _LEAST.get(n, 0.05)) for n in bam.PARAMETERS[model]}
    problems = []
    for start in range(starts):
        shift = {n: (rng.normal(0.0, 1.0) if start else 0.0) * size for n, size in sizes.items()}
        numbers = tuple(Number(n, published[n] + shift[n], *bam.BOUNDS[n], size=size) for n, size in sizes.items())
        problems += [Problem(numbers, s) for s in seen]
    fits = fit_all(problems, lambda values: bam.roll_out(logs, model, values), logs.position, {})
    return [min(fits[i::len(seen)], key=lambda f: f.cost).values for i in range(len(seen))]
