"""The results of a trial in the repository: results/trial.json, and a table of it in docs/validation.md."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from studies.concealed_effects.score import Score
from studies.concealed_effects.summary import bounds, by_effect
from workbench.files.reading import read_text, write_whole

RESULTS = Path(__file__).parent / "results" / "trial.json"
PAGE = Path(__file__).parents[2] / "docs" / "validation.md"
SUREST = 0.9
"""Confidence from which a finding counts among the surest."""
BEGIN, END = "<!-- trial: written by `python -m studies.concealed_effects --keep` -->", "<!-- /trial -->"


def keep(result: Mapping[str, Any], results: Path = RESULTS, page: Path = PAGE) -> None:
    """Writes both; ValueError where the page has no place for the table."""
    text = read_text(page)
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    if not after:
        raise ValueError(f"{page}: expected the lines '{BEGIN}' and '{END}'")
    write_whole(results, as_text(result))
    write_whole(page, f"{before}{BEGIN}\n{section(result)}{END}{after}")


def kept(results: Path = RESULTS) -> dict[str, Any] | None:
    """The trial that is in the repository, if there is one."""
    return dict(json.loads(read_text(results))) if results.exists() else None


def kept_section(page: Path = PAGE) -> str:
    """The trial's part of the page."""
    return read_text(page).partition(BEGIN + "\n")[2].partition(END)[0]


def as_text(result: Mapping[str, Any]) -> str:
    """JSON with a line for each session and each row of a list."""
    lines = []
    for key, value in result.items():
        if isinstance(value, list):
            inside = ",\n".join("  " + json.dumps(v) for v in value)
            lines.append(f' {json.dumps(key)}: [\n{inside}\n ]' if value else f" {json.dumps(key)}: []")
        else:
            lines.append(f" {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def section(result: Mapping[str, Any] | None) -> str:
    """The table and the remarks below it, in Markdown."""
    if result is None:
        return "No trial has been run yet.\n"
    rows = ["| | required | reached | met |", "|---|---|---|---|"]
    words = {True: "yes", False: "**no**", None: "–"}
    rows += [f"| {c['what']} | {c['asked']} | {c['got']} | {words[c['met']]} |" for c in result["criteria"]]
    others = result["diagnosed"] - result["quiet"]
    rows.append(f"| false findings in the {others} other sessions | – | {result['false_alarms_elsewhere']} | – |")
    scores = [Score.from_json(s) for s in result["sessions"]]
    n, planned = result["diagnosed"], result["planned"]
    partial = "" if n == planned else f"**Partial: {n} of {planned} sessions.** "
    seconds = result["seconds"]
    said = (f"{partial}{n} sessions: {result['quiet']} quiet, {result['outside']} outside the vocabulary, "
            f"{result['two_or_more']} with two effects or more, of which {result['masked']} are masked; "
            f"failed diagnoses: {result['failed']}. ")
    if seconds is not None:
        said += (f"A diagnosis took {seconds['median'] / 60:.1f} minutes (median; longest {seconds['most'] / 60:.1f}) and at "
                 f"most {result['memory']['most'] / 1e9:.1f} GB. ")
    if result["gap_closed"] is not None:
        said += f"The models close {100 * result['gap_closed']:.0f} % of the gap on held-out takes (median). "
    said += _surest(scores) + _by_version(scores)
    drawn = "the operating system" if result["seed_drawn_by"] == "os.urandom" else "hand: this is no trial"
    said += f"Seed drawn by {drawn}; seal {result['sha256_of_all'][:16]}. Every session: concealed_effects/results/trial.json."
    return "\n".join([*rows, "", *_wrapped(said), "", *_effects(scores)]) + "\n"


def _effects(scores: Sequence[Score]) -> list[str]:
    """A row for each effect that was hidden."""
    rows = ["| hidden effect | sessions | identified | in a tie of two | at the right joint or link | median error of the size |",
            "|---|---|---|---|---|---|"]
    for e in by_effect(scores):
        placed = "–" if e.placed is None else f"{100 * e.placed:.0f} %"
        error = f"{100 * median(e.errors):.1f} %" if e.errors else "–"
        rows.append(f"| `{e.effect}` | {e.hidden} | {e.exact} | {e.tied} | {placed} | {error} |")
    return rows


def _surest(scores: Sequence[Score]) -> str:
    """How many of the surest findings are true."""
    surest = [true for s in scores for confidence, true in s.calibration if confidence >= SUREST]
    return f"Of {len(surest)} findings with a confidence of {SUREST} and more, {sum(surest)} are true. " if surest else ""


def _by_version(scores: Sequence[Score]) -> str:
    """Effects named by each version of the workbench, if it was changed during the trial."""
    versions = list(dict.fromkeys(s.code for s in scores))
    if len(versions) < 2:
        return ""
    said = []
    for code in versions:
        own = [s for s in scores if s.code == code]
        effects = [e for s in own for e in s.effects]
        hits = sum(e.named for e in effects)
        low, high = bounds(hits, len(effects))
        said.append(f"{len(own)} sessions by the code with digest {code}, which identified {hits} of {len(effects)} effects "
                    f"(95 % interval {100 * low:.0f} to {100 * high:.0f} %)")
    return f"**The workbench changed during the trial**: {'; '.join(said)}. "


def _wrapped(text: str, width: int = 125) -> list[str]:
    lines = [""]
    for word in text.split():
        if len(lines[-1]) + len(word) >= width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines
