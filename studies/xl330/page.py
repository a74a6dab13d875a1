"""The page of the rig's study."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from studies.xl330.bam import Logs
from studies.xl330.station import Played, mean_error
from workbench.identify.results.findings import Diagnosis
from workbench.robot import RobotModel
from workbench.types import Array
from workbench.view.report.page import Picture, Provenance, Report, Section, Table, Text
from workbench.view.report.words import interval, probable, title_of

DIAGNOSED = "`workbench diagnose`"


@dataclass(frozen=True)
class Diagnosed:
    """The logs at two gains, diagnosed; the third played by the nominal model and by the diagnosed one; seconds that it took."""

    model: RobotModel
    diagnosis: Diagnosis | None
    nominal: Mapping[str, Played]
    after: Mapping[str, Played]
    seconds: float


@dataclass(frozen=True)
class Results:
    """logs: at BAM's times. published, refitted (by gain left out): mean absolute errors (L,) [rad] of friction models.
    diagnosed: by gain left out. supply: readings of the logs [V], idle and stalled at full duty, and rows of the latter."""

    logs: Logs
    published: Mapping[str, Array]
    refitted: Mapping[str, Mapping[int, Array]]
    diagnosed: Mapping[int, Diagnosed]
    supply: tuple[float, float, int]

    @property
    def gains(self) -> tuple[int, ...]:
        """Those left out, one after the other."""
        return tuple(self.diagnosed)

    def validation(self) -> dict[str, dict[int, float]]:
        """Mean absolute error [rad] on the gain that was left out, by model."""
        at = {g: np.array(self.logs.gains) == g for g in self.gains}
        out = {f"{m.upper()}, published": {g: float(e[at[g]].mean()) for g in self.gains} for m, e in self.published.items()}
        out |= {f"{m.upper()}, refitted": {g: float(e[g][at[g]].mean()) for g in self.gains} for m, e in self.refitted.items()}
        return out | {DIAGNOSED: {g: mean_error(d.after) for g, d in self.diagnosed.items()}}

    def numbers(self) -> dict[str, object]:
        """All of it, for numbers.json; mrad."""
        return {
            "validation_mrad": {n: {str(g): 1e3 * e for g, e in by.items()} for n, by in self.validation().items()},
            "per_log_mrad": {name: 1e3 * p.error for d in self.diagnosed.values() for name, p in d.after.items()},
            "published_per_log_mrad": {m: dict(zip(self.logs.names, (1e3 * e).tolist())) for m, e in self.published.items()},
            "diagnosed": {str(g): {"seconds": d.seconds, "findings": [f.to_json() for f in d.diagnosis.findings]}
                          for g, d in self.diagnosed.items() if d.diagnosis is not None},
            "supply": {"idle": self.supply[0], "full_duty": self.supply[1], "rows": self.supply[2]}}


def mrad(value: float) -> str:
    return f"{1e3 * value:.0f}"


def page(r: Results, figures: Mapping[str, Figure], model: RobotModel, seconds: float, quick: bool) -> Report:
    """The page."""
    validation = r.validation()
    mean = {name: float(np.mean(list(by.values()))) for name, by in validation.items()}
    theirs = min((v, n) for n, v in mean.items() if n.endswith("refitted"))
    best = min((v, n) for n, v in mean.items() if n.endswith("published"))
    report = Report(
        "XL-330 on a pendulum", f"At a gain that the diagnosis did not see its model errs by {mrad(mean[DIAGNOSED])} mrad; the "
        f"best published friction model, {best[1].split(',')[0]}, by {mrad(best[0])}, the best one refitted on the same logs, "
        f"{theirs[1].split(',')[0]}, by {mrad(theirs[0])}.",
        "Real recordings (Rhoban/bam, Apache-2.0): a Dynamixel XL-330 swings 0.49 kg on 0.1 m through four programmes of six "
        "seconds, each at position gains 100, 200 and 400. Everything is fitted on two gains and judged on the third. Errors are "
        "mean absolute errors of the angle [mrad], over the whole log, from its first state on.",
        provenance=Provenance.of(model, seed=0, seconds=seconds, quick="yes: numbers mean nothing" if quick else "no"))
    header = ("model", *(f"gain {g}" for g in r.gains), "mean")
    rows = [(name, *(mrad(by[g]) for g in r.gains), mrad(mean[name])) for name, by in validation.items()]
    report.add(Section("The gain that was left out", [
        Table(header, rows, "Mean absolute error [mrad] on the four logs of each gain, fitted on the other two.",
              emphasis=[i for i, row in enumerate(rows) if row[0] == DIAGNOSED]),
        Picture(figures["validation"], "Rollouts of six seconds from the first row's state, nothing fed back from the log.")]))
    idle, full, count = r.supply
    report.add(Section("Comparison of the two gains", [
        *(_findings(g, d.diagnosis) for g, d in r.diagnosed.items() if d.diagnosis is not None),
        Text(f"The servo's register of voltage is at {idle:.1f} V while it idles, and at {full:.1f} V when it stalls at full "
             f"duty ({count} rows)."),
        Picture(figures["balance"], "Slow stretches of all logs. If the motor M1's and the gear were free of friction, all would "
                "lie on the dashed line. Lifting takes half as much duty again, and more so the heavier the load; at rest, the "
                "same duty holds a wide range of loads.")]))
    return report.add(Section("Each log", [_per_log(r)]))


def _findings(gain: int, diagnosis: Diagnosis) -> Table:
    rows = []
    for f in diagnosis.findings:
        family = "–" if f.family is None else f"{f.family.name}, {probable(f.family.confidence)}"
        numbers = "; ".join(f"{name} {interval(e)}" for name, e in f.parameters.items())
        rows.append((title_of(f.effect, f.where), probable(f.confidence), family, numbers))
    rows += [(f"{c.number.replace('_', ' ')}, recalibrated", "–", "–", f"{c.nominal:.3g} → {c.value:.3g} {c.unit}")
             for c in diagnosis.recalibrated]
    return Table(("what", "how sure", "its family", "numbers (90 % interval)"), rows, f"Without gain {gain}.")


def _per_log(r: Results) -> Table:
    rows = []
    for i, name in enumerate(r.logs.names):
        gain = r.logs.gains[i]
        if gain not in r.gains:
            continue
        rows.append((name.replace("_", " "), *(mrad(e[i]) for e in r.published.values()),
                     *(mrad(e[gain][i]) for e in r.refitted.values()), mrad(r.diagnosed[gain].after[name].error)))
    header = ("log", *(f"{m.upper()}" for m in r.published), *(f"{m.upper()} refitted" for m in r.refitted), "diagnosed")
    return Table(header, rows, "Mean absolute error [mrad]; fits used the other gains only.")
