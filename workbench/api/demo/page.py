"""The demo on bundled data: a walk simulated four ways and compared, a diagnosis, firmware tables, a new gait."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from workbench.api.demo.diagnosis import diagnosis_section
from workbench.api.demo.gait import gait_section
from workbench.compare import metrics
from workbench.compare.compare_session import compare_session
from workbench.compare.footfalls import foot_phases
from workbench.compare.results import Comparison
from workbench.compare.session import load_session
from workbench.device import export
from workbench.device.tables.limits import Violation
from workbench.motion import Motion, load_motion
from workbench.recording.formats.rollout_table import save_rollout
from workbench.recording.take import Take
from workbench.robot import RobotModel, data_file, puppy_model
from workbench.simulation import SimulationConfig, simulate_batch
from workbench.simulation.play import motion_job
from workbench.types import Progress
from workbench.view.figures import body_attitude, body_path, by_joint, film_strip, footfalls, joint_grid, joint_torques, stance_of
from workbench.view.report.comparison import headline, take_section
from workbench.view.report.page import Details, Picture, Provenance, Replay, Report, Section, Table, Text
from workbench.view.scene.replay import write_replay

SECONDS, CYCLES = 6.0, 13
"""Duration of the walk, from rest [s] (thesis, chapter 7.2); its cycles take 0.468 s."""
RUNS = ("servo", "point"), ("servo", "hydroelastic"), ("ideal", "point"), ("ideal", "hydroelastic")
DRIVES = {"servo": "servo law", "ideal": "ideal joints"}
Row = tuple[str, float, float, float]

THESIS: tuple[Row, ...] = (
    ("thesis: real robot", 37.01, -0.18, -0.10),
    ("thesis: simulation, MATLAB filter", 32.70, -0.38, -1.28),
    ("thesis: simulation, own filter", 32.35, -0.38, -1.81),
)
"""Where the body was after six seconds of the ROBOTIS walk, cm: x forward, y up, z right (thesis, chapter 7.2)."""

_HEADER = ["six seconds of the ROBOTIS walk", "x [cm]", "y, up [cm]", "z, right [cm]"]
_SUMMARY = (
    "The ROBOTIS walk, played by the servo law from the firmware's own table and followed exactly by ideal joints, in point "
    "and in hydroelastic contact, and compared with a bundled recording; a diagnosis of missing physics; the walk as the robot's "
    "firmware tables; a new gait.")
_SYNTHETIC = (
    "The recording is **synthetic**: the same robot in another engine (MuJoCo), filmed as a motion capture system would. "
    "Nothing is hidden in it: the differences come from the engine, the capture's noise, and the chaos of walking, which "
    "amplifies both.")


@dataclass(frozen=True)
class Demo:
    """Results of the demo. table: the thesis's with our rows under it, as text. finding: of the comparison. diagnosed: of the
    diagnosis. page: the report."""

    table: str
    finding: str
    diagnosed: str
    page: Path
    comparison: Comparison


def run_demo(folder: Path, progress: Progress) -> Demo:
    """Simulates, compares, exports and writes everything into `folder`; progress: called with the stage and the share done."""
    began = time.monotonic()
    model = puppy_model()
    motion = load_motion(data_file("robotis_walk.csv"), model)
    takes = _walks(model, motion, progress)
    session = load_session(data_file("synthetic_walk/session.yaml"))
    comparison = compare_session(session, progress=progress)
    diagnosed = diagnosis_section(folder / "diagnosis", progress)
    progress("writing firmware tables", None)
    violations = export(motion, model, folder / "firmware", next(iter(takes.values()))).violations
    progress("drawing", None)
    for label, take in takes.items():
        save_rollout(take, folder / f"{label.replace(', ', '-').replace(' ', '_')}.csv")
    comparison.save(folder / "comparison.json")
    rows = [*THESIS, *((label, *_end(take)) for label, take in takes.items())]
    lengths = [_end(take)[0] for take in takes.values()]
    report = Report(
        "workbench demo", f"Six seconds of the ROBOTIS walk: {min(lengths):.0f} to {max(lengths):.0f} cm, by drive and "
        f"contact. The bundled arm: {diagnosed.headline}",
        _SUMMARY, [(label, f"{_end(t)[0]:.1f} cm", f"heading {_heading(t):+.1f}°") for label, t in takes.items()],
        Provenance.of(model, seconds=time.monotonic() - began))
    report.add(_walk_section(rows, takes, model, folder))
    report.add(Section("Against a recording", [Text(_SYNTHETIC), Text(headline(comparison))]))
    for compared in comparison.takes:
        report.add(take_section(compared, session.model, folder / f"replay-{compared.name}-recorded.html"))
    report.add(diagnosed.section)
    report.add(_firmware_section(motion, folder / "firmware", violations))
    report.add(gait_section(folder / "gait", model, progress))
    progress("drawing the report", None)
    return Demo(_as_text(rows), headline(comparison), diagnosed.headline, report.write(folder / "report.html"), comparison)


def _walks(model: RobotModel, motion: Motion, progress: Progress) -> dict[str, Take]:
    """The four runs by label, beginning with the servo law in point contact."""
    labels = [f"{DRIVES[drive]}, {contact}" for drive, contact in RUNS]
    configs = [SimulationConfig(drive=drive, contact=contact, engine="drake") for drive, contact in RUNS]
    jobs = [motion_job(model, config, motion, CYCLES, SECONDS) for config in configs]
    progress(f"simulating {len(jobs)} walks", 0.0)
    takes = simulate_batch(jobs, progress=lambda n, of: progress(f"simulating {of} walks", n / of))
    return {label: replace(take, name=label) for label, take in zip(labels, takes)}


def _end(take: Take) -> tuple[float, float, float]:
    """The body's final position in the thesis's axes [cm]: forward, up, right."""
    assert take.p_WB is not None
    forward, left, up = 100 * metrics.displacement(take.p_WB, take.since_start)
    return float(forward), float(up), float(-left)


def _heading(take: Take) -> float:
    assert take.quat_WB is not None
    return float(np.rad2deg(metrics.heading_change(take.quat_WB, take.since_start)))


def _walk_section(rows: list[Row], takes: Mapping[str, Take], model: RobotModel, folder: Path) -> Section:
    (label, main), *others = takes.items()
    stance = stance_of(foot_phases(main, model), main)
    replay = write_replay(folder / "replay-walk.html", model, main, title=label).path
    limit = {j: model.servo(j).torque_at_full_duty for j in main.joints}
    assert main.torque is not None
    torques = joint_torques(main.since_start, main.joints, {"on the link": main.torque}, limit=limit)
    return Section("The walk, simulated", [
        Table(_HEADER, [[name, *(f"{v:.2f}".replace("-", "−") for v in values)] for name, *values in rows],
              "Where the body was after six seconds, from rest at the origin.", emphasis=range(len(THESIS), len(rows))),
        Picture(body_path(main, others=dict(others)), "The same walk four ways: how far drive and contact model alone take it."),
        Replay(replay, f"{label}, with the ground's forces.", film_strip(model, main)),
        Picture(footfalls(stance, span=(0.0, SECONDS)), f"Stance of each foot: {label}."),
        Details("Angles, torques, attitude", [
            Picture(joint_grid(main, stance=by_joint(stance, model)),
                    "Each joint, commanded and simulated; the foot's stance is shaded."),
            Picture(torques, "Torque of each joint, and the servo's at full duty."), Picture(body_attitude(main))])])


def _firmware_section(motion: Motion, folder: Path, violations: tuple[Violation, ...]) -> Section:
    table = motion.as_table()
    rows = [[str(k + 1), str(table.dwells_ms[k]), *map(str, goals)] for k, goals in enumerate(table.goals)]
    names = ", ".join(f"`{path.name}`" for path in sorted(folder.iterdir()))
    result = "\n\n".join(str(v) for v in violations) or "Every servo stays within its limits."
    return Section("Onto the robot", [
        Text(f"{names} in `firmware/`, checked against each servo's range, speed and, as it ran in simulation, torque."),
        Table(["pose", "dwell [ms]", *table.joints], rows, "; ".join(map(str, table.families)) + "."),
        Details("Result of the check", [Text(result)])])


def _as_text(rows: list[Row]) -> str:
    width = max(len(name) for name, *_ in rows)
    lines = [f"{_HEADER[0]:<{width}}  {'x':>8s}{'y (up)':>9s}{'z (right)':>11s}  cm"]
    return "\n".join(lines + [f"{name:<{width}}  {x:8.2f}{y:9.2f}{z:11.2f}" for name, x, y, z in rows])
