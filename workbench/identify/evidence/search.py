"""One search: linearise, score moves by the evidence that they foretell, fit the best few, keep a beam, stop by evidence."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.identify.evidence.fit import Asks, Fitted, fitting, judged, polished, side_by_side, without
from workbench.identify.evidence.hypothesis import Term, start
from workbench.identify.evidence.linearise import Move, best_of_each, in_pairs, linearised, slopes_for
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.region import Region
from workbench.identify.evidence.rollouts import Rollouts
from workbench.identify.fitting.levenberg_marquardt import together
from workbench.identify.parameters import Candidate

Array = NDArray[np.float64]
Key = frozenset[Term]
Report = Callable[[str, float | None], None]


@dataclass(frozen=True)
class Found:
    """What the search of one region fitted, by which effects there are, and which of these were extended by all others."""

    region: Region
    fits: Mapping[Key, Fitted]
    extended: frozenset[Key] = frozenset()

    @property
    def best(self) -> Fitted:
        """The likeliest fit."""
        return max(self.fits.values(), key=lambda f: f.log_posterior)

    def goes_on(self, options: EvidenceOptions) -> bool:
        """Whether the likeliest fit may have a better one beyond it: it was not extended yet."""
        best = self.best.hypothesis
        return best.key not in self.extended and len(best.effects) < options.most

    def beam(self, options: EvidenceOptions) -> list[Fitted]:
        """The likeliest fits, few enough to go on with."""
        return sorted(self.fits.values(), key=lambda f: -f.log_posterior)[:options.beam]


def search(rollouts: Rollouts, options: EvidenceOptions, report: Report) -> tuple[Rollouts, tuple[Found, ...]]:
    """Searches all regions side by side, level by level; returns them with what stands in each."""
    regions = rollouts.regions
    report("the nominal law recalibrated", None)
    first = _all_of(rollouts, [_begun(r, options) for r in regions])
    found = [Found(r, {f.hypothesis.key: f}) for r, f in first]
    rollouts = standing(rollouts, found)
    open_ = set(range(len(regions)))
    for level in range(options.most + 1):
        report(f"effects, level {level + 1}", level / (options.most + 1))
        levels = {i: _level(found[i], options) for i in sorted(open_)}
        found = _replaced(found, lockstep(rollouts, levels))
        rollouts = standing(rollouts, found)
        again = {i: _renewed(found[i], options) for i in range(len(found))}  # other joints moved, and what is left is shorter
        found = _replaced(found, lockstep(rollouts, again))
        rollouts = standing(rollouts, found)
        open_ = {i for i in open_ if found[i].goes_on(options)}
        if not open_:
            break
    report("taking effects out, and others in their place", None)
    found = _replaced(found, lockstep(rollouts, {i: _exchanged(found[i], options) for i in range(len(found))}))
    rollouts = standing(rollouts, found)
    found = _replaced(found, lockstep(rollouts, {i: _renewed(found[i], options) for i in range(len(found))}))
    return standing(rollouts, found), tuple(found)


def _begun(region: Region, options: EvidenceOptions) -> Asks[tuple[Region, Fitted]]:
    """The nominal law recalibrated, and the correlation time that this leaves."""
    h = start(region.numbers)
    (r,) = yield [h]
    region = region.measured(r, options)
    s = region.likelihood.discrepancy(r)
    fit = yield from fitting(region, options, h, s, options.iterations, r)
    return region, fit


def _level(found: Found, options: EvidenceOptions) -> Asks[Found]:
    """The beam's states extended by the moves that foretell most, and those fitted."""
    fits, extended = dict(found.fits), set(found.extended)
    region, moves = found.region, []
    for f in found.beam(options):
        if f.hypothesis.key in extended:
            continue
        extended.add(f.hypothesis.key)
        alone = yield from linearised(region, options, f)
        moves += [(f, m) for m in best_of_each([*alone, *in_pairs(region, options, f, alone)])[:options.refined]
                  if m.hypothesis.key not in fits]
    wanted: dict[Key, tuple[Fitted, Move]] = {}
    for f, m in sorted(moves, key=lambda fm: -(fm[0].log_posterior + fm[1].gain)):
        wanted.setdefault(m.hypothesis.key, (f, m))
    made = yield from side_by_side([_moved(region, options, f, m) for f, m in wanted.values()])
    fits |= {f.hypothesis.key: f for f in made}
    ahead = sorted(fits.values(), key=lambda f: -f.log_posterior)[:options.beam]
    better = yield from side_by_side([polished(region, options, f, options.polish) for f in ahead])
    fits |= {f.hypothesis.key: max(f, fits[f.hypothesis.key], key=lambda g: g.log_posterior) for f in better}
    return Found(region, fits, frozenset(extended))


def _moved(region: Region, options: EvidenceOptions, f: Fitted, m: Move) -> Asks[Fitted]:
    """A move fitted, with the slopes that foretold it where they tell all its numbers."""
    shaped = any(c.shapes.any() or c.size > 1 for c in m.added)
    return (yield from fitting(region, options, m.hypothesis, f.discrepancy, options.iterations, None, None if shaped else m.J))


def _renewed(found: Found, options: EvidenceOptions) -> Asks[Found]:
    """All fits within reach of the best judged anew, as other regions stand now, by the correlation time that the closest of them
    leaves: what a poorer model leaves is correlated because it lacks something."""
    near = [f for f in found.fits.values() if f.log_posterior > found.best.log_posterior - 3 * options.occam]
    left = yield [f.hypothesis for f in near]
    r = min(left, key=found.region.likelihood.discrepancy)
    region = found.region.measured(r, options)
    fits = {f.hypothesis.key: judged(region, options, f.hypothesis, x, f.J) for f, x in zip(near, left)}
    return replace(found, region=region, fits=fits)


def _exchanged(found: Found, options: EvidenceOptions) -> Asks[Found]:
    """The best fit without each of its effects in turn, then with another in its place, while that is better."""
    region, fits = found.region, dict(found.fits)
    for _ in range(options.most):
        best = max(fits.values(), key=lambda f: f.log_posterior)
        if not best.hypothesis.effects:
            break
        before = best.log_posterior
        alone = yield from linearised(region, options, best)
        fewer = [_dropped(region, options, best, c.name) for c in best.hypothesis.effects
                 if best.hypothesis.without(lambda o, c=c: o.name == c.name).key not in fits]
        made = yield from side_by_side(fewer)
        fits |= {f.hypothesis.key: f for f in made}
        swaps: list[tuple[Fitted, Move]] = []
        for c in best.hypothesis.effects:
            rest = fits.get(best.hypothesis.without(lambda o, c=c: (o.name, o.where) == (c.name, c.where)).key)
            if rest is None:
                continue
            for m in alone[:2 * options.refined]:
                (new,) = m.added
                if (new.name, new.where) == (c.name, c.where) or new.options:
                    continue
                x = m.hypothesis.theta[len(m.hypothesis.theta) - new.size:]
                h = rest.hypothesis.with_effect(new, x)
                if h.key in fits:
                    continue
                J, _ = slopes_for(rest, h)
                J[:, J.shape[1] - new.size:] = m.J[:, m.J.shape[1] - new.size:]
                r = rest.r + J[:, J.shape[1] - new.size:] @ x
                there = judged(region, options, h, r, J)
                swaps.append((rest, Move(h, r, J, there.log_posterior - best.log_posterior, (new,))))
        swaps.sort(key=lambda fm: -fm[1].gain)
        made = yield from side_by_side([_moved(region, options, f, m) for f, m in swaps[:options.refined]])
        fits |= {f.hypothesis.key: f for f in made}
        ahead = max(fits.values(), key=lambda f: f.log_posterior)
        if ahead.log_posterior <= before + options.stop:
            break
    return replace(found, fits=fits)


def _dropped(region: Region, options: EvidenceOptions, f: Fitted, name: str) -> Asks[Fitted]:
    h, J = without(f, lambda c: c.name == name)
    return (yield from fitting(region, options, h, f.discrepancy, options.iterations, None, J))


def lockstep(rollouts: Rollouts, parts: Mapping[int, Generator[Any, Any, Any]]) -> dict[int, Any]:
    """What generators of several regions return; their rollouts are shared."""
    return together(dict(parts), lambda wanted: rollouts.answers([(i, h) for i, h in wanted]))


def _all_of(rollouts: Rollouts, parts: Sequence[Generator[Any, Any, Any]]) -> list[Any]:
    done = lockstep(rollouts, dict(enumerate(parts)))
    return [done[i] for i in range(len(parts))]


def without_names(found: Found, gone: Collection[Candidate]) -> Found:
    """Without all fits that have one of these effects, which are not to be looked at again."""
    names = {(c.name, c.where) for c in gone}
    fits = {key: f for key, f in found.fits.items() if not any((c.name, c.where) in names for c in f.hypothesis.effects)}
    region = replace(found.region, candidates=tuple(c for c in found.region.candidates if (c.name, c.where) not in names))
    return replace(found, region=region, fits=fits)


def standing(rollouts: Rollouts, found: Sequence[Found]) -> Rollouts:
    """With the best of what was found standing in each region."""
    return replace(rollouts, regions=tuple(f.region for f in found), standing=tuple(f.best.hypothesis for f in found))


def _replaced(found: Sequence[Found], done: Mapping[int, Found]) -> list[Found]:
    return [done.get(i, f) for i, f in enumerate(found)]
