"""A real SO-101 arm, from named programmes: deviations of each joint, position of the clock, effect of load.

    python -m studies.so101 [--data ../shared/data/so101] [--out runs/studies/so101] [--model model.yaml] [--read-off-only]

Writes the arm as a session (robot.sdf, servos, session.yaml of training programmes, validation.yaml), measures it, has the
workbench diagnose the training programmes, and compares the nominal model, a plain baseline, a model estimated from the
measurements and the diagnosed one on the validation programmes. --model: one diagnosed before. --read-off-only: without a
diagnosis.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np

from studies.common import ROOT, publish
from studies.so101 import page
from studies.so101.baseline import fit_baseline
from studies.so101.evaluate import degrees, errors, simulate, together
from studies.so101.figures import draw_current, draw_errors, draw_loops, draw_overlay
from studies.so101.measured import Measured, measure
from studies.so101.programmes import TRAINING, VALIDATION, jaw_range, load_programmes
from studies.so101.published import PUBLISHED
from studies.so101.read_off import read_off
from studies.so101.session import write_session
from workbench.cli.memory import rollout_memory
from workbench.cli.progress import Progress
from workbench.compare.session import Session, load_session
from workbench.files import InputError
from workbench.recording.formats.sage import JOINTS
from workbench.robot import RobotModel
from workbench.robot.model_file import load_model
from workbench.types import Array
from workbench.view.report.page import Picture, Provenance, Report, Section

Say = Callable[[str, float | None], None]
BESIDE = ROOT.parent / "shared/data/so101"
SLOW = "friction_gravity"
SHOWN, SPAN = "fast_transitions", (5.0, 20.0)
SHOWN_MODELS = ("nominal", "read off", "diagnosed")


def so101(data: Path, out: Path, model_file: Path | None, diagnosing: bool, n_jobs: int, progress: Say) -> str:
    """Runs the study and writes page, figures, numbers and the session."""
    began = time.monotonic()
    progress("reading programmes", None)
    programmes = load_programmes(data)
    session, held, slow = (
        load_session(write_session(data, out, names, jaw_range(programmes), file))
        for names, file in ((TRAINING, "session.yaml"), (VALIDATION, "validation.yaml"), ((SLOW,), "slow.yaml")))
    progress("measuring", None)
    m = measure(programmes, session.model.kinematics)
    nominal = session.model
    models = {"nominal": nominal, "read off": read_off(nominal, m.moving, m.resting, m.zeros)}
    if model_file is not None:
        models["diagnosed"] = held.with_model(load_model(model_file)).model
    elif diagnosing:
        models["diagnosed"] = _diagnosed(session, out, n_jobs, progress)
    unit = degrees(m.jaw_range)
    training, validation = [p for p in programmes if p.trained], [p for p in programmes if not p.trained]
    baseline = fit_baseline(training)
    paths = {name: simulate(held, model, progress, f"simulating, {name}", n_jobs) for name, model in models.items()}
    paths["delay and gain"] = {p.name: baseline.position(p) for p in validation}
    paths |= {p.name: simulate(held, p.robot(nominal, m.jaw_range), progress, f"simulating, {p.name}", n_jobs) for p in PUBLISHED}
    order = [n for n in ("nominal", *(p.name for p in PUBLISHED), "delay and gain", "read off", "diagnosed") if n in paths]
    each = {n: errors(validation, paths[n], unit) for n in order}
    for p in PUBLISHED:  # of joints that nobody published there is nothing to be judged
        each[p.name][:, [j not in p.joints for j in JOINTS]] = np.nan
    joint = {n: together(each[n], validation) for n in order}
    shown = next(p for p in validation if p.name == SHOWN)
    ramp = next(p for p in training if p.name == SLOW)
    figures = {
        "loops": draw_loops(ramp, simulate(slow, nominal, progress, "slow programme", n_jobs)[SLOW], unit),
        "current": draw_current(m.training, m.currents), "errors": draw_errors(joint),
        "overlay": draw_overlay(shown, {n: paths[n][SHOWN] for n in SHOWN_MODELS if n in paths}, unit, SPAN)}
    report = Report("SO-101", _headline(joint), page.WHAT, provenance=Provenance.of(nominal, seconds=time.monotonic() - began))
    report.add(Section("Clock", [page.clock_text(m.clock, len(programmes))]))
    report.add(Section("While a joint moves", [page.response_table(list(m.moving.values())), Picture(
        figures["loops"], f"Programme {SLOW}: width is dry friction, height what gravity does to a spring-like law.")]))
    report.add(Section("While it stands, and under load", [
        page.rest_table(m.resting, m.jaw_range), page.zero_table(list(m.zeros.values()))]))
    report.add(Section("Speed and current", [page.speed_table(m.speeds, m.currents), Picture(
        figures["current"], "tau_abs is proportional to the square of the error, in every joint: it is the supply's current, "
        "duty times the motor's, and no torque.")]))
    report.add(Section("Validation", [page.validation_table(joint), Picture(figures["errors"]), page.programme_table(
        validation, each), Picture(figures["overlay"], f"Validation programme {SHOWN}.")]))
    for name in ("read off", "diagnosed"):
        if name in models:
            report.add(Section(f"The model that was {name}", [page.effects_table(models[name])]))
    return publish(out, nominal, report, _numbers(m, joint, each, models), figures)


def _diagnosed(session: Session, out: Path, n_jobs: int, progress: Say) -> RobotModel:
    """The workbench's diagnosis of the training session; its files go into OUT/diagnosis."""
    from workbench.experiment.next_experiment import with_next_experiment
    from workbench.identify.diagnosis import diagnose_session
    from workbench.view.report.diagnosis import write_diagnosis

    with rollout_memory(out / "diagnosis", session) as memory:
        result = diagnose_session(session, progress, n_jobs, memory)
        diagnosis, _ = with_next_experiment(result, n_jobs, progress)
    (out / "diagnosis").mkdir(parents=True, exist_ok=True)
    write_diagnosis(diagnosis, result.takes, out / "diagnosis", str(session.path), progress)
    return diagnosis.model


