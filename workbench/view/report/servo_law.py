"""The parts of a diagnosis's page about the servo law: constants that were adjusted, and torques that no effect describes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from workbench.identify.results.servo_law import GravityOverTorque, Recalibrated, UnknownTorque
from workbench.view.figures.unknown_torque import unknown_torque
from workbench.view.report.page import Part, Picture, Section, Table, Text
from workbench.view.report.tables import folded_table
from workbench.view.report.words import capital, change, join_words, probable, suspect_constants, title_of, unbroken


def unknown_torque_section(unknown: UnknownTorque) -> Section:
    """Its probability, size and errors, with its plot."""
    rows = [["probability", probable(unknown.confidence)], ["RMS over the recorded motion", f"{1e3 * unknown.rms:.2g} mN m"],
            ["error on fitted stretches", change(unknown.fit)], ["error on unseen stretches", change(unknown.validation)]]
    parts: list[Part] = [
        Text(capital(unknown.evidence)),
        Text("The torque is repeatable: the same function fits all takes. model.yaml contains it as a table, so simulations "
             "and gaits include it. Whatever causes it has to produce this curve."),
        Table(["", "value"], rows),
        Picture(unknown_torque(unknown), f"The torque at {unknown.joint} that the recordings require, with 90 % bounds.")]
    return Section(f"Unknown torque at {unknown.joint}", parts)


def tied_in_short(tie: GravityOverTorque) -> str:
    """Gravity over torque, and the names of everything that could be the cause."""
    causes = [title_of(n.effect, n.where) for n in tie.competitive]
    if tie.may_be_torque:
        causes.append("other torques of the servo")
    if len(causes) == 1:
        more = ", alone or together with a change of its load, which angles cannot distinguish" if tie.may_be_several else ""
        return f"{tie.change} Cause: {causes[0]}{more}."
    return f"{tie.change} Angles alone do not determine the cause: {join_words(causes, 'or')}."


def tied_section(ties: Sequence[GravityOverTorque]) -> Section:
    """Gravity over torque, and each effect that would explain it alone."""
    rows = [[title_of(n.effect, n.where), n.sentence, f"{n.behind:.0f}"] for t in ties for n in t.names]
    several = any(len(t.competitive) + t.may_be_torque > 1 or t.may_be_several for t in ties)
    title = "Causes that angles cannot distinguish" if several else "Ratio of gravity to torque"
    return Section(title, [*(Text(t.in_words()) for t in ties), *folded_table(
        ["effect", "size, if it is the only cause", "less likely by [nats]"], rows, "more effects")])


def recalibrated_section(numbers: Sequence[Recalibrated]) -> Section:
    """Adjusted constants of the nominal law."""
    shown = [(r, *(("deg", math.degrees(1.0)) if r.unit == "rad" else (r.unit, 1.0))) for r in numbers]
    rows = [[r.number.replace("_", " "), join_words(r.where), f"{scale * r.nominal:.4g}", f"{scale * r.value:.4g}",
             unbroken(unit), f"{r.sigmas:+.1f}"] for r, unit, scale in shown]
    said = "These constants were adjusted within the tolerances of your servo file; this does not count as a finding."
    suspect = [Text(f"{capital(sentence)}.") for sentence in suspect_constants(numbers)]
    return Section("Recalibrated constants", [Text(said), *suspect, *folded_table(
        ["constant", "where", "nominal", "adjusted", "unit", "standard deviations"], rows, "more constants")])
