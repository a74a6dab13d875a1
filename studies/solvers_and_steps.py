"""The same six seconds under other solvers, steps and contact approximations: how far does the numerics alone carry the puppy?

    python -m studies.solvers_and_steps [--out runs/studies/solvers_and_steps] [--quick]

The thesis ran Simulink's ode15s (order 2, steps of about 1e-4 s, 6.10 and 7.2.1) and left other solvers and steps open (8.2).
Here the ROBOTIS walk, by the servo law and by ideal joints (the thesis's angles under its own filter), on point and hydroelastic
feet: discrete plants at several steps in three contact approximations, and continuous plants under CENIC at three accuracies.
Quick: a tenth of a second of a few of them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies import inputs
from studies.common import COORDINATES, SIMULATED_M, SIMULATED_OWN, body_end, publish, run_study, sign
from workbench.motion import load_motion
from workbench.robot import RobotModel, data_file, puppy_model
from workbench.simulation import Job, Simulation, SimulationConfig
from workbench.simulation.play import motion_job
from workbench.view.figures import style
from workbench.view.report.page import Picture, Provenance, Report, Section, Table, Text

DRIVES = {"servo": "servo law", "ideal": "ideal joints"}
CONTACTS = ("point", "hydroelastic")
STEPS = {"point": (2e-3, 1e-3, 5e-4, 2.5e-4), "hydroelastic": (2e-3, 1e-3, 5e-4)}
"""Of discrete plants [s], by feet; hydroelastic ones cost about three times as much."""
APPROXIMATIONS = ("lagged", "sap", "similar")
ACCURACIES = (1e-2, 1e-3, 1e-4)
EXPLICIT_SECONDS = 0.2
"""Of the walk, for which the explicit integrator is tried."""
LOG_PERIOD = 0.02
"""Of every run [s], discrete or not: each row of the log ends a step of a continuous solver and so changes its answer."""


@dataclass(frozen=True)
class Outcome:
    """One run.

    solver: "lagged", … or the integrator; setting: step [s] or accuracy. x, right [cm], heading [deg, left]: where the body
    ends. cpu: seconds of processor time for it, station and settling left out; seconds: simulated. note: why there is no end.
    """

    drive: str
    contact: str
    solver: str
    setting: float
    x: float
    right: float
    heading: float
    cpu: float
    seconds: float
    note: str = ""

    @property
    def discrete(self) -> bool:
        """Whether `setting` is a step."""
        return self.solver in APPROXIMATIONS

    @property
    def cost(self) -> float:
        """Processor seconds for each second simulated, the rest before the walk included."""
        return self.cpu / (self.seconds + inputs.LEAD)

    @property
    def label(self) -> str:
        """Of solver and setting."""
        return f"{self.solver}, {1e3 * self.setting:g} ms" if self.discrete else f"{self.solver}, accuracy {self.setting:g}"


def configurations(quick: bool) -> list[SimulationConfig]:
    """Every drive, contact, solver and setting; the longest first, so that no core waits for one at the end."""
    out = []
    for drive in DRIVES:
        for contact in CONTACTS[:1] if quick else CONTACTS:
            common = {"drive": drive, "contact": contact, "log_period": LOG_PERIOD, "contact_period": 0.0}
            for approximation in APPROXIMATIONS:
                out += [SimulationConfig(time_step=h, approximation=approximation, **common)  # type: ignore[arg-type]
                        for h in STEPS[contact][:2 if quick else None]]
            out += [SimulationConfig(time_step=0.0, integrator="cenic", accuracy=accuracy, **common)  # type: ignore[arg-type]
                    for accuracy in ACCURACIES[:1 if quick else None]]
    return sorted(out, key=lambda c: (c.contact == "point", c.time_step))


def job_of(model: RobotModel, config: SimulationConfig, seconds: float) -> Job:
    """The walk by a servo, or the thesis's angles under its own filter by ideal joints."""
    if config.drive == "ideal":
        return inputs.ideal_job(model, config, inputs.own_filter(inputs.robotis()[0]), seconds)
    return motion_job(model, config, load_motion(data_file("robotis_walk.csv"), model), inputs.CYCLES, seconds, inputs.LEAD)


def timed(job: Job) -> Outcome:
    """Runs a job; a solver's refusal is an outcome too."""
    assert job.duration is not None
    c = job.config
    settled = 0.0
    try:
        simulation = Simulation(job.model, c)
        simulation.run(duration=LOG_PERIOD, lead=0.0)  # settles; the next run starts from there
        settled = time.process_time()
        take = simulation.run(job.commands, job.duration, job.lead, trajectory=job.trajectory)
        end = body_end(take, job.duration - 1e-6)
        note = ""
    except RuntimeError as e:
        end, note = np.full(len(COORDINATES), np.nan), str(e).splitlines()[0]
    cpu = time.process_time() - settled if settled else float("nan")
    x, right, heading = (float(end[COORDINATES.index(k)]) for k in ("x", "z", "ry"))
    solver, setting = (c.approximation, c.time_step) if c.time_step else (c.integrator, c.accuracy)
    return Outcome(c.drive, c.contact, solver, setting, x, right, heading, cpu, job.duration, note)


