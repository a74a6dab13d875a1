"""Two names fit a recording equally well: the next experiment is designed, played on the concealed robot, and scored.

    python -m studies.next_experiment [--out runs/studies/next_experiment] [--quick]

For each pair a quadruped of the other engine (MuJoCo) gets one of the two, and is filmed in a first, cautious motion. Both names
are fitted to it; where it leaves them tied, workbench.experiment.design designs a motion from the two fitted models alone. The
concealed robot plays it before the same cameras, both names are fitted to both recordings, and the likelihoods are read off.
Quick: one pair.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from studies.common import publish, run_study, sign
from studies.next_experiment_robot import Fitted, Hidden, Jury
from workbench.experiment.design import Experiment, design_experiment
from workbench.experiment.options import EXPERIMENT
from workbench.motion import Motion
from workbench.robot import EffectSpec, RobotModel
from workbench.view.figures.style import ACCENT, COMMAND, OTHERS, RECORDED, in_house_style, legend_above, new_figure
from workbench.view.report.page import Picture, Provenance, Report, Section, Table, Text

SEED = 5
N_JOBS = 2


@dataclass(frozen=True)
class Name:
    """An effect and the range in which its one number is looked for."""

    effect: str
    parameter: str
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Case:
    """hidden: the robot's effect; rival: a possible imitator. first: (time [s], angle [deg]) of the joint in the first
    motion."""

    name: str
    joint: str
    hidden: Name
    value: float
    rival: Name
    first: Sequence[tuple[float, float]]


UP_AND_HELD = ((1.2, 45.0), (2.2, 45.0))
CASES = (
    Case("gain or spring", "flm", Name("servo_gain", "ratio", 0.25, 0.95, ""), 0.5,
         Name("joint_compliance", "stiffness", 1.0, 60.0, "N m/rad"), UP_AND_HELD),
    Case("play or dead band", "blm", Name("backlash", "gap", 0.3, 6.0, "deg"), 2.5,
         Name("dead_band", "margin", 0.1, 3.0, "deg"), UP_AND_HELD),
    Case("dry or load's friction", "frm", Name("coulomb_friction", "torque", 0.01, 0.4, "N m"), 0.08,
         Name("load_friction", "coefficient", 0.05, 0.98, ""), UP_AND_HELD),
)


@dataclass(frozen=True)
class Outcome:
    """Of one case. before, after: both names fitted, the hidden one first. seconds: that the design took."""

    case: Case
    before: tuple[Fitted, Fitted]
    experiment: Experiment
    after: tuple[Fitted, Fitted]
    jury: Jury
    seconds: float

    @property
    def ratios(self) -> tuple[float, float]:
        """Log-likelihood ratio of the hidden name over its rival, before and after."""
        first, second = ((rival.cost - hidden.cost) / 2 for hidden, rival in (self.before, self.after))
        return first, second


def next_experiment(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Runs the study and writes page, figures and numbers."""
    began = time.monotonic()
    outcomes = [run(case, out / "sessions" / case.hidden.effect, progress) for case in (CASES[:1] if quick else CASES)]
    model = outcomes[0].jury.nominal
    figures = {o.case.hidden.effect: draw(o) for o in outcomes} | {"likelihoods": draw_likelihoods(outcomes)}
    reached = sum(o.ratios[1] >= EXPERIMENT.separated for o in outcomes)
    report = Report(
        "The next experiment", f"{reached} of {len(outcomes)} ties resolved: the designed motion reaches the hidden name.",
        "Robots of another engine (MuJoCo), filmed with noise. The design knows the two fitted models, not the truth. "
        "Log-likelihood ratios count frames with correlated errors, 50 ms, once.",
        provenance=Provenance.of(model, seed=SEED, seconds=time.monotonic() - began))
    report.add(Section("Before and after", [Picture(figures["likelihoods"], "For the hidden name, against its rival."),
                                            table(outcomes)]))
    for o in outcomes:
        report.add(Section(o.case.name, [
            Text(f"Hidden: `{o.case.hidden.effect}` in {o.case.joint}. Designed: {o.experiment.motion.name}, "
                 f"{o.experiment.motion.duration:.1f} s, base {o.experiment.base}; it took {o.seconds:.0f} s."),
            Picture(figures[o.case.hidden.effect], "Both names after each was fitted to both recordings; the part that a name "
                                                   "cannot follow is the evidence.")]))
    numbers = {o.case.name: {
        "hidden": o.case.hidden.effect, "rival": o.case.rival.effect, "joint": o.case.joint, "value": o.case.value,
        "log_likelihood_ratio": {"before": o.ratios[0], "expected": o.experiment.separations[0].log_likelihood_ratio,
                                 "after": o.ratios[1]},
        "fitted": {"before": [f.value for f in o.before], "after": [f.value for f in o.after]},
        "motion": o.experiment.motion.name, "seconds_of_design": round(o.seconds, 1)} for o in outcomes}
    return publish(out, model, report, numbers, figures)


