"""The results of a diagnosis in words and readable numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from workbench.compare.channels import ACROSS
from workbench.effects.base import Layer
from workbench.effects.registry import effect_named, known_effects
from workbench.identify.results.findings import Alternative, Change, Diagnosis, Estimate, Finding, NextExperiment, Unexplained
from workbench.identify.results.reasons import Dependence, Statement
from workbench.identify.results.servo_law import GravityOverTorque, Recalibrated
from workbench.robot import EffectSpec

NAMED = 0.1
"""An alternative at least this probable is named together with the finding."""
LAYERS: dict[Layer, str] = {
    "timing": "when commands take effect", "actuator": "how servos behave", "structure": "how links and joints are built",
    "inertia": "how mass is distributed", "ground": "how the floor acts", "measurement": "how the motion was measured"}
_BODY = {"forward": "forward motion of the body", "left": "lateral motion of the body", "heading": "the body's heading",
         "height": "the body's height", "roll": "the body's roll", "pitch": "the body's pitch"}
_SMALL = {"m": ("mm", 1e3), "s": ("ms", 1e3), "kg": ("g", 1e3)}


def headline(diagnosis: Diagnosis) -> str:
    """The verdict in one sentence."""
    likely = [f for f in diagnosis.findings if f.likely]
    names = join_words([_with_rival(f, diagnosis.tied) for f in likely or diagnosis.findings])
    explain = f"{capital(names)} explain{'s' if len(likely) == 1 else ''}"
    match diagnosis.verdict:
        case "no_gap":
            return "The nominal model explains these recordings: they show no missing physics."
        case "explained":
            return f"{explain} the model's entire error."
        case "partly_explained" if not likely:
            return f"No known effect is a likely explanation of the model's error; the closest candidate is {names}."
        case "partly_explained":
            sure = "" if len(likely) == len(diagnosis.findings) else " with certainty"
            return f"{explain} part of the model's error; the rest is not yet identified{sure}."
        case "unexplained" if diagnosis.unknown_torques:
            where = join_words([u.joint for u in diagnosis.unknown_torques])
            return f"An unknown torque at {where}, which no known effect describes, explains at least part of the model's error."
        case "unexplained":
            return "The recordings differ from the model, and no known effect explains the difference."


def hidden_effects(why: Mapping[str, str]) -> list[str]:
    """A sentence for each reason why a session's takes cannot show some effects; why: the reason, by effect and place."""
    by_reason: dict[str, list[str]] = {}
    for effect, reason in why.items():
        by_reason.setdefault(reason, []).append(effect.replace("_", " "))
    return [f"**Not observable here**, because {reason}: {join_words(effects)}." for reason, effects in by_reason.items()]


def _with_rival(f: Finding, tied: Sequence[GravityOverTorque]) -> str:
    if tie := tie_of(f, tied):
        others = [title_of(n.effect, n.where) for n in tie.competitive]
        return f"a change in the ratio of gravity to torque at {join_words(tie.where)} ({join_words(others, 'or')})"
    rival = rival_of(f)
    return title_of(f.effect, f.where) + (f" (or {title_of(rival.effect, rival.where)})" if rival else "")


def probable(p: float) -> str:
    """A probability in words; never 100 %, as only models within the vocabulary were compared."""
    return "more than 99 %" if p > 0.99 else "less than 1 %" if p < 0.01 else f"{100 * p:.0f} %"


def rival_of(finding: Finding) -> Alternative | None:
    """The alternative that is likely enough to be named together with the finding."""
    return next((a for a in finding.alternatives if a.confidence >= NAMED), None)


def tie_of(finding: Finding, tied: Sequence[GravityOverTorque]) -> GravityOverTorque | None:
    """The tie of which a finding is one name of several."""
    if finding.of_tie is None:
        return None
    return next((t for t in tied if any((n.effect, n.where) == (finding.effect, finding.where[:1]) for n in t.names)), None)


def this_or(tie: Alternative) -> str:
    """Object of a tie's confidence: `that it is this or joint compliance at flm`."""
    return f"that it is this or {title_of(tie.effect, tie.where)}"


