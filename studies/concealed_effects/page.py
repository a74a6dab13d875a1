"""The trial as one page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from studies.concealed_effects.figures import confusion_figure, reliability_figure, sizes_figure, time_figure
from studies.concealed_effects.score import Score
from studies.concealed_effects.summary import Criterion, bounds, by_effect, confusion, criteria, reliability, sizes
from workbench.view.report.page import Details, Part, Picture, Provenance, Report, Section, Table, Text

ABOUT = (
    "Robots of another engine (MuJoCo, with servo law, firmware, contact and cameras of its own, and none of the workbench's "
    "physics), in each of which nothing, one, two or three effects were hidden, or physics without a name. A generator "
    "drew them from a seed that the operating system gave; the truth was sealed, and its hash written down, before the first "
    "diagnosis. Half of the robots with several effects hide one by another that pulls the other way, so that the distance "
    "walked looks right. **Simulated throughout: no number here is a measurement of a robot.**")


def write_page(path: Path, scores: Sequence[Score], result: Mapping[str, Any]) -> Path:
    """Writes the page; `result`: the summary that `trial.report` writes with it."""
    asked = criteria(scores)
    report = Report("Concealed effects", headline(asked, result), ABOUT, _key_numbers(result), _provenance(result))
    report.add(Section("Required and reached", [criteria_table(asked), Text(_remarks(result))]))
    if not scores:
        return report.write(path)
    counts, bins, given = confusion(scores), reliability(scores), sizes(scores)
    if counts:
        report.add(Section("Confusion matrix", [Picture(confusion_figure(counts), (
            "Hidden effects down, named effects across. **Green**: their own name, alone or as one of a tie of "
            "two. **Orange**: another name at the right joint or link, and, in the last row, all findings that match nothing, "
            "those of the other orange cells among them. **Grey**: no finding, or no result.")), _effects_table(scores)]))
    if bins:
        report.add(Section("How sure, and how often right", [Picture(reliability_figure(bins), (
            "Findings by the confidence that they state. A bar is the 95 % interval (Clopper and Pearson) of the share that is "
            "true; green where it contains the diagonal. A finding at physics outside the vocabulary counts as false here."))]))
    if given:
        report.add(Section("Sizes", [Picture(sizes_figure(given), (
            "Each size that was given for an effect that is there, in a row from small to large: error relative to the truth, "
            "and the 90 % interval, green where it covers the truth. Shaded: 15 %."))]))
    report.add(Section("Time", [Picture(time_figure([s.seconds for s in scores], [s.memory for s in scores]),
                                        "Wall time of each diagnosis, and the most memory that it held.")]))
    report.add(Section("Every session", [Details(f"{len(scores)} sessions: hidden effects and findings",
                                                 [_sessions_table(scores)])]))
    return report.write(path)


def headline(asked: Sequence[Criterion], result: Mapping[str, Any]) -> str:
    """How it stands, in one sentence."""
    n, planned = result["diagnosed"], result["planned"]
    if n == 0:
        return f"Nothing is diagnosed yet: 0 of {planned} sessions."
    met = f"{sum(bool(c.met) for c in asked)} of the {len(asked)} requirements are met"
    said = f"{met}, over {n} sessions." if n == planned else f"A partial trial, {n} of {planned} sessions: {met} so far."
    return said if result["seed_drawn_by"] == "os.urandom" else said + " The seed was chosen by hand: this is no trial."


def criteria_table(asked: Sequence[Criterion]) -> Table:
    """Targets and results."""
    words = {True: "yes", False: "**no**", None: "–"}
    rows = [[text.replace(" %", "\u00a0%") for text in (c.what, c.asked, c.got)] for c in asked]
    return Table(["", "required", "reached", "met"], [[*row, words[c.met]] for row, c in zip(rows, asked)])


def _remarks(result: Mapping[str, Any]) -> str:
    said = [f"{result['quiet']} of the sessions hide nothing, {result['outside']} hide physics outside the vocabulary, "
            f"{result['two_or_more']} hide two effects or more, of which {result['masked']} are masked."]
    if result["named_in_masked"] is not None:
        said.append(f"In masked sessions {100 * result['named_in_masked']:.0f} % of the effects were identified.")
    if result["gap_closed"] is not None:
        said.append(f"On held-out takes, the fitted models close {100 * result['gap_closed']:.0f} % of the gap "
                    "(median).")
    said.append(f"False alarms in sessions that do hide something: {result['false_alarms_elsewhere']}.")
    if result["failed"]:
        said.append(f"Failed diagnoses: {result['failed']}; all effects hidden in them count as missed.")
    if len(result["code"]) > 1:
        by = ", ".join(f"{n} by {code}" for code, n in result["code"].items())
        said.append(f"**The workbench changed during the trial**: {by}.")
    return " ".join(said)


def _key_numbers(result: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    numbers = [("sessions", f"{result['diagnosed']} of {result['planned']}", f"{result['failed']} failed")]
    numbers += [(c["what"].split(",")[0] if i == 0 else "at the right joint or link", f"{100 * c['value']:.0f} %", c["asked"])
                for i, c in enumerate(result["criteria"][:2]) if c["value"] is not None]
    if result["seconds"] is not None:
        memory = result["memory"]["most"] / 1e9
        numbers.append(("a diagnosis takes", f"{result['seconds']['median'] / 60:.1f} min", f"median; at most {memory:.1f} GB"))
    return numbers


def _effects_table(scores: Sequence[Score]) -> Part:
    rows = []
    for e in by_effect(scores):
        low, high = bounds(e.exact + e.tied, e.hidden)
        error = f"{100 * median(e.errors):.0f} %" if e.errors else "–"
        between = f"{100 * low:.0f} to {100 * high:.0f} %"
        rows.append([e.effect.replace("_", " "), str(e.hidden), str(e.exact), str(e.tied), between,
                     "–" if e.placed is None else f"{100 * e.placed:.0f} %", error,
                     f"{e.inside} of {len(e.errors)}" if e.errors else "–"])
    header = ["effect", "hidden", "named", "in a tie", "95 % interval", "placed", "error of size, median", "intervals that cover"]
    return Details("Effect by effect", [Table(header, rows)])


def _sessions_table(scores: Sequence[Score]) -> Table:
    rows = [[s.name, s.robot, hidden_in(s) + (" (masked)" if s.masked else ""), s.verdict.replace("_", " "),
             "; ".join(s.said).replace("_", " ") or s.complaint or "–", f"{s.seconds:.0f} s"] for s in scores]
    return Table(["session", "robot", "hidden", "verdict", "said", "took"], rows)


def hidden_in(s: Score) -> str:
    """The hidden effects of a session, in words."""
    words = [f"{h} (outside)" if h.split()[0] in s.outside else h for h in s.hidden]
    return "; ".join(words).replace("_", " ") or "nothing"


def _provenance(result: Mapping[str, Any]) -> Provenance:
    seconds = None if result["seconds"] is None else result["seconds"]["total"]
    more = [("seal", result["sha256_of_all"]), ("seed drawn by", result["seed_drawn_by"])]
    if "seed" in result:
        more.append(("seed", result["seed"]))
    return Provenance(seconds=seconds, more=[*more, ("code", ", ".join(c for c in result["code"] if c))])
