"""A finding on the page of a diagnosis: evidence, intervals, the figure that shows it best, rejected alternatives."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from workbench.identify.results.findings import Finding, Rejected
from workbench.identify.results.take_report import TakeReport
from workbench.view.figures.gap import before_after
from workbench.view.report.page import Part, Picture, Section, Table, Text
from workbench.view.report.tables import rejected_table, rivals
from workbench.view.report.words import capital, change, intervals_of, probable, sentence_of, title_of, unbroken


def finding_section(finding: Finding, rejected: Sequence[Rejected], takes: Sequence[TakeReport], drawn: set[tuple[int, str]],
                    others: Collection[str]) -> Section:
    """One finding. drawn: takes and joints that the page has a figure of; this section's is added. others: places of the other
    findings."""
    said = sentence_of(finding)
    parts: list[Part] = [Text(said)]
    if finding.evidence not in said:
        parts.append(Text(finding.evidence.removeprefix(said).strip()))
    sure = probable(finding.confidence)
    for a in finding.alternatives:
        parts.append(Text(f"**Or {title_of(a.effect, a.where)}: {probable(a.confidence)}.** These recordings alone do not rule "
                          "that out."))
        sure += f", or {title_of(a.effect, a.where)} {probable(a.confidence)}"
    if finding.tie:
        sure += f"; together {probable(finding.together)}"
    if finding.of_tie is not None:
        sure += f"; one of several explanations of the ratio of gravity to torque, together {probable(finding.of_tie)}"
    f = finding.family
    family = [] if f is None else [["probability of the effect family", f"{f.name}: {probable(f.confidence)}"]]
    rows = [["probability", sure], *family, *(row for name, e in finding.parameters.items() for row in intervals_of(name, e))]
    rows += [["error on fitted stretches", change(finding.fit)], ["error on unseen stretches", change(finding.validation)]]
    parts.append(Table(["", "value (90 % interval)"], [[unbroken(name), value] for name, value in rows]))
    shown = _best_view(finding, takes, drawn, others)
    if shown is not None:
        i, joint = shown
        drawn.add(shown)
        parts.append(Picture(before_after(takes[i], joint),
                             f"{joint} in {takes[i].name}: recording, and prediction of each model."))
    instead = [r for r in rejected if rivals(r, finding)]
    if instead:
        parts.append(Text("Alternatives that were tried and rejected:"))
        parts += rejected_table(instead, "more alternatives")
    return Section(capital(title_of(finding.effect, finding.where)), parts)


def _best_view(finding: Finding, takes: Sequence[TakeReport], drawn: set[tuple[int, str]], others: Collection[str]
               ) -> tuple[int, str] | None:
    """The take and joint on which the finding shows most: its own joint, else the one that improved most of those that are no
    place of another finding; one that is not yet drawn, if there is any."""
    found = [(_gain(s, c), i, c) for i, s in enumerate(takes) for c in s.channels if c in s.recorded.joints]
    own = [f for f in found if f[2] in finding.where] or [f for f in found if f[2] not in others]
    new = [f for f in own or found if f[1:] not in drawn]
    if not found:
        return None
    _, i, joint = max(new or own or found)
    return i, joint


def _gain(take: TakeReport, channel: str) -> float:
    return finite(take.ratios(take.before)[channel]) - finite(take.ratios(take.after)[channel])


def finite(x: float) -> float:
    """The number, 0 for one that is not finite."""
    return x if math.isfinite(x) else 0.0