def _headline(joint: Mapping[str, Array]) -> str:
    said = ", ".join(f"{name} {np.sqrt(np.mean(np.square(v))):.2f}°" for name, v in joint.items() if np.isfinite(v).all())
    return f"RMS over the joints on programmes that nothing was fitted to: {said}"


def _numbers(m: Measured, joint: Mapping[str, Array], each: Mapping[str, Array],
             models: Mapping[str, RobotModel]) -> dict[str, object]:
    by_programme = {n: dict(zip(VALIDATION, map(_known, np.sqrt(np.mean(np.square(e), axis=1))))) for n, e in each.items()}
    return {
        "clock": asdict(m.clock), "jaw_range": m.jaw_range, "joints": JOINTS,
        "moving": {j: asdict(r) for j, r in m.moving.items()},
        "resting": {j: None if s is None else asdict(s) for j, s in m.resting.items()},
        "zeros": {j: asdict(z) for j, z in m.zeros.items()}, "current": [asdict(c) for c in m.currents],
        "speeds": [asdict(f) for f in m.speeds],
        "validation": {n: dict(zip(JOINTS, map(_known, v))) for n, v in joint.items()},
        "validation_programmes": by_programme,
        "models": {n: model.as_dict()["effects"] for n, model in models.items()}}


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def main(argv: list[str] | None = None) -> int:
    """0, or 2 with one line on stderr where an input is bad."""
    parser = argparse.ArgumentParser(prog="python -m studies.so101", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, metavar="DIR", help=f"of the recordings (default: {BESIDE}, if it is there)")
    parser.add_argument("--out", type=Path, default=ROOT / "runs/studies/so101", metavar="DIR", help="default: %(default)s")
    parser.add_argument("--model", type=Path, metavar="FILE", help="a model.yaml diagnosed before, in place of a diagnosis")
    parser.add_argument("--read-off-only", action="store_true", help="without a diagnosis")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (default: %(default)s)")
    a = parser.parse_args(argv)
    if a.data is None and not BESIDE.is_dir():
        print(f"studies.so101: nothing done: it needs recordings that are not distributed, and {BESIDE} is missing")
        return 0
    began = time.monotonic()
    try:
        with Progress("study so101") as progress:
            said = so101((a.data or BESIDE).resolve(), a.out.resolve(), a.model, not a.read_off_only, a.jobs, progress)
    except InputError as e:
        print(f"studies.so101: {e}", file=sys.stderr)
        return 2
    print(f"{said} ({time.monotonic() - began:.0f} s)")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
