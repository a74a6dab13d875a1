"""Starting points of fits: through stick and slip, fits of one model from different starts end tens of nats apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import hadamard

from workbench.identify.evidence.fit import Asks, Fitted, fit_hypothesis, polish
from workbench.identify.evidence.hypothesis import Hypothesis
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.region import Region
from workbench.identify.fitting.lockstep import side_by_side


def spread(h: Hypothesis, starts: int) -> list[Hypothesis]:
    """Starting points of a plain fit: as published, and others, in which every number is a standard deviation away to one side or
    the other."""
    n = len(h.theta)
    signs = hadamard(1 << max(n, starts).bit_length())[1:starts, 1:n + 1]
    return [h, *(h.at(np.clip(h.theta + row, *h.bounds())) for row in signs)]


def as_published(h: Hypothesis) -> Hypothesis:
    """The hypothesis with none of the nominal law's numbers recalibrated."""
    return h.at(np.concatenate([np.zeros(len(h.numbers)), h.theta[len(h.numbers):]]))


def at_typical_sizes(h: Hypothesis, share: float) -> Hypothesis:
    """The nominal law as published, with every effect at a share of its typical size, of the same sign as before. Vectors, and
    sizes that were read off, stay as they are; numbers that only shape an effect are typical."""
    theta = [np.zeros(len(h.numbers))]
    for c, x in h.sizes():
        kept = c.of_vector | c.read_off
        theta.append(np.where(c.shapes, 0.0, np.where(kept, x, np.copysign(share, x))))
    return h.at(np.clip(np.concatenate(theta), *h.bounds()))


def fit_from_starts(region: Region, options: EvidenceOptions, starts: Sequence[Hypothesis], s: float) -> Asks[Fitted]:
    """The likeliest of the fits from several starting points at a discrepancy s, each continued once."""
    fits = yield from side_by_side([fit_hypothesis(region, options, h, s, options.iterations) for h in starts])
    fits = yield from side_by_side([polish(region, options, f) for f in fits])
    return (yield from polish(region, options, max(fits, key=lambda f: f.log_posterior)))


def restart(region: Region, options: EvidenceOptions, starts: Sequence[Sequence[Hypothesis]], best: Fitted) -> Asks[list[Fitted]]:
    """The likeliest fit of each model from its starting points; those that come near the best fit are continued."""
    fits = yield from side_by_side([
        side_by_side([fit_hypothesis(region, options, h, best.discrepancy, options.iterations) for h in of_one])
        for of_one in starts])
    each = sorted((max(of_one, key=lambda f: f.log_posterior) for of_one in fits), key=lambda f: -f.log_posterior)
    near = sum(f.log_posterior > best.log_posterior - options.hopeless for f in each[:options.refined])
    for _ in range(2):
        each[:near] = yield from side_by_side([polish(region, options, f) for f in each[:near]])
    return each
