"""The page of a diagnosis, to be read from top to bottom like an engineer's letter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from workbench.compare.channels import BODY, joint_of
from workbench.identify.options import PROBLEM
from workbench.identify.results.findings import Diagnosis, Estimate, GapEntry
from workbench.identify.results.take_report import TakeReport
from workbench.types import Progress
from workbench.view.figures import body_path
from workbench.view.figures.errors import LIMIT
from workbench.view.figures.gap import gap_map, robot_map, unseen_errors
from workbench.view.report.finding import finding_section, finite
from workbench.view.report.page import Details, Part, Picture, Provenance, Report, Section, Text
from workbench.view.report.replays import write_replays
from workbench.view.report.servo_law import recalibrated_section, tied_in_short, tied_section, unknown_torque_section
from workbench.view.report.tables import folded_table, place_of, rejected_table, rivals
from workbench.view.report.words import (
    capital,
    headline,
    hidden_effects,
    in_words,
    interval,
    is_error,
    join_words,
    layers_of,
    left_row,
    next_said,
    probable,
    quantity,
    rival_of,
    said_aside,
    sentence_of,
    this_or,
    title_of,
)

PATH = 0.03
"""A body that moved less than this [m] did not walk."""


def write_diagnosis(diagnosis: Diagnosis, takes: Sequence[TakeReport], folder: Path, title: str,
                    progress: Progress = lambda what, done: None) -> list[Path]:
    """Writes findings.json, model.yaml, nominal.yaml, replay-TAKE.html for each take, and report.html, which contains everything;
    returns their paths. takes: the takes behind the diagnosis; progress: called with the current file and the share done."""
    paths = diagnosis.save(folder)
    report = diagnosis_report(diagnosis, takes, title)
    replays = write_replays(diagnosis, takes, folder, progress)
    paths += [folder / f"replay-{take.name}.html" for take in takes]
    if replays:
        report.add(Section("See it move", replays))
    return [report.write(folder / "report.html"), *paths]


def diagnosis_report(diagnosis: Diagnosis, takes: Sequence[TakeReport], title: str) -> Report:
    """The page without its replays."""
    known = dict(diagnosis.provenance)
    seed, seconds = known.pop("seed", None), known.pop("seconds", None)
    for name in ("cannot_show", "set_aside"):  # in the summary
        known.pop(name, None)
    more = [(k, ", ".join(f"{a} {b}" for a, b in v.items()) if isinstance(v, dict) else str(v))
            for k, v in known.items() if k not in ("workbench", "drake", "model_sha256")]
    report = Report(title, headline(diagnosis), _summary(diagnosis, takes), _key_numbers(diagnosis, takes),
                    Provenance(diagnosis.nominal.sha256, seed, seconds, more))
    report.add(_where(diagnosis, takes))
    drawn: set[tuple[int, str]] = set()
    if diagnosis.tied:
        report.add(tied_section(diagnosis.tied))
    for finding in diagnosis.findings:
        elsewhere = {place for f in diagnosis.findings if f is not finding for place in f.where}
        report.add(finding_section(finding, diagnosis.rejected, takes, drawn, elsewhere))
    for unknown in diagnosis.unknown_torques:
        report.add(unknown_torque_section(unknown))
    if diagnosis.recalibrated:
        report.add(recalibrated_section(diagnosis.recalibrated))
    if takes:
        report.add(_unseen(takes))
    report.add(_residuals_section(diagnosis))
    others = [r for r in diagnosis.rejected if not any(rivals(r, f) for f in diagnosis.findings)]
    if others:
        report.add(Section("What else was tried", rejected_table(others, "more rejected effects")))
    if diagnosis.next_experiment is not None:
        report.add(_next(diagnosis))
    return report


def _summary(diagnosis: Diagnosis, takes: Sequence[TakeReport]) -> str:
    what = [*(tied_in_short(t) for t in diagnosis.tied),
            *(sentence_of(f) for f in diagnosis.findings if f.of_tie is None),
            *(u.evidence for u in diagnosis.unknown_torques)]
    seconds = sum(s.time[-1] for s in takes)
    if takes:
        what.append(f"Evaluated on stretches of {join_words([s.name for s in takes])} ({seconds:.0f} s in all) that "
                    "were held out from the choice of effects and from every fit. **1×** is the error that measurement noise, "
                    "numerical error and the choice of contact model alone would cause.")
    if any(c in BODY for s in takes for c in s.channels):
        what.append(
            "Walking is chaotic: for evaluation, a simulated walk is reset to the recorded base every "
            f"{PROBLEM.window:g} s; paths and 3D show it without these resets."
        )
    if seen := diagnosis.provenance.get("searched"):
        what.append(f"The search used the {sum(seen.values()):.0f} s of these with the largest errors "
                    f"({join_words(list(seen))}).")
    what += [f"Take {name} was left out: {reason}" for name, reason in diagnosis.left_out]
    what += [f"Log {name}: {note}." for name, notes in diagnosis.provenance.get("logs", {}).items() for note in notes
             if "stamped" in note]
    what += said_aside(diagnosis.provenance)
    what += hidden_effects(diagnosis.provenance.get("cannot_show", {}))
    if why := diagnosis.provenance.get("engine", {}).get("because"):
        what.append(f"Drake computed all rollouts, because {why}.")
    if diagnosis.stopped:
        what.append("The search reached its work limit before it had examined all residuals.")
    return " ".join(what)


def _key_numbers(diagnosis: Diagnosis, takes: Sequence[TakeReport]) -> list[tuple[str, str, str]]:
    numbers = [(f"gravity / torque at {join_words(t.where)}", f"{t.ratio.value:.2f}×",
                f"{interval(t.ratio)}; possible causes: {len(t.competitive) + t.may_be_torque}"
                + (", alone or together" if t.may_be_several else "")) for t in diagnosis.tied]
    for f in (f for f in diagnosis.findings if f.of_tie is None):
        rival = rival_of(f)
        sure = f"probability {probable(f.together)}" + (
            f" {this_or(f.tie)}" if f.tie else
            f"; or {title_of(rival.effect, rival.where)}: {probable(rival.confidence)}" if rival else "")
        told = max(f.parameters.values(), key=_is_bounded, default=None)
        numbers.append((title_of(f.effect, f.where), "present" if told is None else _size(told), sure))
    for s in takes:
        before, after = s.ratios(s.before), s.ratios(s.after)
        worst = max(before, key=lambda c: finite(before[c]))
        numbers.append((f"{s.name}: worst channel, {worst}", f"{before[worst]:.1f}× → {after[worst]:.1f}×",
                        "on unseen stretches"))
    return numbers[:8]


def _is_bounded(e: Estimate) -> bool:
    """Whether the data constrain it."""
    return bool(np.isfinite([e.low, e.high]).any())


def _size(e: Estimate) -> str:
    return quantity(math.hypot(*e.value) if isinstance(e.value, tuple) else e.value, e.unit)


def _where(diagnosis: Diagnosis, takes: Sequence[TakeReport]) -> Section:
    parts: list[Part] = []
    if takes:
        worst = {c: max((finite(s.ratios(s.before).get(c, math.nan)) for s in takes), default=0.0)
                 for s in takes for c in s.channels}
        ledger = sorted(diagnosis.gap, key=lambda g: -g.error / g.floor if g.floor > 0 else -math.inf)
        over = list(dict.fromkeys(place for g in ledger for place in g.where))
        over = over or sorted((c for c in worst if worst[c] > LIMIT), key=lambda c: -worst[c])
        named = over if len(over) < 6 else [*over[:4], f"{len(over) - 4} more places"]
        if over and diagnosis.verdict != "no_gap":
            said = f"The recordings differ from the nominal model at {join_words(named)}. {layers_of(diagnosis)}".strip()
        else:
            said = "The recordings do not differ from the nominal model by more than chance" + (
                "; the table shows the closest candidates." if diagnosis.gap else ".")
        parts.append(Text(said))
        at_joints: dict[str, float] = {}
        for c, ratio in worst.items():
            at_joints[joint_of(c)] = max(at_joints.get(joint_of(c), 0.0), ratio)
        parts.append(Picture(robot_map(diagnosis.nominal, at_joints),
                             "Error of each joint with the nominal model. An error in one joint also affects others."))
    if diagnosis.gap:
        header = ["layer", "where", "take", "when [s]", "phase", "error", "noise"]
        parts += folded_table(header, [_gap_row(g) for g in diagnosis.gap], "more places and times")
    maps = [Picture(gap_map(s), _map_caption(s)) for s in sorted(takes, key=_worst, reverse=True)]
    parts += maps[:1]
    if maps[1:]:
        parts.append(Details("Error maps of the other takes", maps[1:]))
    return Section("Where the recordings differ from the model", parts)


def _map_caption(take: TakeReport) -> str:
    said = (f"{take.name}: each row is a joint or a motion of the body; the darker, the larger the error of the model. "
            "Green bar at the top: held-out stretches. Grey: not recorded")
    if any(c in BODY for c in take.channels):
        said += f", or right after the model's base was reset to the recorded one (every {PROBLEM.window:g} s)"
    return said + "."


def _worst(take: TakeReport) -> float:
    return max(map(finite, take.ratios(take.before).values()))


def _gap_row(g: GapEntry) -> list[str]:
    when = ", ".join(f"{a:.1f} to {b:.1f}" for a, b in g.when[:3]) + (" …" if len(g.when) > 3 else "")
    return [g.layer, place_of(g.where), g.take, when, g.phase or "–", quantity(g.error, g.unit), quantity(g.floor, g.unit)]


def _unseen(takes: Sequence[TakeReport]) -> Section:
    over = {s.name: [c for c, r in s.ratios(s.after).items() if r > LIMIT] for s in takes}
    said = "; ".join(f"in {name} {join_words(places)}" for name, places in over.items() if places)
    parts: list[Part] = [Picture(
        unseen_errors(takes),
        f"With the findings applied, still above {LIMIT:g} times noise and numerical error: {said}." if said else
        f"With the findings applied, every channel is within {LIMIT:g} times noise and numerical error.")]
    parts += [Picture(body_path(s.fitted, s.recorded, {"nominal": s.nominal}),
                      f"{s.name}: the body's path as measured, and simulated with and without (nominal) the findings.")
              for s in takes if _walks(s)]
    return Section("Before and after, on unseen stretches", parts)


def _walks(take: TakeReport) -> bool:
    """Whether the body's path is worth a figure."""
    p = take.recorded.p_WB
    return take.recorded.base == "free" and p is not None and bool(np.nanmax(np.ptp(p[np.isfinite(p[:, 0]), :2], axis=0)) > PATH)


def _residuals_section(diagnosis: Diagnosis) -> Section:
    if not diagnosis.unexplained:
        nothing = diagnosis.verdict in ("no_gap", "explained")
        return Section("Residuals", [Text("No residual exceeds noise and numerical error." if nothing else
                                             "Errors that still exceed the green band above are unexplained.")])
    order = sorted(diagnosis.unexplained, key=lambda u: -u.error / u.floor if u.floor > 0 else -math.inf)
    header = ["remaining error", "take", "size", "ratio to noise", "correlation"]
    off = [left_row(u) for u in order if is_error(u)]
    still = [Text("On unseen stretches the fitted model still has errors above noise and numerical error (1×), "
                  "which none of the effects that were tried explains."), *folded_table(header, off, "more")] if off else []
    return Section("Residuals", [*still, *(Text(f"{capital(in_words(u.description))}.") for u in order if not is_error(u))])


def _next(diagnosis: Diagnosis) -> Section:
    assert diagnosis.next_experiment is not None
    return Section("What to record next", [Text(next_said(diagnosis.next_experiment))])
