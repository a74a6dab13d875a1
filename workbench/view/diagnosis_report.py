"""The page of a diagnosis, to be read from top to bottom like an engineer's letter."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from workbench.effects.registry import effect_named
from workbench.gap.findings import Change, Diagnosis, Estimate, Finding, GapEntry, Rejected
from workbench.gap.story import TakeStory
from workbench.robot import EffectSpec
from workbench.view.error_figures import LIMIT
from workbench.view.figures import body_path, film_strip
from workbench.view.gap_figures import before_after, gap_map, robot_map, unseen_errors
from workbench.view.report import Details, Part, Picture, Provenance, Replay, Report, Section, Table, Text
from workbench.view.scene import write_replay

SHOWN = 6
"""Rows of a table that stand open; the rest is folded away."""
PATH = 0.03
"""A body that moved less far than this did not go anywhere [m]."""
Progress = Callable[[str, float | None], None]


def write_diagnosis(diagnosis: Diagnosis, stories: Sequence[TakeStory], folder: Path, title: str,
                    progress: Progress = lambda what, done: None) -> list[Path]:
    """Writes findings.json, model.yaml, nominal.yaml, replay-TAKE.html for each take, and report.html, which holds all of it;
    returns their paths. stories: the takes behind the diagnosis; progress: called with what is being made and the share done."""
    paths = diagnosis.save(folder)
    report = diagnosis_report(diagnosis, stories, title)
    replays: list[Part] = []
    for i, story in enumerate(stories):
        progress(f"drawing {story.name}", i / len(stories))
        paths.append(folder / f"replay-{story.name}.html")
        write_replay(paths[-1], diagnosis.model, story.fitted, story.recorded, title=story.name)
        replays.append(Replay(paths[-1], f"{story.name} in 3D: the fitted model solid, the recorded robot as a ghost.",
                              film_strip(diagnosis.model, story.fitted, story.recorded)))
    if replays:
        report.add(Section("See it move", replays))
    return [report.write(folder / "report.html"), *paths]


def diagnosis_report(diagnosis: Diagnosis, stories: Sequence[TakeStory], title: str) -> Report:
    """The page without its replays."""
    known = dict(diagnosis.provenance)
    seed, seconds = known.pop("seed", None), known.pop("seconds", None)
    more = [(k, str(v)) for k, v in known.items() if k not in ("workbench", "drake", "model_sha256")]
    report = Report(title, headline(diagnosis), _summary(diagnosis, stories), _key_numbers(diagnosis, stories),
                    Provenance(diagnosis.nominal.sha256, seed, seconds, more))
    report.add(_where(diagnosis, stories))
    for finding in diagnosis.findings:
        report.add(_finding(finding, diagnosis.rejected, stories))
    if stories:
        report.add(_unseen(stories))
    report.add(_left(diagnosis))
    others = [r for r in diagnosis.rejected if not any(_rivals(r, f) for f in diagnosis.findings)]
    if others:
        report.add(Section("What else was tried", _folded(_REJECTED, [_rejected_row(r) for r in others], "more that were tried")))
    if diagnosis.next_experiment is not None:
        report.add(_next(diagnosis))
    return report


def headline(diagnosis: Diagnosis) -> str:
    """The verdict in one sentence."""
    names = _listed([title_of(f.effect, f.where) for f in diagnosis.findings])
    explain = f"{_capital(names)} explain{'s' if len(diagnosis.findings) == 1 else ''}"
    match diagnosis.verdict:
        case "no_gap":
            return "The model explains these recordings as they are: nothing is missing that they could show."
        case "explained":
            return f"{explain} all that the model missed."
        case "partly_explained":
            return f"{explain} part of what the model missed; the rest has no name yet."
        case "unexplained":
            return "The recordings leave the model, and nothing that the workbench knows explains how."


def title_of(effect: str, where: Sequence[str]) -> str:
    """`joint_compliance`, ("flm",) -> "joint compliance at flm"."""
    return effect.replace("_", " ") + (f" at {_listed(where)}" if where else "")


def sentence_of(finding: Finding) -> str:
    """What is different about this robot, as the effect itself says it."""
    return effect_named(finding.effect).sentence(
        EffectSpec(finding.effect, finding.where, {name: e.value for name, e in finding.parameters.items()}))


def interval(estimate: Estimate) -> str:
    """The value and its 90 % interval; "at least" or "at most" where one side is open."""
    value, low, high = (x if isinstance(x, tuple) else (x,) for x in (estimate.value, estimate.low, estimate.high))
    if len(value) == 1:
        return f"{value[0]:.3g}{_unit(estimate)} ({_bounds(low[0], high[0])})"
    return "; ".join(f"{v:.3g} ({_bounds(a, b)})" for v, a, b in zip(value, low, high)) + _unit(estimate)


def _unit(estimate: Estimate) -> str:
    """Nothing for a ratio."""
    return "" if estimate.unit in ("", "1") else f" {estimate.unit}"


def _bounds(low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return "not bounded by the data"
    if math.isinf(high):
        return f"at least {low:.3g}"
    return f"at most {high:.3g}" if math.isinf(low) else f"{low:.3g} to {high:.3g}"


def _summary(diagnosis: Diagnosis, stories: Sequence[TakeStory]) -> str:
    what = [sentence_of(f) for f in diagnosis.findings]
    seconds = sum(s.time[-1] for s in stories)
    if stories:
        what.append(f"Judged on stretches of {_listed([s.name for s in stories])} ({seconds:.0f} s in all) that no choice and "
                    "no parameter saw. **1×** is what measurement noise, numerics and the choice of contact model make alone.")
    what += [f"Take {name} was left out: {reason}" for name, reason in diagnosis.left_out]
    return " ".join(what)


def _key_numbers(diagnosis: Diagnosis, stories: Sequence[TakeStory]) -> list[tuple[str, str, str]]:
    numbers = []
    for f in diagnosis.findings:
        sure = f"{100 * f.confidence:.0f} %"
        first = next(iter(f.parameters.values()), None)
        value = "is there" if first is None or isinstance(first.value, tuple) else f"{first.value:.3g}{_unit(first)}"
        numbers.append((title_of(f.effect, f.where), value, f"{sure} sure"))
    for s in stories:
        before, after = s.ratios(s.before), s.ratios(s.after)
        worst = max(before, key=lambda c: _finite(before[c]))
        numbers.append((f"{s.name}: worst, {worst}", f"{before[worst]:.1f}× → {after[worst]:.1f}×", "on unseen stretches"))
    return numbers[:8]


def _where(diagnosis: Diagnosis, stories: Sequence[TakeStory]) -> Section:
    parts: list[Part] = []
    if stories:
        worst = {c: max((_finite(s.ratios(s.before).get(c, math.nan)) for s in stories), default=0.0)
                 for s in stories for c in s.channels}
        ledger = sorted(diagnosis.gap, key=lambda g: -g.error / g.floor if g.floor > 0 else -math.inf)
        over = list(dict.fromkeys(place for g in ledger for place in g.where))
        over = over or sorted((c for c in worst if worst[c] > LIMIT), key=lambda c: -worst[c])
        named = over if len(over) < 6 else [*over[:4], f"{len(over) - 4} more places"]
        said = (f"The recordings leave the nominal model at {_listed(named)}." if over and diagnosis.verdict != "no_gap" else
                "Nowhere do the recordings leave the nominal model by more than chance.")
        parts.append(Text(said))
        parts.append(Picture(robot_map(diagnosis.nominal, worst),
                             "Each joint, by how far it leaves the nominal model; one wrong joint moves others."))
    if diagnosis.gap:
        header = ["layer", "where", "take", "when [s]", "phase", "error", "floor"]
        parts += _folded(header, [_gap_row(g) for g in diagnosis.gap], "more places and times")
    maps = [Picture(gap_map(s), f"{s.name}: each row a joint or a motion of the body, darker where it is further from the model. "
                                "Green on top: stretches that no choice saw.") for s in sorted(stories, key=_worst, reverse=True)]
    parts += maps[:1]
    if maps[1:]:
        parts.append(Details("The same map of the other takes", maps[1:]))
    return Section("Where the recordings leave the model", parts)


def _worst(story: TakeStory) -> float:
    return max(map(_finite, story.ratios(story.before).values()))


def _gap_row(g: GapEntry) -> list[str]:
    when = ", ".join(f"{a:.1f} to {b:.1f}" for a, b in g.when[:3]) + (" …" if len(g.when) > 3 else "")
    return [g.layer, _listed(g.where) or "whole robot", g.take, when, g.phase or "–", f"{g.error:.3g} {g.unit}",
            f"{g.floor:.2g} {g.unit}"]


def _finding(finding: Finding, rejected: Sequence[Rejected], stories: Sequence[TakeStory]) -> Section:
    parts: list[Part] = [Text(sentence_of(finding))]
    if finding.evidence:
        parts.append(Text(finding.evidence))
    rows = [["confidence", f"{100 * finding.confidence:.0f} %"]]
    rows += [[name.replace("_", " "), interval(e)] for name, e in finding.parameters.items()]
    rows += [["error where it was fitted", _change(finding.fit)], ["error on unseen stretches", _change(finding.validation)]]
    parts.append(Table(["", "value (90 % interval)"], rows))
    parts += [Text(f"Its rival is **{title_of(a.effect, a.where)}** ({100 * a.confidence:.0f} %): these recordings alone do not "
                   "rule it out.") for a in finding.alternatives]
    shown = _best_view(finding, stories)
    if shown is not None:
        story, joint = shown
        parts.append(Picture(before_after(story, joint), f"{joint} in {story.name}, where the nominal model misses most: what "
                                                         "the robot did, and what each model says it does."))
    rivals = [r for r in rejected if _rivals(r, finding)]
    if rivals:
        parts.append(Text("Tried in its place, and rejected:"))
        parts += _folded(_REJECTED, [_rejected_row(r) for r in rivals], "more rivals")
    return Section(_capital(title_of(finding.effect, finding.where)), parts)


def _best_view(finding: Finding, stories: Sequence[TakeStory]) -> tuple[TakeStory, str] | None:
    """The take and joint on which the finding shows most: its own joint, else the one that improved most."""
    found = [(_gain(s, c), i, c) for i, s in enumerate(stories) for c in s.channels if c in s.recorded.joints]
    own = [f for f in found if f[2] in finding.where]
    if not found:
        return None
    _, i, joint = max(own or found)
    return stories[i], joint


def _gain(story: TakeStory, channel: str) -> float:
    return _finite(story.ratios(story.before)[channel]) - _finite(story.ratios(story.after)[channel])


def _unseen(stories: Sequence[TakeStory]) -> Section:
    over = {s.name: [c for c, r in s.ratios(s.after).items() if r > LIMIT] for s in stories}
    said = "; ".join(f"in {name} {_listed(places)}" for name, places in over.items() if places)
    parts: list[Part] = [Picture(unseen_errors(stories), f"Afterwards still beyond {LIMIT:g} times noise and numerics: {said}."
                                 if said else f"Afterwards all is within {LIMIT:g} times noise and numerics.")]
    parts += [Picture(body_path(s.fitted, s.recorded, {"nominal": s.nominal}),
                      f"{s.name}: the body's path as measured, and simulated with what was found and without (nominal).")
              for s in stories if _walks(s)]
    return Section("Before and after, on what nothing saw", parts)


def _walks(story: TakeStory) -> bool:
    """Whether the body's path is worth a figure."""
    p = story.recorded.p_WB
    return story.recorded.base == "free" and p is not None and bool(np.nanmax(np.ptp(p[np.isfinite(p[:, 0]), :2], axis=0)) > PATH)


