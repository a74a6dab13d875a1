"""The data subset that a search of a long session uses, as it needs hundreds of rollouts, and a balanced split of its frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from workbench.identify.options import PROBLEM
from workbench.identify.problem import TakeEvidence, channel_gaps, part_of
from workbench.types import Array


def rebalance(evidence: Sequence[TakeEvidence], residuals: Mapping[int, Array]) -> list[TakeEvidence]:
    """Takes of which, on a fixed base, another third of the frames judges where that which does shows next to nothing of what
    a channel lacks: a joint may meet its stop but once. residuals (N, c): of the nominal robot, by take."""
    return [_judged_fairly(e, residuals[i]) if e.take.spec.base == "fixed" and e.uses["fit"].any() else e
            for i, e in enumerate(evidence)]


def _judged_fairly(e: TakeEvidence, residual: Array) -> TakeEvidence:
    ill = [e.channels.index(c) for c in channel_gaps(e, residual)]
    seen = e.uses["fit"] | e.uses["choose"]
    beyond = np.maximum(np.nan_to_num(np.square(residual[:, ill]) - 1.0), 0.0)[seen]
    beyond = beyond[:, beyond.any(axis=0)]
    if not beyond.size:
        return e
    part = part_of(e.since)
    least = [float(np.min(beyond[part[seen] == k].sum(axis=0) / beyond.sum(axis=0))) for k in range(PROBLEM.parts)]
    judges = int(np.argmax(least))
    if judges == PROBLEM.deciding_part or least[PROBLEM.deciding_part] >= PROBLEM.starved:
        return e
    uses = {"fit": seen & (part != judges), "choose": seen & (part == judges)}
    return replace(e, uses={**e.uses, **uses})


def data_subset(evidence: Sequence[TakeEvidence], residuals: Mapping[int, Array]) -> list[TakeEvidence]:
    """Takes as used by a search: without those that only validate; of long sessions, each from its first command until its
    missing effects were seen, or not at all, so that every channel's gap is included, in as many takes as show it.

    residuals (N, c): of the nominal robot, by take. Validation frames are not used."""
    ends = [float(e.since[-1]) for e in evidence]
    fitted = [i for i, e in enumerate(evidence) if e.uses["fit"].any()]
    if sum(ends[i] for i in fitted) <= PROBLEM.long:
        return [e if i in fitted else e.looked_at(0.0) for i, e in enumerate(evidence)]
    power = {i: _power(evidence[i], residuals[i]) for i in fitted}
    names = list(dict.fromkeys(c for e in evidence for c in e.channels))
    by_name = {i: _by_name(p, evidence[i].channels, names) for i, p in power.items()}
    whole = np.sum([p.sum(axis=0) for p in by_name.values()], axis=0)
    shares = {i: p / np.maximum(whole, 1e-9) for i, p in by_name.items()}
    until = dict.fromkeys(range(len(evidence)), 0.0)
    while True:
        spent = sum(until.values())
        steps = [(i, t) for i in fitted for t in np.append(np.arange(until[i] + PROBLEM.piece, ends[i], PROBLEM.piece), ends[i])
                 if 0 < t - until[i] <= PROBLEM.looked_at - spent + 1e-9]
        if not steps:
            break
        shown = {i: _value_of(evidence[i], shares[i], until[i]) for i in fitted}
        best, end = max(steps, key=lambda s: (_value_of(evidence[s[0]], shares[s[0]], s[1]) - shown[s[0]]) / (s[1] - until[s[0]]))
        until[best] = float(end)
    return [e.looked_at(until[i]) for i, e in enumerate(evidence)]


def beginnings(evidence: Sequence[TakeEvidence], seconds: float) -> list[TakeEvidence]:
    """The beginnings of takes, of so many seconds together, in equal parts but for takes that are shorter; nothing of takes that
    only validate."""
    lengths = sorted(float(e.since[-1]) for e in evidence if _is_fitted(e))
    until, left = np.inf, seconds
    for k, length in enumerate(lengths):  # short takes are looked at to their end
        if length * (len(lengths) - k) > left:
            until = left / (len(lengths) - k)
            break
        left -= length
    ends = [until if _is_fitted(e) else 0.0 for e in evidence]
    return [e if np.isinf(end) else e.looked_at(end) for e, end in zip(evidence, ends)]


def at_most(evidence: Sequence[TakeEvidence], seconds: float) -> list[TakeEvidence]:
    """Takes as they are if those that fit last no longer together, else their beginnings."""
    lasts = sum(float(e.since[-1]) for e in evidence if _is_fitted(e))
    return list(evidence) if lasts <= seconds else beginnings(evidence, seconds)


def _is_fitted(e: TakeEvidence) -> bool:
    return bool(e.uses["fit"].any() or e.uses["choose"].any())


def _power(e: TakeEvidence, residual: Array) -> Array:
    """Excess beyond noise (N, c), in frames that may be used."""
    seen = e.uses["fit"] | e.uses["choose"]
    beyond = np.nan_to_num(np.square(residual) - 1.0) * seen[:, None] * e.weight
    # of a channel that is well, chance leaves nothing: little is enough to look at it somewhere
    return np.maximum(beyond, 0.01 * seen[:, None])


def _by_name(values: Array, channels: Sequence[str], names: Sequence[str]) -> Array:
    """Columns (N, c), one for each of `channels`, by their order in `names`."""
    out = np.zeros((len(values), len(names)))
    out[:, [names.index(c) for c in channels]] = values
    return out


def _value_of(e: TakeEvidence, shares: Array, until: float) -> float:
    """Value of including a take until then: the root favours errors that were not seen yet."""
    return float(np.sum(np.sqrt(shares[e.since <= until].sum(axis=0))))


def subset_used(evidence: Sequence[TakeEvidence]) -> dict[str, dict[str, float]]:
    """Report of a search that used a part of the data: seconds used, by take; else empty."""
    if all(np.isinf(e.until) for e in evidence if e.take.spec.use != "validate"):
        return {}
    return {"searched": {e.name: round(e.until, 1) for e in evidence if e.until > 0}}


def floors_everywhere(evidence: Sequence[TakeEvidence], floors: Mapping[int, Array]) -> dict[int, Array]:
    """Floors (c,) over sigma by take; of a take that was not looked at, the greatest of its channels' in others of its base."""
    known = {i: f for i, f in floors.items() if evidence[i].until > 0}
    out = dict(known)
    for i in set(floors) - set(known):
        e = evidence[i]
        others = [dict(zip(evidence[k].channels, (f * evidence[k].sigma).tolist())) for k, f in known.items()
                  if evidence[k].take.spec.base == e.take.spec.base]
        out[i] = np.array([max((o.get(c, 0.0) for o in others), default=0.0) for c in e.channels]) / e.sigma
    return out
