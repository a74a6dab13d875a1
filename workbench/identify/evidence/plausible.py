"""Effects checked against plausible sizes on the robot: one whose fit ends at the largest plausible size is something else."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from workbench.effects.base import Parameter
from workbench.identify.evidence.hypothesis import Hypothesis
from workbench.identify.options import CONCLUSIONS
from workbench.identify.parameters import Candidate
from workbench.identify.results.reasons import AtItsEnd, Reason
from workbench.types import Array


def at_their_end(h: Hypothesis, pool: Sequence[Candidate]) -> dict[Candidate, Reason]:
    """The effects of which a number went to the end of its plausible range on this robot. `Effect.reach` sets no range for
    numbers that only shape an effect. pool: as `candidates` made them, with `Effect.reach` and not with what registers say."""
    reaches, out = {c.key: c.reach for c in pool}, dict[Candidate, Reason]()
    for c, x in h.sizes():
        far = CONCLUSIONS.at_its_end * reaches.get(c.key, math.inf)
        ended = next(((p, v) for p, v, away in _distances(c, x) if math.isfinite(far) and away >= far), None)
        if ended is not None:
            p, v = ended
            out[c] = AtItsEnd(p.name, v, p.unit)
    return out


def _distances(c: Candidate, x: Array) -> Iterator[tuple[Parameter, float, float]]:
    """Each parameter but those that only shape the effect, its value, and its distance from neutral; for a vector, its length
    instead of its value."""
    values, neutral = iter(c.values(x)), iter(c.neutral)
    for p in c.given:
        n = 3 if p.vector else 1
        v, at = np.array(list(islice(values, n))), np.array(list(islice(neutral, n)))
        away = float(np.linalg.norm(v - at)) if p.vector or not np.isfinite(at).all() else p.distance(float(v[0]), float(at[0]))
        if not p.shapes:
            yield p, float(np.linalg.norm(v)) if p.vector else float(v[0]), away
