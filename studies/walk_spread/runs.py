"""The design's runs: in parallel, and kept, so that a run that was made is not made again."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies import inputs
from studies.common import COORDINATES, body_track
from studies.walk_spread.design import Case, Design, with_masses
from workbench.files.reading import read_text, write_whole
from workbench.motion import Commands, load_motion
from workbench.robot import BUS_IDS, Ground, RobotModel, data_file
from workbench.simulation import Job, SimulationConfig, simulate_batch
from workbench.simulation.play import motion_job

Array = NDArray[np.float64]
Ends = dict[Case, Array]
"""Case -> COORDINATES (6,) at the end, and the largest tilt on the way [deg]."""

CHUNK = 8
_COLUMNS = ("drive", "masses", "friction", "step", "contact", "excursion")


def run_design(design: Design, model: RobotModel, folder: Path, progress: Callable[[str, float | None], None]) -> Ends:
    """Every run of the design. Finished ones are in a table named after the design's hash and are not repeated."""
    table = folder / f"runs-{design.sha256[:12]}.csv"
    ends = load_runs(table, design)
    left = sorted((c for c in design.cases if c not in ends), key=lambda c: (c.contact == "point", c.step))
    models = {m: with_masses(model.description, m, folder / "models") for m in {c.masses for c in left}}
    all_runs = len(design.cases)
    for at in range(0, len(left), CHUNK):
        chunk = left[at:at + CHUNK]
        jobs = [job_of(replace(model, description=models[c.masses]), c, design.seconds) for c in chunk]
        done = len(ends)
        takes = simulate_batch(jobs, progress=lambda n, _, done=done: progress(  # type: ignore[misc]
            f"running {all_runs} walks", (done + n) / all_runs))
        for case, take in zip(chunk, takes):
            track = body_track(take, np.arange(0.05, design.seconds, 0.05))
            up = np.cos(np.radians(track[:, 3])) * np.cos(np.radians(track[:, 5]))
            ends[case] = np.append(track[-1], np.degrees(np.arccos(up.min())))
        save_runs(table, ends)
    return {c: ends[c] for c in design.cases}


def job_of(model: RobotModel, case: Case, seconds: float) -> Job:
    """A servo gets the firmware's commands; ideal joints the thesis's angles under its own filter."""
    friction = float(case.excursion.split()[1]) if case.excursion.startswith("friction") else case.friction
    model = replace(model, ground=Ground(friction=friction, stiffness=model.ground.stiffness))
    if case.excursion.startswith("supply"):
        model = model.with_servos({"supply_voltage": float(case.excursion.split()[1])})
    config = SimulationConfig(time_step=case.step, drive=case.drive, contact=case.contact, contact_period=0.0, log_period=0.01)
    if case.drive == "ideal":
        return inputs.ideal_job(model, config, inputs.own_filter(inputs.robotis()[0]), seconds)
    job = motion_job(model, config, load_motion(data_file("robotis_walk.csv"), model), inputs.CYCLES, seconds, inputs.LEAD)
    if case.excursion.startswith("speeds"):
        assert job.commands is not None
        job = replace(job, commands=speeds_by_name(job.commands))
    return job


def speeds_by_name(commands: Commands) -> Commands:
    """Figure 3.4 read by one loop: the servo with the k-th bus ID gets the speed of the k-th name."""
    by_id, by_name = sorted(commands.joints, key=lambda j: BUS_IDS[j]), sorted(commands.joints)
    speeds = commands.speeds.copy()
    for servo, name in zip(by_id, by_name):
        speeds[:, commands.column(servo)] = commands.speeds[:, commands.column(name)]
    return replace(commands, speeds=speeds)


def save_runs(path: Path, ends: Mapping[Case, Array]) -> None:
    """The table, whole."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*_COLUMNS, *COORDINATES, "tilt"))
    writer.writerows([*(getattr(case, c) for c in _COLUMNS), *(f"{v:.6g}" for v in end)] for case, end in ends.items())
    write_whole(path, text.getvalue())


def load_runs(path: Path, design: Design) -> Ends:
    """Runs that were kept; none if there is no table."""
    if not path.is_file():
        return {}
    cases = {tuple(str(getattr(c, k)) for k in _COLUMNS): c for c in design.cases}
    rows = csv.DictReader(io.StringIO(read_text(path)))
    return {cases[tuple(r[k] for k in _COLUMNS)]: np.array([float(r[k]) for k in (*COORDINATES, "tilt")]) for r in rows}
