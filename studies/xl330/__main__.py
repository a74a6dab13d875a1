"""Real recordings of a Dynamixel XL-330 with a pendulum: which physics do the published friction models lack?

    python -m studies.xl330 [--out runs/studies/xl330] [--quick]

Rhoban's logs at position gains 100, 200 and 400 (data of ../shared, not part of the project), with BAM's published M1 as nominal
servo. `workbench diagnose` is asked about two gains and judged on the third, for each of the three, beside BAM's M1, M3, M4 and
M6 as published and refitted on the same two. Quick: one gain left out, M1 alone refitted, no diagnosis.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from studies.common import ROOT, publish, run_study
from studies.xl330 import bam
from studies.xl330.figures import draw_balance, draw_logs
from studies.xl330.page import Diagnosed, Results, page
from studies.xl330.refit import fit_published, training
from studies.xl330.rig import Log, find_logs, full_duty, nominal_servo, published, write_session
from studies.xl330.station import played
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.identify.diagnosis import diagnose_session
from workbench.types import Progress

DATA = ROOT.parent / "shared/data/xl330"
MODELS = ("m1", "m3", "m4", "m6")
GAINS = (100, 200, 400)


def xl330(out: Path, quick: bool, progress: Progress) -> str:
    """Runs the study and writes page, figures and numbers."""
    began = time.monotonic()
    if not DATA.is_dir():
        raise InputError(DATA, "is missing: this study needs recordings that are not distributed")
    found, models = find_logs(DATA), {m: published(DATA, m) for m in MODELS}
    left_out = GAINS[1:2] if quick else GAINS
    logs = bam.even(found)
    progress("friction models as published", None)
    as_published = {m: bam.errors(logs, bam.roll_out(logs, m, p))[0] for m, p in models.items()}
    refitted: dict[str, dict[int, np.ndarray]] = {}
    for m in MODELS[:1] if quick else MODELS:
        progress(f"refitting {m.upper()}", None)
        fits = fit_published(m, models[m], logs, [training(logs, g) for g in left_out], starts=1 if quick else 3)
        refitted[m] = {g: bam.errors(logs, bam.roll_out(logs, m, p))[0] for g, p in zip(left_out, fits)}
    diagnosed = {g: _diagnosed(out / f"without_{g}", found, models["m1"], g, quick, progress) for g in left_out}
    shown = diagnosed[left_out[-1]]
    figures = {"balance": draw_balance(found, float(nominal_servo(models["m1"], found[0].supply)["stall_torque"])),
               "validation": draw_logs({"M1 as published": shown.nominal, "diagnosed": shown.after},
                                       f"gain {left_out[-1]}, which the diagnosis did not see")}
    results = Results(logs, as_published, refitted, diagnosed, full_duty(found))
    report = page(results, figures, shown.model, time.monotonic() - began, quick)
    return publish(out, shown.model, report, results.numbers(), figures)


def _diagnosed(folder: Path, logs: list[Log], m1: dict[str, float], gain: int, quick: bool, progress: Progress) -> Diagnosed:
    """Diagnosis of the other gains' logs, and its error on this one. quick: without the diagnosis."""
    session = load_session(write_session(folder, logs, m1, [gain]))
    began = time.monotonic()
    told = None
    if not quick:
        told = diagnose_session(session, lambda what, share: progress(f"without gain {gain}: {what}", share)).diagnosis
    seconds = time.monotonic() - began
    if told is not None:
        told.save(folder)
    nominal = played(session, session.model, gain)
    after = nominal if told is None else played(session, told.model, gain)
    return Diagnosed(session.model, told, nominal, after, seconds)


if __name__ == "__main__":
    raise SystemExit(run_study("xl330", __doc__, xl330))
