"""Effects compared with the same model without them: the Savage-Dickey density ratio.

For a model with an effect of sizes x and the same model without it, which is x = 0, the Bayes factor is p(x = 0) / p(x = 0 |
data) (J. Dickey, Ann. Math. Stat. 42, 1971). Two fits of a joint that sticks end some nats apart by chance, and the best of many
is a lucky one; the covariance of slopes by regression includes that, and refutes an effect whose size is zero within its standard
deviation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import log_ndtr

from workbench.identify.evidence.fit import Asks, Fitted, regress
from workbench.identify.evidence.hypothesis import Prior, log_odds
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.results.reasons import LessLikely, Reason

if TYPE_CHECKING:
    from workbench.identify.evidence.region import Region
    from workbench.identify.parameters import Candidate


def improbable_effects(region: Region, options: EvidenceOptions, best: Fitted) -> Asks[dict[Candidate, Reason]]:
    """The effects of a fit that are improbable by this ratio and the price of an additional effect."""
    if not best.hypothesis.effects:
        return {}
    fit = yield from regress(region, options, best)
    covariance, prior = fit.covariance(region, options), Prior.of(fit.hypothesis, options)
    out: dict[Candidate, Reason] = {}
    for c, own in zip(fit.hypothesis.effects, fit.hypothesis.slices()):
        made = np.arange(own.start, own.stop)[c.makes]
        if c.read_off or not len(made):
            continue
        x, V = fit.hypothesis.theta[made], covariance[np.ix_(made, made)]
        posterior = -0.5 * float(x @ np.linalg.solve(V, x)) - 0.5 * float(np.linalg.slogdet(2 * np.pi * V)[1])
        sign = prior.one_sided[made]  # of these the posterior ends at 0
        posterior -= float(np.sum(log_ndtr(np.abs(x) / np.sqrt(np.diag(V)))[sign]))
        before = float(np.sum(prior.at_center[made]))
        odds = before - posterior + (1 + len(c.options)) * log_odds(len(region.candidates), options.expected)
        if odds < 0:
            out[c] = LessLikely(-odds)
    return out
