"""All scores together: the numbers by which the trial is judged."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest

from studies.concealed_effects.score import ParameterScore, Score

BINS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
NOTHING = "nothing there"
"""The row of the confusion matrix that holds false alarms."""


@dataclass(frozen=True)
class Bin:
    """Findings of a range of confidence: the mean confidence, how many, how many true, and the 95 % interval of that share."""

    confidence: float
    findings: int
    true: int
    low: float
    high: float

    @property
    def holds(self) -> bool:
        """Whether the diagonal is inside."""
        return self.low <= self.confidence <= self.high


@dataclass(frozen=True)
class Criterion:
    """One thing that is asked. value: None where nothing could be counted; got: the same in words; met: likewise."""

    what: str
    asked: str
    value: float | None
    got: str
    met: bool | None


@dataclass(frozen=True)
class EffectSummary:
    """All sessions that hide one effect. errors: relative, of sizes that were given; inside: how many intervals cover."""

    effect: str
    hidden: int
    exact: int
    tied: int
    placed: float | None
    errors: tuple[float, ...]
    inside: int


def bounds(k: int, n: int) -> tuple[float, float]:
    """95 % of a share k of n (Clopper and Pearson, 1934)."""
    low, high = binomtest(k, n).proportion_ci(0.95, "exact")
    return float(low), float(high)


def reliability(scores: Sequence[Score]) -> list[Bin]:
    """Counted findings by bin of confidence, without empty bins."""
    pairs = [p for s in scores for p in s.calibration]
    out = []
    for low, high in itertools.pairwise(BINS):
        mine = [(c, t) for c, t in pairs if low <= c < high or c == high == BINS[-1]]
        if mine:
            k, n = sum(t for _, t in mine), len(mine)
            out.append(Bin(float(np.mean([c for c, _ in mine])), n, k, *bounds(k, n)))
    return out


def confusion(scores: Sequence[Score]) -> Counter[tuple[str, str]]:
    """(true, called) -> how often. called: the effect's own name, also in a tie, another's, "abstained" or "failed"; findings
    that fit nothing are in the row NOTHING."""
    hidden = Counter((e.effect, e.effect if e.named else e.called) for s in scores for e in s.effects)
    return hidden + Counter((NOTHING, alarm.split()[0].split("/")[0]) for s in scores for alarm in s.false_alarms)


def by_effect(scores: Sequence[Score]) -> list[EffectSummary]:
    """Each effect that was hidden, in the order of names."""
    out = []
    for name in sorted({e.effect for s in scores for e in s.effects}):
        mine = [e for s in scores for e in s.effects if e.effect == name]
        sizes = [p for s in scores for p in s.parameters if p.effect == name]
        out.append(EffectSummary(name, len(mine), sum(e.named and not e.tie for e in mine), sum(e.tie for e in mine),
                                 _mean([e.share for e in mine if e.share is not None]), tuple(p.error for p in sizes),
                                 sum(p.inside for p in sizes)))
    return out


def sizes(scores: Sequence[Score]) -> list[ParameterScore]:
    """All scalar parameters that were given for effects that are there."""
    return [p for s in scores for p in s.parameters]


def criteria(scores: Sequence[Score]) -> list[Criterion]:
    """The targets of the trial, in order."""
    effects = [e for s in scores for e in s.effects]
    hits, shares = sum(e.named for e in effects), [e.share for e in effects if e.share is not None]
    quiet, outside = [s for s in scores if s.quiet], [s for s in scores if s.outside]
    alarms, explained = sum(len(s.false_alarms) for s in quiet), sum(s.wrongly_explained for s in outside)
    bins, given = reliability(scores), sizes(scores)
    inside, held = sum(p.inside for p in given), sum(b.holds for b in bins)
    median = float(np.median([p.error for p in given])) if given else None
    return [
        _share("effects identified, exactly or as one of a tie of two", "at least 90 %", hits, len(effects), 0.90, 1.0),
        Criterion("of those, at the right joint or link", "at least 95 %", _mean(shares),
                  f"{100 * sum(shares) / len(shares):.0f} % of {len(shares)}" if shares else "–",
                  bool(np.mean(shares) >= 0.95) if shares else None),
        _none("false alarms in quiet sessions", alarms, len(quiet), "in {} sessions"),
        _none("out-of-vocabulary sessions reported as explained", explained, len(outside), "of {}"),
        Criterion("confidence bins whose 95 % interval contains the diagonal", "all", held / len(bins) if bins else None,
                  f"{held} of {len(bins)}", held == len(bins) if bins else None),
        _share("90 % intervals that contain the true size", "85 to 95 %", inside, len(given), 0.85, 0.95),
        Criterion("median relative error of the sizes", "at most 15 %", median,
                  "–" if median is None else f"{100 * median:.0f} %", None if median is None else median <= 0.15),
    ]


def summary(scores: Sequence[Score], planned: int) -> dict[str, Any]:
    """Everything, as plain types; `planned`: how many sessions there are, of which all in `scores` were diagnosed."""
    several = [s for s in scores if len(s.hidden) > 1]
    masked = [e.named for s in several if s.masked for e in s.effects]
    closed = [c for s in scores for c in s.closed.values() if c is not None]
    return {
        "format": 1, "planned": planned, "diagnosed": len(scores), "failed": sum(s.verdict == "failed" for s in scores),
        "quiet": sum(s.quiet for s in scores), "outside": sum(bool(s.outside) for s in scores),
        "two_or_more": len(several), "masked": sum(s.masked for s in several),
        "met": all(c.met for c in criteria(scores)) and len(scores) == planned,
        "criteria": [asdict(c) for c in criteria(scores)],
        "named_in_masked": _mean(masked), "gap_closed": float(np.median(closed)) if closed else None,
        "false_alarms_elsewhere": sum(len(s.false_alarms) for s in scores if not s.quiet),
        "seconds": _spread([s.seconds for s in scores]), "processor_seconds": _spread([s.processor_seconds for s in scores]),
        "memory": _spread([s.memory for s in scores]), "code": dict(Counter(s.code for s in scores)),
        "reliability": [asdict(b) | {"holds": b.holds} for b in reliability(scores)],
        "effects": [asdict(e) | {"errors": list(e.errors)} for e in by_effect(scores)],
        "confusion": [[true, called, n] for (true, called), n in sorted(confusion(scores).items())],
        "sessions": [s.to_json() for s in scores],
    }


def _share(what: str, asked: str, k: int, n: int, least: float, most: float) -> Criterion:
    if not n:
        return Criterion(what, asked, None, "–", None)
    low, high = bounds(k, n)
    return Criterion(what, asked, k / n, f"{100 * k / n:.0f} % ({k} of {n}; 95 % interval {100 * low:.0f} to {100 * high:.0f} %)",
                     least <= k / n <= most)


def _none(what: str, k: int, n: int, of: str) -> Criterion:
    return Criterion(what, "none", float(k) if n else None, f"{k} {of.format(n)}", k == 0 if n else None)


def _spread(values: Sequence[float]) -> dict[str, float] | None:
    known = [v for v in values if np.isfinite(v)]
    if not known:
        return None
    return {"median": float(np.median(known)), "most": float(np.max(known)), "total": float(np.sum(known))}


def _mean(x: Sequence[float | bool]) -> float | None:
    return float(np.mean(x)) if len(x) else None
