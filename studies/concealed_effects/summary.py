"""All scores together: the numbers by which the trial is judged."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import beta

from studies.concealed_effects.score import Score

BINS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)


@dataclass(frozen=True)
class Bin:
    """Findings of a range of confidence. low, high: 95 % of the share that is true (Clopper and Pearson, 1934)."""

    confidence: float
    findings: int
    true: int
    low: float
    high: float

    @property
    def holds(self) -> bool:
        """Whether the diagonal is inside."""
        return self.low <= self.confidence <= self.high


def reliability(scores: Sequence[Score]) -> list[Bin]:
    """Bins of the confidences of all findings that count; empty ones left out."""
    pairs = [p for s in scores for p in s.calibration]
    out = []
    for low, high in itertools.pairwise(BINS):
        mine = [(c, t) for c, t in pairs if low <= c < high or c == high == BINS[-1]]
        if mine:
            k, n = sum(t for _, t in mine), len(mine)
            out.append(Bin(float(np.mean([c for c, _ in mine])), n, k, float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0,
                           float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0))
    return out


def confusion(scores: Sequence[Score]) -> Counter[tuple[str, str]]:
    """(true, called) -> how often; called its own name, another, or "abstained"; a tie that holds it is its own name."""
    return Counter((true, true if called.startswith("tie:") else called) for s in scores for true, called in s.named)


def summary(scores: Sequence[Score]) -> dict[str, Any]:
    """The numbers of `Shown by`; None where there is nothing to count."""
    named = [(t, c) for s in scores for t, c in s.named]
    hits = sum(c == t or c.startswith("tie:") for t, c in named)
    placed = [p for s in scores for p in s.placed]
    sizes = [p for s in scores for p in s.parameters if p.effect != "dropped_command"]
    quiet = [s for s in scores if not s.truth]
    several = [s for s in scores if len(s.truth) > 1]
    masked = [s for s in several if s.masked]
    in_masked = [c == t or c.startswith("tie:") for s in masked for t, c in s.named]
    closed = [c for s in scores for c in s.closed.values() if c is not None]
    return {
        "sessions": len(scores), "effects": len(named), "named": _share(hits, len(named)),
        "named_exactly": _share(sum(c == t for t, c in named), len(named)), "placed": _mean(placed),
        "quiet_sessions": len(quiet), "false_alarms_in_quiet": sum(len(s.false_alarms) for s in quiet),
        "false_alarms_elsewhere": sum(len(s.false_alarms) for s in scores if s.truth),
        "outside_sessions": sum(s.outside for s in scores), "outside_explained": sum(s.wrongly_explained for s in scores),
        "named_in_masked": _mean(in_masked),
        "masked_sessions": len(masked), "median_size_error": None if not sizes else float(np.median([p.error for p in sizes])),
        "coverage": _mean([p.inside for p in sizes]), "bounded": _mean([p.bounded for p in sizes]), "gap_closed": _mean(closed),
        "median_seconds": None if not scores else float(np.nanmedian([s.seconds for s in scores])),
        "reliability": [vars(b) | {"holds": b.holds} for b in reliability(scores)],
    }


def _share(k: int, n: int) -> float | None:
    return k / n if n else None


def _mean(x: Sequence[float | bool]) -> float | None:
    return float(np.mean(x)) if len(x) else None
