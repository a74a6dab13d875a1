"""The page of the rig's study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from studies.xl330 import effects
from studies.xl330.bam import Logs
from studies.xl330.questions import RolloutRequest
from studies.xl330.selection import Model, mean_errors
from workbench.robot import RobotModel
from workbench.view.report.page import Picture, Provenance, Report, Section, Table, Text

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Results:
    """theirs, ours: the logs at BAM's times and at ours. published, refitted (by gain left out): mean absolute errors (L,) [rad]
    of friction models. chains: by gain left out, models of 0, 1, … effects. station: errors of the station's rollouts [rad], by
    kind of model, gain left out, and take. supply: what the logs say of it [V], idle and standing at full duty, and rows of the
    latter."""

    theirs: Logs
    ours: Logs
    m1: Mapping[str, float]
    published: Mapping[str, Array]
    refitted: Mapping[str, Mapping[int, Array]]
    chains: Mapping[int, Sequence[Model]]
    questions: Sequence[RolloutRequest]
    station: Mapping[str, Mapping[int, Mapping[str, float]]]
    supply: tuple[float, float, int]

    @property
    def gains(self) -> tuple[int, ...]:
        """Those left out, one after the other."""
        return tuple(self.chains)

    def validation(self) -> dict[str, dict[int, float]]:
        """Mean absolute error [rad] on the gain that was left out, by model."""
        at = {g: np.array(self.theirs.gains) == g for g in self.gains}
        out = {f"{m.upper()}, published": {g: float(e[at[g]].mean()) for g in self.gains} for m, e in self.published.items()}
        out |= {f"{m.upper()}, refitted": {g: float(e[g][at[g]].mean()) for g in self.gains} for m, e in self.refitted.items()}
        names = {"effects": "M1 and effects", "diagnose": "`workbench diagnose`"}
        return out | {names[k]: {g: float(np.mean(list(e.values()))) for g, e in by.items()}
                      for k, by in self.station.items() if by}

    def numbers(self) -> dict[str, object]:
        """All of it, for numbers.json; mrad."""
        return {
            "validation_mrad": {n: {str(g): 1e3 * e for g, e in by.items()} for n, by in self.validation().items()},
            "per_log_mrad": {k: {name: 1e3 * e for by in gains.values() for name, e in by.items()}
                             for k, gains in self.station.items()},
            "effects": {str(g): chain[-1].values for g, chain in self.chains.items()},
            "published_per_log_mrad": {m: dict(zip(self.theirs.names, (1e3 * e).tolist())) for m, e in self.published.items()},
            "questions": [{"taken": q.taken, "given": q.given, "verdict": q.verdict(_chosen(self, q)), "before": dict(q.before),
                           "after": dict(q.after)} for q in self.questions],
            "supply": {"idle": self.supply[0], "full_duty": self.supply[1], "rows": self.supply[2]}}


def mrad(value: float) -> str:
    return f"{1e3 * value:.0f}"


def page(r: Results, figures: Mapping[str, Figure], model: RobotModel, seconds: float, quick: bool) -> Report:
    """The page."""
    validation = r.validation()
    mean = {name: float(np.mean(list(by.values()))) for name, by in validation.items()}
    ours, theirs = mean["M1 and effects"], min((v, n) for n, v in mean.items() if n.endswith("refitted"))
    best = min((v, n) for n, v in mean.items() if n.endswith("published"))
    report = Report(
        "XL-330 on a pendulum", f"At a gain that no fit saw, M1 with the effects that two other gains ask for errs by "
        f"{mrad(ours)} mrad; the best published friction model, {best[1].split(',')[0]}, by {mrad(best[0])}, the best one "
        f"refitted on the same logs, {theirs[1].split(',')[0]}, by {mrad(theirs[0])}.",
        "Real recordings (Rhoban/bam, Apache-2.0): a Dynamixel XL-330 swings 0.49 kg on 0.1 m through four programmes of six "
        "seconds, each at position gains 100, 200 and 400. Everything is fitted on two gains and judged on the third. Errors are "
        "mean absolute errors of the angle [mrad], over the whole log, from its first state on.",
        provenance=Provenance.of(model, seed=0, seconds=seconds, quick="yes: numbers mean nothing" if quick else "no"))
    header = ("model", *(f"gain {g}" for g in r.gains), "mean")
    rows = [(name, *(mrad(by[g]) for g in r.gains), mrad(mean[name])) for name, by in validation.items()]
    report.add(Section("The gain that was left out", [
        Table(header, rows, "Mean absolute error [mrad] on the four logs of each gain, fitted on the other two.",
              emphasis=[i for i, row in enumerate(rows) if row[0] == "M1 and effects"]),
        Picture(figures["validation"], "Rollouts of six seconds from the first row's state, nothing fed back from the log.")]))
    report.add(Section("What the two gains ask for", [*_chains(r), Picture(
        figures["balance"], "Slow stretches of all logs. Were the motor M1's and the gear free of friction, all would lie on the "
        "dashed line. Lifting takes half as much duty again, and the more so the heavier the load; held, the same duty holds a "
        "wide range of loads.")]))
    if r.questions:
        report.add(Section("What the recordings support, and what they leave open", [_questions(r), Text(_reading(r))]))
    return report.add(Section("Each log", [_per_log(r)]))


def _chains(r: Results) -> list[Table]:
    knobs = list(dict.fromkeys(name for chain in r.chains.values() for name in chain[-1].values))
    units = {k.name: k.parameter.unit for k in effects.knobs(list(effects.EFFECTS))}
    values = [(f"{name.replace('.', ': ')} [{units[name]}]".replace(" []", ""),
               *(f"{r.chains[g][-1].values[name]:.3g}" if name in r.chains[g][-1].values else "–" for g in r.gains))
              for name in knobs]
    steps = []
    for n in range(max(len(c) for c in r.chains.values())):
        cells = []
        for g in r.gains:
            chain = r.chains[g]
            if n >= len(chain):
                cells += ["", ""]
                continue
            errors = mean_errors(chain[n], r.ours, r.m1)
            at = np.array(r.ours.gains) == g
            new = [e.replace("_", " ") for e in chain[n].effects if not n or e not in chain[n - 1].effects]
            added = " and ".join(new) or "M1"
            cells += [added, f"{mrad(errors[~at].mean())} → {mrad(errors[at].mean())}"]
        steps.append(cells)
    header = [cell for g in r.gains for cell in (f"without {g}", "error: fitted → left out")]
    caption = ("Effects in the order in which they entered, chosen on the fitted gains alone: each the one that leaves least. "
               "Errors [mrad] of the study's own rollouts.")
    return [Table(header, steps, caption),
            Table(("number", *(f"without {g}" for g in r.gains)), values, "Their numbers in the end, from three pairs of gains.")]


def _questions(r: Results) -> Table:
    rows = []
    for q in r.questions:
        what = f"{q.taken} left out" if not q.given else f"{q.given} in place of {q.taken}"
        has = [g for g in r.gains if q.taken in r.chains[g][-1].effects]
        rows.append((what.replace("_", " "), *(f"{mrad(q.before[g])} → {mrad(q.after[g])}" if g in has else "–" for g in r.gains),
                     q.verdict(has)))
    return Table(("change", *(f"gain {g}" for g in r.gains), "so the first is"), rows,
                 "Each change refitted on two gains; error at the third [mrad], before → after. Supported: worse by a tenth or "
                 "more wherever the effect had been chosen.")


def _reading(r: Results) -> str:
    idle, full, rows = r.supply
    said = [(q, q.verdict(_chosen(r, q)) == "supported") for q in r.questions]
    supported = [q.taken.replace("_", " ") for q, yes in said if yes and not q.given]
    unclear = [f"{q.taken} or {q.given}".replace("_", " ") for q, yes in said if q.given and not yes]
    drops = [c[-1].values["supply_sag.drop"] for c in r.chains.values() if "supply_sag.drop" in c[-1].values]
    sag = "" if not drops else (
        f" A sagging supply is a shape, not a cause: the fits ask for {min(drops):.1f} to {max(drops):.1f} V at full duty, "
        f"while the servo's own register falls from {idle:.1f} to {full:.1f} V when it stands at full duty ({rows} rows). What "
        "the logs do show is torque that grows less than duty; a driver or friction that outgrows its load would look alike.")
    return (
        f"**Supported**, whichever gain is left out: {', '.join(supported) or 'nothing'}.\n\n"
        f"**Left open**: {'; '.join(unclear) or 'no rival'}.{sag}\n\n"
        "A turned zero and a tilted stand are the same thing on this rig. Whether supply or gain is higher than nominal shows "
        "only where duty is cut. M1's own friction, armature and back-EMF stay as published: the effects add to them, and where "
        "the logs ask for less of them, nothing here can give it. What is left is stick and slip: slow lifts stop at angles that "
        "differ from log to log, once for half a second under rising and then full duty (lift and drop, gain 400), and a model "
        "that slides there is wrong until the arm is let go.")


def _chosen(r: Results, q: RolloutRequest) -> list[int]:
    return [g for g in r.gains if q.taken in r.chains[g][-1].effects]


def _per_log(r: Results) -> Table:
    rows = []
    for i, name in enumerate(r.theirs.names):
        gain = r.theirs.gains[i]
        if gain not in r.gains:
            continue
        rows.append((name.replace("_", " "), *(mrad(e[i]) for e in r.published.values()),
                     *(mrad(e[gain][i]) for e in r.refitted.values()),
                     *(mrad(by[gain][name]) for by in r.station.values() if gain in by)))
    kinds = {"effects": "M1 and effects", "diagnose": "diagnose"}
    header = ("log", *(f"{m.upper()}" for m in r.published), *(f"{m.upper()} refitted" for m in r.refitted),
              *(kinds[k] for k, by in r.station.items() if by))
    return Table(header, rows, "Mean absolute error [mrad]; what is fitted was fitted on the other gains.")