def title_of(effect: str, where: Sequence[str]) -> str:
    """`joint_compliance`, ("flm",) -> "joint compliance at flm"; of several places, which the data cannot separate."""
    return name_of(effect) + (f" at {join_words(where, 'or')}" if where else "")


def name_of(effect: str) -> str:
    """`joint_compliance` -> "joint compliance"."""
    known = known_effects().get(effect)
    return (known.title if known else "") or effect.replace("_", " ")


def in_words(statement: Statement) -> str:
    """A reason or a description with readable names of effects: "ground friction takes …"."""
    return statement.in_words(title_of)


def sentence_of(finding: Finding) -> str:
    """How this robot differs from nominal, in the effect's own words."""
    numbers = {name: e.value for name, e in finding.parameters.items()}
    said = effect_named(finding.effect).sentence(EffectSpec(finding.effect, finding.where[:1], numbers))
    others = join_words(finding.where[1:], "or")
    return said + (f" Or the same at {others}: these recordings do not distinguish them." if others else "")


def interval(estimate: Estimate) -> str:
    """The value and its 90 % interval; "at least" or "at most" where one side is open. A vector: its size."""
    if isinstance(estimate.value, tuple):
        return quantity(math.hypot(*estimate.value), estimate.unit) + " in magnitude"
    return _one(estimate.value, float(estimate.low), float(estimate.high), estimate.unit)  # type: ignore[arg-type]


def intervals_of(name: str, estimate: Estimate) -> list[list[str]]:
    """Rows of a table: quantity and interval, one for each component."""
    name = name.replace("_", " ")
    if not isinstance(estimate.value, tuple):
        return [[name, interval(estimate)]]
    assert isinstance(estimate.low, tuple)
    assert isinstance(estimate.high, tuple)
    largest = max(map(abs, estimate.value))
    return [[f"{name}, {axis}", _one(v, low, high, estimate.unit, largest)]
            for axis, v, low, high in zip("xyz", estimate.value, estimate.low, estimate.high)]


def _one(value: float, low: float, high: float, unit: str, largest: float | None = None) -> str:
    """largest: of the values that it is to be read beside, which sets the unit and the decimals; its own if left out."""
    largest = abs(value) if largest is None else largest
    unit, scale = _readable(largest, unit)
    half = (high - low) / 2
    digits = 2 + math.floor(math.log10(abs(value) / half)) if value and 0 < half < math.inf else 3  # that show an interval

    def number(x: float) -> str:
        if largest == abs(value):
            return f"{scale * x:.{min(max(3, digits), 7)}g}"
        decimals = max(0, 2 - math.floor(math.log10(scale * largest))) if largest > 0 else 2
        return f"{scale * x:.{decimals}f}"

    bounds = ("not bounded by the data" if math.isinf(low) and math.isinf(high) else f"at least {number(low)}"
              if math.isinf(high) else f"at most {number(high)}" if math.isinf(low) else f"{number(low)} to {number(high)}")
    return f"{number(value)}{unit} ({bounds})"


def quantity(value: float, unit: str) -> str:
    """Three digits and a unit that suits its size: "5.46 mm" rather than "0.00546 m"."""
    name, scale = _readable(abs(value), unit)
    return f"{scale * value:.3g}{name}"


def _readable(size: float, unit: str) -> tuple[str, float]:
    """The unit with the space before it (nothing for a ratio), and what to multiply by."""
    if unit in ("", "1"):
        return "", 1.0
    name, scale = _SMALL[unit] if unit in _SMALL and size < 0.2 else (unit, 1.0)
    return f" {name}", scale


def change(c: Change) -> str:
    """An error before and after, in a readable unit."""
    unit, scale = _readable(max(abs(c.before), abs(c.after)), c.unit)
    return f"{scale * c.before:.3g} → {scale * c.after:.3g}{unit}"


