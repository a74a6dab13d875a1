"""Real recordings of a Dynamixel XL-330 with a pendulum: which physics do the published friction models lack?

    python -m studies.xl330 [--out runs/studies/xl330] [--quick]

Rhoban's logs at position gains 100, 200 and 400 (data of ../shared, not part of the project), with BAM's published M1 as nominal
servo. Everything is fitted on two gains and judged on the third, for each of the three: BAM's M1, M3, M4 and M6 as published and
refitted, and effects of the workbench, chosen one by one on the two gains alone. What is said of the workbench's models comes
from rollouts of its station (Drake). `python -m studies.xl330.diagnose`, run before, adds what `workbench diagnose` finds. Quick:
two effects at most, one gain left out, M1 alone refitted.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from studies.common import ROOT, publish, run_study
from studies.xl330 import bam, effects
from studies.xl330.figures import draw_balance, draw_logs
from studies.xl330.page import Results, page
from studies.xl330.questions import ask, full_duty
from studies.xl330.rig import find_logs, nominal_servo, published, write_session
from studies.xl330.selection import fit_published, select, training
from studies.xl330.station import DIAGNOSED, station_errors, with_specs
from workbench.compare.session import load_session
from workbench.robot import InputError, load_model

DATA = ROOT.parent / "shared/data/xl330"
MODELS = ("m1", "m3", "m4", "m6")
GAINS = (100, 200, 400)


def xl330(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Runs the study and writes page, figures and numbers."""
    began = time.monotonic()
    if not DATA.is_dir():
        raise InputError(DATA, "is missing: the recordings lie beside the project, not in it")
    found, models = find_logs(DATA), {m: published(DATA, m) for m in MODELS}
    m1, left_out = models["m1"], GAINS[1:2] if quick else GAINS
    theirs, ours = bam.even(found), bam.even(found, effects.STEP, held=True)
    progress("friction models as published", None)
    as_published = {m: bam.errors(theirs, bam.roll_out(theirs, m, p))[0] for m, p in models.items()}
    refitted: dict[str, dict[int, np.ndarray]] = {}
    for m in MODELS[:1] if quick else MODELS:
        progress(f"refitting {m.upper()}", None)
        fits = fit_published(m, models[m], theirs, [training(theirs, g) for g in left_out], starts=1 if quick else 3)
        refitted[m] = {g: bam.errors(theirs, bam.roll_out(theirs, m, p))[0] for g, p in zip(left_out, fits)}
    chains = dict(zip(left_out, select(ours, m1, left_out, lambda what: progress(what, None), most=2 if quick else None)))
    chosen = {g: chain[-1] for g, chain in chains.items()}
    progress("asking what else would do", None)
    questions = [] if quick else ask(chosen, ours, m1)
    station: dict[str, dict[int, dict[str, float]]] = {"effects": {}, "diagnose": {}}
    for gain in left_out:
        progress(f"station, gain {gain} left out", None)
        session = load_session(write_session(out / f"without_{gain}", found, m1, [gain]))
        model = with_specs(session, effects.specs(chosen[gain].values, ours.length))
        station["effects"][gain] = station_errors(session, model, gain)
        told = out / f"without_{gain}" / DIAGNOSED
        if told.is_file() and not quick:
            station["diagnose"][gain] = station_errors(session, load_model(told), gain)
    shown = left_out[-1] if quick else 200
    at = ours.at([shown])
    curves = {"M1 as published": effects.roll_out(at, m1, {})[:, 0],
              "effects, fitted at the other gains": effects.roll_out(at, m1, chosen[shown].values)[:, 0]}
    figures = {"balance": draw_balance(found, float(nominal_servo(m1, found[0].supply)["stall_torque"])),
               "validation": draw_logs(at, curves, effects.STEP, f"gain {shown}, which no fit saw")}
    results = Results(theirs, ours, m1, as_published, refitted, chains, questions, station, full_duty(found))
    session_model = load_session(out / f"without_{left_out[0]}" / "session.yaml").model
    report = page(results, figures, session_model, time.monotonic() - began, quick)
    return publish(out, session_model, report, results.numbers(), figures)


if __name__ == "__main__":
    raise SystemExit(run_study("xl330", __doc__, xl330))