def run(case: Case, folder: Path, progress: Callable[[str, float | None], None]) -> Outcome:
    """First motion, tie, design, second motion, name."""
    progress(f"{case.name}: first recording", None)
    hidden = Hidden(folder, EffectSpec(case.hidden.effect, (case.joint,), {case.hidden.parameter: case.value}), SEED)
    jury = Jury(hidden.film("first", _first(hidden.model, case), "fixed"), N_JOBS)
    progress(f"{case.name}: fitting both names", None)
    before = _both(jury, case)
    began = time.monotonic()
    models = [jury.nominal.with_effect(f.effect) for f in before]
    experiment = design_experiment(jury.nominal, [(models[0], models[1])], {"fixed": jury.sight}, N_JOBS,
                                   progress=lambda what, share: progress(f"{case.name}: {what}", share))
    seconds = time.monotonic() - began
    progress(f"{case.name}: second recording", None)
    jury = Jury(hidden.film("next", experiment.motion, experiment.base), N_JOBS)
    progress(f"{case.name}: fitting both names to both", None)
    return Outcome(case, before, experiment, _both(jury, case), jury, seconds)


def _first(model: RobotModel, case: Case) -> Motion:
    times = np.array([0.0, *(t for t, _ in case.first)])
    angles = np.zeros((len(times), len(model.joints)))
    angles[1:, model.joints.index(case.joint)] = np.radians([a for _, a in case.first])
    return Motion("first", times, model.joints, angles)


def _both(jury: Jury, case: Case) -> tuple[Fitted, Fitted]:
    first, second = (jury.fit(n.effect, (case.joint,), n.parameter, np.geomspace(n.low, n.high, 6).tolist())
                     for n in (case.hidden, case.rival))
    return first, second


def table(outcomes: Sequence[Outcome]) -> Table:
    """A row for each pair."""
    rows = []
    for o in outcomes:
        (before, after), expected = o.ratios, o.experiment.separations[0]
        hidden, _ = o.after
        rows.append([o.case.hidden.effect, o.case.rival.effect, o.case.joint, sign(before),
                     f"{expected.log_likelihood_ratio:.0f}", sign(after),
                     f"{probability(before):.3f}", f"{probability(after):.3f}",
                     f"{o.case.value:g}", f"{hidden.value:.3g}", o.case.hidden.unit])
    return Table(("hidden", "rival", "joint", "first", "expected", "both", "P, first", "P, both", "size", "fitted", "unit"), rows,
                 "First, expected, both: log-likelihood ratio of the hidden name over its rival, each fitted, of the first take, "
                 "as the design promised of the new take alone, and of both takes. P: probability of the hidden name, both being "
                 "as likely at the outset. Size: hidden.")


def probability(ratio: float) -> float:
    """Of the hidden name."""
    return 1 / (1 + math.exp(-max(min(ratio, 700.0), -700.0)))


@in_house_style
def draw(o: Outcome) -> Figure:
    """The joint in the first and in the designed take: recording, and residuals of each fitted name."""
    figure = new_figure(11, 5.6)
    axes = figure.subplots(2, 2, sharex="col", width_ratios=(1, 2.4))
    for column, take in enumerate(o.jury.takes):
        recorded = take.recorded
        t, i = recorded.since_start, recorded.column(o.case.joint)
        assert take.commands is not None
        ramp = take.commands.reference(t)[:, take.commands.column(o.case.joint)]
        axes[0, column].plot(t, np.degrees(ramp), color=COMMAND, lw=1, label="command")
        axes[0, column].plot(t, np.degrees(recorded.q[:, i]), color=RECORDED, lw=1.4, label="recorded")
        for fitted, colour in zip(o.after, (ACCENT, OTHERS[0])):
            left = np.degrees(recorded.q[:, i] - fitted.observed[column].q[:, fitted.observed[column].column(o.case.joint)])
            axes[1, column].plot(t, left, color=colour, lw=1.1, label=f"{fitted.effect.effect} {fitted.value:.2g}")
        axes[0, column].set_title(("first motion", "designed motion")[column])
        axes[1, column].set_xlabel("time [s]")
    axes[0, 0].set_ylabel(f"{o.case.joint} [deg]")
    axes[1, 0].set_ylabel("recorded less fitted [deg]")
    least = max(1.0, *(float(np.nanmax(np.abs(line.get_ydata()))) for a in axes[1] for line in a.lines))
    for a in axes[1]:
        a.set_ylim(-1.05 * least, 1.05 * least)
    legend_above(axes[0, 1])
    legend_above(axes[1, 1])
    return figure


@in_house_style
def draw_likelihoods(outcomes: Sequence[Outcome]) -> Figure:
    """Log-likelihood ratios before and after."""
    figure = new_figure(9, 1.4 + 0.9 * len(outcomes))
    axes = figure.subplots()
    for k, o in enumerate(outcomes):
        labels = ("first take", "first and designed take")
        for ratio, colour, dy, label in zip(o.ratios, (COMMAND, ACCENT), (-0.19, 0.19), labels):
            axes.barh(k + dy, ratio, 0.34, color=colour, label=label if k == 0 else None)
            axes.annotate(f"{sign(ratio)}", (max(ratio, 0.0), k + dy), xytext=(5, 0), textcoords="offset points", va="center")
    axes.axvline(EXPERIMENT.separated, color=RECORDED, lw=1.2, ls="--", label=f"separated ({EXPERIMENT.separated:g})")
    axes.set_xscale("symlog", linthresh=5)
    axes.set_yticks(range(len(outcomes)), [f"{o.case.hidden.effect}\nnot {o.case.rival.effect}" for o in outcomes])
    axes.invert_yaxis()
    axes.set_xlabel("log-likelihood ratio for the hidden name")
    axes.margins(x=0.15)
    legend_above(axes)
    return figure


if __name__ == "__main__":
    raise SystemExit(run_study("next_experiment", __doc__, next_experiment))
