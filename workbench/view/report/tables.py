"""Tables of a diagnosis: rejected candidates, and rows that are folded away."""

from __future__ import annotations

import math
from collections.abc import Sequence

from workbench.identify.results.findings import Finding, Rejected
from workbench.identify.results.reasons import LessLikely
from workbench.view.report.page import Details, Part, Table, Text
from workbench.view.report.words import change, in_words, join_words, name_of, unbroken

SHOWN = 6
"""Number of rows shown; the rest are folded away."""


def rejected_table(rejected: Sequence[Rejected], summary: str) -> list[Part]:
    """A table; without a column of errors where none was measured."""
    measured = any(r.validation is not None for r in rejected)
    header = ["effect", "where", *(["error on unseen stretches"] if measured else []), "why rejected"]
    rows = [[unbroken(name_of(r.effect)), place_of(r.where), *([_left_by(r)] if measured else []), in_words(r.reason)]
            for r in sorted(rejected, key=_unlikely)]
    parts = folded_table(header, rows, summary)
    if any(r.reason.of_chi_squared for r in rejected):
        parts.append(Text("Chi squared is the sum of squared errors, each divided by its noise: smaller is a better fit."))
    return parts


def _unlikely(r: Rejected) -> float:
    """Sorted by closeness to the finding; those judged by another criterion follow in their own order."""
    return r.reason.behind if isinstance(r.reason, LessLikely) else math.inf


def _left_by(r: Rejected) -> str:
    """Error on unseen stretches before and with it."""
    return "–" if r.validation is None else unbroken(change(r.validation))


def place_of(where: Sequence[str]) -> str:
    """Places on one line."""
    return unbroken(join_words(where) or "whole robot")


def rivals(r: Rejected, finding: Finding) -> bool:
    """Whether it was tried in this finding's place: at the same place, or the same effect elsewhere."""
    return r.where == finding.where or r.effect == finding.effect


def folded_table(header: list[str], rows: list[list[str]], summary: str) -> list[Part]:
    """A table of which rows beyond SHOWN are folded away under `summary`."""
    parts: list[Part] = [Table(header, rows[:SHOWN])]
    if len(rows) > SHOWN:
        parts.append(Details(f"{len(rows) - SHOWN} {summary}", [Table(header, rows[SHOWN:])]))
    return parts