def _left(diagnosis: Diagnosis) -> Section:
    if not diagnosis.unexplained:
        nothing = diagnosis.verdict in ("no_gap", "explained")
        return Section("What is left", [Text("Nothing beyond what noise, numerics and chance make." if nothing else
                                             "What is still beyond the green band above has no name yet.")])
    rows = [[_listed(u.where) or "whole robot", f"{u.error:.3g} {u.unit}", f"{u.floor:.2g} {u.unit}", u.description]
            for u in diagnosis.unexplained]
    return Section("What is left", [
        Text("This is beyond noise and numerics and has no name that survived on unseen stretches."),
        *_folded(["where", "error", "floor", "what it depends on"], rows, "more")])


def _next(diagnosis: Diagnosis) -> Section:
    n = diagnosis.next_experiment
    assert n is not None
    pairs = _listed([f"{a.replace('_', ' ')} from {b.replace('_', ' ')}" for a, b in n.separates])
    base = "on the stand" if n.base == "fixed" else "walking freely"
    return Section("What to record next", [
        Text(f"Play `{n.motion}` with the robot {base}. It tells {pairs}, within the servos' limits.")])


_REJECTED = ["effect", "where", "error on unseen stretches", "why not"]


def _rejected_row(r: Rejected) -> list[str]:
    return [r.effect.replace("_", " "), _listed(r.where) or "whole robot",
            "–" if r.validation is None else _change(r.validation), r.reason]


def _rivals(r: Rejected, finding: Finding) -> bool:
    """Whether it was tried in this finding's place: at the same place, or the same effect elsewhere."""
    return r.where == finding.where or r.effect == finding.effect


def _folded(header: list[str], rows: list[list[str]], summary: str) -> list[Part]:
    parts: list[Part] = [Table(header, rows[:SHOWN])]
    if len(rows) > SHOWN:
        parts.append(Details(f"{len(rows) - SHOWN} {summary}", [Table(header, rows[SHOWN:])]))
    return parts


def _change(c: Change) -> str:
    return f"{c.before:.3g} → {c.after:.3g} {c.unit}"


def _listed(words: Sequence[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _finite(x: float) -> float:
    return x if math.isfinite(x) else 0.0