def layers_of(diagnosis: Diagnosis) -> str:
    """In which layers the residuals lie, and in which their causes, as sentences; empty where there is no gap."""
    if not diagnosis.gap:
        return ""
    count = {layer: sum(g.layer == layer for g in diagnosis.gap) for layer in LAYERS}
    seen = sorted((layer for layer in LAYERS if count[layer]), key=lambda layer: -count[layer])
    said = "Judged by where and when they occur, the errors look like " + join_words(
        [f"{layer} errors ({LAYERS[layer]}: {count[layer]} of {len(diagnosis.gap)})" for layer in seen]) + "."
    causes: dict[Layer, list[str]] = {}
    for f in diagnosis.findings:
        causes.setdefault(effect_named(f.effect).layer, []).append(title_of(f.effect, f.where))
    if causes:
        found = [f"{join_words(names)} ({LAYERS[layer]}: {layer})" for layer, names in causes.items()]
        several = len(diagnosis.findings) > 1
        said += f" The cause{'s' if several else ''} found: {join_words(found)}; one cause can produce errors of several kinds."
    if any(not f.where or effect_named(f.effect).layer in ("inertia", "ground") for f in diagnosis.findings):
        said += " Such a cause affects many joints at once."
    return said


def is_error(u: Unexplained) -> bool:
    """Whether it states the fitted model's error, in a recording's unit; else it doubts a finding."""
    return u.unit in ("deg", "m")


def left_row(u: Unexplained) -> list[str]:
    """The remaining error, its take, its size, its ratio to noise, and its correlation."""
    over = f"{u.error / u.floor:.1f}×" if u.floor > 0 else "–"
    by, d = quantity(u.error, u.unit), u.description
    if not isinstance(d, Dependence):
        return [join_words(u.where) or "whole robot", "", by, over, in_words(d)]
    joint, _, axis = d.channel.partition(ACROSS)
    what = f"{joint}, across its axis ({axis})" if axis else _BODY.get(d.channel, f"joint {joint}")
    if d.signal is None:
        return [what, d.take, by, over, "with none of the tested signals" if u.where else "not with time"]
    strength = "strongly" if d.correlation > 0.7 else "moderately" if d.correlation > 0.5 else "weakly"
    own = {"time": "", "size of the angle": "the "}.get(d.signal, "its ")
    return [what, d.take, by, over, f"{strength} with {own}{d.signal} ({d.correlation:.2f})"]


def next_said(n: NextExperiment) -> str:
    """The motion to record next, how to hold the robot, and the names it separates."""
    base = ("with the base held on the stand, feet in the air" if n.base == "fixed" else
            "with the robot free on the floor")
    pairs = [f"{name_of(a)} from {name_of(b)}" for a, b in n.separates]
    odds = [f"{p} (expected odds in favour of the correct effect: {_odds(x)})"
            for p, x in zip(pairs, n.log_likelihood_ratios)] or pairs
    return (f"Play [{n.motion}]({n.motion}) {base}, and record it like the other takes. It separates {join_words(odds)}, and "
            "it stays within the servos' limits.")


def _odds(ratio: float) -> str:
    return f"{math.exp(ratio):.0f} to 1" if ratio < math.log(1000) else "more than 1000 to 1"


def join_words(words: Sequence[str], last: str = "and") -> str:
    """The words as a list: "a, b and c"."""
    return f" {last} ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)


def capital(text: str) -> str:
    """The text with a capital first letter."""
    return text[:1].upper() + text[1:]


def unbroken(text: str) -> str:
    """The text with its spaces made non-breaking."""
    return text.replace(" ", "\u00a0")


def said_aside(provenance: Mapping[str, Any]) -> list[str]:
    """A sentence for each correction of a log, and for each stretch that was excluded from the evidence."""
    aside = provenance.get("set_aside", {})
    return [f"Corrected or excluded in {take}: {line.rstrip('.')}." for take, lines in aside.items() for line in lines]


def suspect_constants(numbers: Sequence[Recalibrated]) -> list[str]:
    """A sentence for each constant of the servo law that was adjusted as far as its tolerance goes, by number and value."""
    ended: dict[tuple[str, float, float, str], list[str]] = {}
    for r in numbers:
        if r.at_end:
            ended.setdefault((r.number, r.nominal, r.value, r.unit), []).extend(r.where)
    return [f"{number.replace('_', ' ')} at {join_words(where)}: adjusted from {nominal:.3g} to {value:.3g} {unit}, as far as "
            "its tolerance goes; findings there may stand for a nominal law that is wrong: correct it in the session's servos "
            "(0 where the servo has none), or widen its `sd`" for (number, nominal, value, unit), where in ended.items()]
