"""Results as a few lines of HTML, for a notebook."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from workbench.compare.metrics import displacement
from workbench.compare.results import Comparison
from workbench.identify.results.findings import Diagnosis
from workbench.recording import Take
from workbench.view.report.comparison import headline

if TYPE_CHECKING:
    from workbench.gait.optimize import Optimized

SHOWN = 5
"""Joints of a take."""


def comparison_html(comparison: Comparison) -> str:
    """The result in a sentence and, for each take, the joints that differ most."""
    rows = [(take.name, joint, *(_degrees(v) for v in (c.error, c.noise, c.floor)), f"{c.over_noise:.1f}")
            for take in comparison.takes for joint, c in ((j, take.joints[j]) for j in take.joints_by_error()[:SHOWN])]
    header = ("take", "joint", "error", "noise", "numerical floor", "ratio to noise and floor")
    return _paragraph(headline(comparison)) + _table(header, rows)


def diagnosis_html(diagnosis: Diagnosis) -> str:
    """The verdict, and a row for each finding."""
    rows = [(f.effect, " ".join(f.where) or "the robot", f"{f.together:.2f}", f.evidence,
             f"{f.validation.before:.3g} to {f.validation.after:.3g} {f.validation.unit}") for f in diagnosis.findings]
    said = f"Verdict: {diagnosis.verdict.replace('_', ' ')}." + ("" if rows else " Nothing was found.")
    table = _table(("effect", "where", "confidence", "description", "error on unseen stretches"), rows) if rows else ""
    return _paragraph(said) + table


def gait_html(result: Optimized) -> str:
    """The certificate's summary, or why there is none."""
    said = [] if result.certified is None else result.certified.certificate.summary().splitlines()
    return "".join(_paragraph(line) for line in (*([result.problem] if result.problem else []), *said))


def prediction_html(takes: Sequence[Take], paths: Sequence[Path], left_out: Sequence[tuple[str, str]]) -> str:
    """A row for each predicted take, and for each that was left out. takes and paths: in the same order."""
    rows = [(take.name, f"{take.since_start[-1]:.2f} s", _distance(take), str(path)) for take, path in zip(takes, paths)]
    said = "".join(_paragraph(f"Left out: {name}: {reason}") for name, reason in left_out)
    return _table(("take", "length", "distance", "file"), rows) + said


def _distance(take: Take) -> str:
    """How far the base went, straight and in the plane, from its rest before the first command."""
    if take.base != "free" or take.p_WB is None:
        return "–"
    return f"{np.hypot(*displacement(take.p_WB, take.since_start)[:2]):.3f} m"


def _degrees(radians: float) -> str:
    return "" if math.isnan(radians) else f"{math.degrees(radians):.2f}°"


def _paragraph(text: str) -> str:
    return f"<p>{html.escape(text)}</p>"


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    def row(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in cells) + "</tr>"

    return f"<table>{row(header, 'th')}{''.join(row(r, 'td') for r in rows)}</table>"
