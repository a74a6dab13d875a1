"""Names checked against what is plausible on the robot: an effect that wants to go further than that is something else."""

from __future__ import annotations

import math
from collections.abc import Sequence

from workbench.identify.evidence.hypothesis import Hypothesis
from workbench.identify.options import CONCLUSIONS
from workbench.identify.parameters import Candidate
from workbench.identify.results.reasons import AtItsEnd, Reason


def at_their_end(h: Hypothesis, pool: Sequence[Candidate]) -> dict[Candidate, Reason]:
    """The effects of which a number went as far as this robot lets it. pool: as `candidates` made them, with `Effect.reach` and
    not with what registers say."""
    reaches, out = {c.key: c.reach for c in pool}, dict[Candidate, Reason]()
    for c, x in h.sizes():
        far = CONCLUSIONS.at_its_end * reaches.get(c.key, math.inf)
        ended = next(((p, v) for p, v, n in zip(c.parameters, c.values(x), c.neutral) if abs(v - n) >= far), None)
        if ended is not None:
            p, v = ended
            out[c] = AtItsEnd(p.name, v, p.unit)
    return out
