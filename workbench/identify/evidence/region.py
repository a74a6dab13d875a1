"""A region: channels that are judged together, and the candidates that may act there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from workbench.identify.evidence.likelihood import Likelihood, correlation_time
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.parameters import Candidate
from workbench.identify.problem import TakeEvidence
from workbench.types import Array, Mask

if TYPE_CHECKING:
    from workbench.identify.evidence.hypothesis import Uncertain

SPAN = 0.02
"""Between the frames that are looked at [s]: neighbours closer than that tell the same."""
LOST = 1.0
"""Residual of a rollout that diverged [rad]."""


@dataclass(frozen=True)
class Part:
    """Part of one take (index): rows (N,): frames that count; columns: of its channels; seen (rows, c): where there is a
    recording; scale (c,) or (rows, c): of the take's residuals [rad]; every: one frame in so many; span: time per frame [s]."""

    take: int
    rows: Mask
    columns: NDArray[np.int_]
    seen: Mask
    scale: Array
    every: int
    span: float

    @property
    def size(self) -> int:
        """How many residuals there are."""
        return int(self.seen.sum())

    def residuals(self, of_take: Array) -> Array:
        """(n,) [rad]; of_take (N, channels): over sigma."""
        return np.asarray((of_take[self.rows][:, self.columns] * self.scale)[self.seen])

    def series(self, r: Array) -> list[Array]:
        """Residuals r (n,) as a series at even times for each channel, NaN where unseen."""
        values = np.full(self.seen.shape, np.nan)
        values[self.seen] = r
        whole = np.full((len(self.rows), len(self.columns)), np.nan)
        whole[self.rows] = values
        return list(whole[::self.every].T)


@dataclass(frozen=True)
class Region:
    """Joints that are judged together. numbers: of the nominal law; candidates: effects that could act there."""

    joints: tuple[str, ...]
    parts: tuple[Part, ...]
    numbers: tuple[Uncertain, ...]
    candidates: tuple[Candidate, ...]
    likelihood: Likelihood

    def vector(self, residuals: Mapping[int, Array]) -> Array:
        """Residuals (n,) [rad] of the frames that count; residuals: over sigma, by take."""
        r = np.concatenate([p.residuals(residuals[p.take]) for p in self.parts])
        return np.clip(np.nan_to_num(r, nan=LOST), -LOST, LOST)

    @property
    def takes(self) -> NDArray[np.int_]:
        """The take of each residual of `vector` (n,)."""
        return np.concatenate([np.full(p.size, p.take) for p in self.parts])

    def of(self, takes: Sequence[int]) -> Mask:
        """Which residuals are of some takes (n,)."""
        return np.asarray(np.isin(self.takes, takes))

    def correlation(self, r: Array) -> float:
        """Correlation time [s] of residuals (n,); the largest are cut, as an event is none of it."""
        series, at = [], 0
        most = 4 * float(np.median(np.abs(r))) + 1e-12
        for p in self.parts:
            series += [(x, p.span) for x in p.series(np.clip(r[at:at + p.size], -most, most))]
            at += p.size
        return correlation_time(series)

    def with_correlation_time(self, tau: float) -> Region:
        """The region with a correlation time [s]."""
        return replace(self, likelihood=replace(self.likelihood, tau=tau))

    def of_takes(self, takes: Sequence[int]) -> Region:
        """The region judged by some of its takes."""
        mine = self.of(takes)
        likelihood = replace(self.likelihood, known=self.likelihood.known[mine], span=self.likelihood.span[mine])
        return replace(self, parts=tuple(p for p in self.parts if p.take in takes), likelihood=likelihood)


def region_of(joints: Sequence[str], evidence: Sequence[TakeEvidence], numbers: Sequence[Uncertain],
              candidates: Sequence[Candidate], options: EvidenceOptions) -> Region:
    """Some joints on all takes that are not for validation, frames at most every SPAN."""
    parts, known, spans = [], [], []
    for i, e in enumerate(evidence):
        columns = np.array([k for k, c in enumerate(e.channels) if c in joints], dtype=int)
        every = max(1, round(SPAN / e.frame_time))
        rows = (e.uses["fit"] | e.uses["choose"]) & (np.arange(len(e.since)) % every == 0) & (e.since <= e.until)
        if not len(columns) or not rows.any():
            continue
        seen = np.isfinite(e.recorded[rows][:, columns])
        scale = np.broadcast_to(e.sigma * e.rough, e.recorded.shape)[rows][:, columns]
        parts.append(Part(i, rows, columns, seen, scale, every, every * e.frame_time))
        known.append(scale[seen])
        spans.append(np.full(int(seen.sum()), parts[-1].span))
    span = np.concatenate(spans)
    between = (options.least_discrepancy, options.most_discrepancy)
    likelihood = Likelihood(np.concatenate(known), span, float(np.median(span)) / 2, options.tails, between)
    return Region(tuple(joints), tuple(parts), tuple(numbers), tuple(candidates), likelihood)
