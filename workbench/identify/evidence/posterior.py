"""Probabilities of names, places and families over all models within Occam's window."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.effects.base import Family
from workbench.effects.registry import known_effects
from workbench.identify.evidence.fit import Fitted
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.options import CONCLUSIONS
from workbench.identify.parameters import Key


@dataclass(frozen=True)
class RegionPosterior:
    """The posterior of one region. weights: of models within the window, the likeliest first; named: probability that an effect
    is there; families: that any effect of a family is."""

    weights: tuple[tuple[Fitted, float], ...]
    named: Mapping[Key, float]
    families: Mapping[Family, float]

    @property
    def unnamed(self) -> float:
        """Probability of a torque that nobody has named."""
        return min(1.0, sum(w for f, w in self.weights if f.hypothesis.law is not None))

    def unnamed_instead(self, of: Key) -> tuple[tuple[str, ...], float]:
        """The variables of an unnamed torque in the most probable model that has one instead of an effect, and the probability of
        all such models."""
        models = [(f, w) for f, w in self.weights if f.hypothesis.law is not None and of not in _names(f)]
        if not models:
            return (), 0.0
        law = models[0][0].hypothesis.law
        assert law is not None
        return tuple(law.scales), sum(w for _, w in models)

    @property
    def best(self) -> Fitted:
        """The likeliest model."""
        return self.weights[0][0]

    def elsewhere(self, of: Key) -> dict[Key, float]:
        """The same effect at other places, with the probability that it is there and not here, where that is a good part of what
        it is here: the data cannot tell these places apart."""
        kept, out = _names(self.best), dict[Key, float]()
        for f, w in self.weights:
            if of not in _names(f):
                for other in {n for n in _names(f) - kept if n[0] == of[0]}:
                    out[other] = out.get(other, 0.0) + w
        return {other: w for other, w in out.items() if w >= CONCLUSIONS.same_elsewhere * self.named[of]}

    def rival(self, of: Key, besides: Collection[Key] = ()) -> tuple[Key, float] | None:
        """The most probable alternative to `of`: an effect that the best model does not have, and that is not in `besides`."""
        kept = _names(self.best) | set(besides)
        family = known_effects()[of[0]].family
        instead: dict[Key, float] = {}
        for f, w in self.weights:
            names = _names(f)
            if of in names:
                continue
            for other in names - kept:
                alike = known_effects()[other[0]].family == family
                instead[other] = instead.get(other, 0.0) + (w if alike else 0.5 * w)
        if not instead:
            return None
        best = max(instead, key=lambda k: instead[k])
        return best, sum(w for f, w in self.weights if of not in _names(f) and best in _names(f))


def posterior_of(fits: Sequence[Fitted], options: EvidenceOptions) -> RegionPosterior:
    """A softmax of log posteriors within the window (D. Madigan and A. Raftery, JASA 89, 1994)."""
    ordered = sorted(fits, key=lambda f: -f.log_posterior)
    near = [f for f in ordered if f.log_posterior > ordered[0].log_posterior - options.occam]
    weights = np.exp([f.log_posterior - near[0].log_posterior for f in near])
    weights /= weights.sum()
    named: dict[Key, float] = {}
    families: dict[Family, float] = {}
    for f, w in zip(near, weights.tolist()):
        for name in _names(f):
            named[name] = named.get(name, 0.0) + w
        for family in {known_effects()[name].family for name, _ in _names(f)}:
            if family is not None:
                families[family] = families.get(family, 0.0) + w
    sums = [{k: min(1.0, v) for k, v in each.items()} for each in (named, families)]  # of rounded weights
    return RegionPosterior(tuple(zip(near, weights.tolist())), *sums)  # type: ignore[arg-type]


def _names(f: Fitted) -> set[Key]:
    return {c.key for c in f.hypothesis.effects}