def try_explicit(model: RobotModel, seconds: float) -> list[Outcome]:
    """Runge-Kutta 3 where it can be used at all, with the servo law; the ideal drive's gains are far too stiff for it."""
    config = SimulationConfig(time_step=0.0, integrator="runge_kutta3", accuracy=1e-2, log_period=LOG_PERIOD, contact_period=0.0,
                              settle=0.1)
    return [timed(job_of(model, config, seconds))]


def solvers_and_steps(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Runs the study and writes page, figure and numbers."""
    began = time.monotonic()
    model = puppy_model()
    seconds = 0.1 if quick else inputs.SECONDS
    jobs = [job_of(model, c, seconds) for c in configurations(quick)]
    outcomes: list[Outcome] = []
    for outcome in Parallel(n_jobs=2, return_as="generator")(delayed(timed)(job) for job in jobs):
        outcomes.append(outcome)
        progress(f"running {len(jobs)} configurations", len(outcomes) / len(jobs))
    progress("trying Runge-Kutta 3", None)
    explicit = try_explicit(model, 0.02 if quick else EXPLICIT_SECONDS)
    figure = draw(outcomes)
    report = Report(
        "Solvers and steps", headline(outcomes), "The robot, its motion and its ground are the same in every run.",
        provenance=Provenance.of(model, seconds=time.monotonic() - began, quick="yes: numbers mean nothing" if quick else "no"))
    caption = "Lines: contact approximations over the step. Diamonds: CENIC. Dashed: the thesis's simulations."
    report.add(Section("Where the body ends", [Picture(figure, caption), spread_table(outcomes)]))
    report.add(Section("Beside what the thesis says", [Table(("the thesis", "here"), findings(outcomes, explicit))]))
    report.add(Section("Every run", [runs_table(outcomes + explicit), Text(
        "Processor time of the run alone, the station built and settled. Each row of the log (every 20 ms) ends a step of a "
        "continuous solver.")]))
    return publish(out, model, report, {"runs": [asdict(o) for o in outcomes + explicit]}, {"solvers": figure})


def headline(outcomes: Sequence[Outcome]) -> str:
    """The result in one sentence."""
    said = [f"{name} by {np.ptp(x):.0f} cm and {np.ptp(turn):.0f}°" for name, x, turn in _spread(outcomes)]
    return f"Numerics alone, on point feet, move the walk's end: {' and '.join(said)}."


def _spread(outcomes: Sequence[Outcome]) -> list[tuple[str, list[float], list[float]]]:
    """For each drive on point feet: x and heading of every run that has an end."""
    out = []
    for drive, name in DRIVES.items():
        mine = [o for o in outcomes if o.drive == drive and o.contact == "point" and not o.note]
        out.append((name, [o.x for o in mine], [o.heading for o in mine]))
    return out


def spread_table(outcomes: Sequence[Outcome]) -> Table:
    """For each drive and contact: what the finest runs give, and how far the others stray."""
    rows = []
    for drive, name in DRIVES.items():
        for contact in CONTACTS:
            mine = [o for o in outcomes if (o.drive, o.contact) == (drive, contact) and not o.note]
            if not mine:
                continue
            lagged = {o.setting: o for o in mine if o.solver == "lagged"}
            cenic = min((o for o in mine if not o.discrete), key=lambda o: o.setting, default=None)
            finest = [o for o in mine if o.discrete and o.setting == min(lagged)]
            row = [f"{name}, {contact}", f"{sign(lagged[1e-3].x)} cm, {sign(lagged[1e-3].heading)}°"]
            row.append("–" if cenic is None else f"{sign(cenic.x)} cm, {sign(cenic.heading)}°")
            rows.append([*row, *(f"{np.ptp([o.x for o in group]):.1f} cm, {np.ptp([o.heading for o in group]):.0f}°"
                                 for group in (list(lagged.values()), finest, mine))])
    return Table(("", "lagged, 1 ms", "CENIC, tightest", "spread over steps (lagged)", "over approximations (finest step)",
                  "over all"), rows, "x and heading (left positive) after the walk, and how far apart runs end.")


def findings(outcomes: Sequence[Outcome], explicit: Sequence[Outcome]) -> list[tuple[str, str]]:
    """What the thesis says | what is seen here."""
    def pick(drive: str, solver: str, setting: float) -> Outcome | None:
        at = (drive, "point", solver, setting)
        return next((o for o in outcomes if (o.drive, o.contact, o.solver, o.setting) == at and not o.note), None)

    def over_steps(drive: str) -> str:
        ends = [pick(drive, "lagged", h) for h in STEPS["point"]]
        return ", ".join(f"{sign(o.x)} cm and {sign(o.heading)}° at {1e3 * o.setting:g} ms" for o in ends if o)

    steps = [f"{name}: {over_steps(drive)}" for drive, name in DRIVES.items()]
    compared = [pick(drive, solver, 1e-3) for drive in DRIVES for solver in ("lagged", "cenic")]
    costs = [f"{o.label}: {o.cost:.2f} s ({DRIVES[o.drive]})" for o in compared if o]
    tried = "; ".join(o.note or f"{o.cost:.0f} s of processor time for each simulated second" for o in explicit)
    spread = "; ".join(f"{name} {np.ptp(x):.1f} cm and {np.ptp(turn):.0f}°" for name, x, turn in _spread(outcomes))
    return [
        ('7.2.1: "The average step size for the solver is around 1e-4 … Higher precision would increase computation time without '
         'significantly improving the simulation, lower precision would reduce the quality"',
         f"Lagged, point feet: {'; '.join(steps)}."),
        ('7.2.2: "It seems that the simulation is prone to reacting to such small changes."',
         f"Over all solvers, steps and approximations on point feet: {spread}."),
        ('6.10: ode15s, order 2, default settings; 8.2: "Other MATLAB solvers could be tested to see if they deliver better '
         'results"',
         f"Processor time for each simulated second: {'; '.join(costs)}. An explicit integrator, Runge-Kutta 3 at accuracy 1e-2: "
         f"{tried}."),
    ]


def runs_table(outcomes: Sequence[Outcome]) -> Table:
    """Every run."""
    rows = [[DRIVES[o.drive], o.contact, o.label, *(("–",) * 3 if o.note else (sign(o.x), sign(o.right), sign(o.heading))),
             "–" if np.isnan(o.cpu) else f"{o.cost:.2f}", o.note or ("" if o.seconds == outcomes[0].seconds else
                                                                                f"{o.seconds:g} s only")]
            for o in sorted(outcomes, key=lambda o: (o.drive, o.contact, o.solver, -o.setting))]
    return Table(("drive", "feet", "solver", "x [cm]", "right [cm]", "heading [deg]", "cpu s per s", ""), rows)


@style.styled
def draw(outcomes: Sequence[Outcome]) -> Figure:
    """x, heading and cost over the step: a column for each drive and contact; CENIC's at the right."""
    columns = [(d, c) for d in DRIVES for c in CONTACTS if any((o.drive, o.contact) == (d, c) for o in outcomes)]
    figure = style.new_figure(3.6 * len(columns) + 1, 8.5)
    grid = figure.subplots(3, len(columns), sharex=True, sharey="row", squeeze=False)
    for (drive, contact), axes in zip(columns, grid.T):
        mine = [o for o in outcomes if (o.drive, o.contact) == (drive, contact) and not o.note]
        for panel, value in zip(axes, (lambda o: o.x, lambda o: o.heading, lambda o: o.cost)):
            _draw_runs(panel, mine, value)
        if drive == "ideal":
            for x in (SIMULATED_M[0], SIMULATED_OWN[0]):
                axes[0].axhline(x, color=style.COMMAND, ls="--", lw=1, label="thesis's simulations, ideal joints")
        axes[0].set_title(f"{DRIVES[drive]}, {contact}")
        axes[2].set_yscale("log")
        axes[2].set_xlabel("step [ms] | CENIC accuracy")
    for panel, label in zip(grid[:, 0], ("x, forward [cm]", "heading, left [deg]", "processor s for each second")):
        panel.set_ylabel(label)
    found = {label: handle for axes in grid.flat for handle, label in zip(*axes.get_legend_handles_labels())}
    figure.legend(list(found.values()), list(found), loc="outside lower center", ncols=len(found))
    return figure


def _draw_runs(axes: Axes, outcomes: Sequence[Outcome], value: Callable[[Outcome], float]) -> None:
    steps, accuracies = list(STEPS["point"]), list(ACCURACIES)
    for approximation, colour in zip(APPROXIMATIONS, (style.SIMULATED, style.RECORDED, style.ACCENT)):
        mine = sorted((o for o in outcomes if o.solver == approximation), key=lambda o: -o.setting)
        axes.plot([steps.index(o.setting) for o in mine], [value(o) for o in mine], "o-", color=colour, label=approximation)
    mine = [o for o in outcomes if not o.discrete]
    axes.plot([len(steps) + accuracies.index(o.setting) for o in mine], [value(o) for o in mine], "D", color=style.OTHERS[0],
              label="CENIC")
    axes.axvline(len(steps) - 0.5, color="#BBBBBB", lw=0.8)
    ticks = [*(f"{1e3 * h:g}" for h in steps), *(f"{a:.0e}".replace("e-0", "e−") for a in accuracies)]
    axes.set_xticks(range(len(ticks)), ticks)


if __name__ == "__main__":
    raise SystemExit(run_study("solvers_and_steps", __doc__, solvers_and_steps))
