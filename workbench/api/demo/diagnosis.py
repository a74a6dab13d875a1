"""The central part of the demo: finds the physics that the model of a simulated arm lacks, from the arm's logs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from workbench.compare.session import load_session
from workbench.identify.diagnosis import diagnose_session
from workbench.identify.results.findings import Diagnosis
from workbench.robot import data_file
from workbench.types import Progress
from workbench.view.figures.gap import before_after
from workbench.view.report.diagnosis import write_diagnosis
from workbench.view.report.page import Part, Picture, Section, Text
from workbench.view.report.words import headline, sentence_of

_ABOUT = (
    "An arm of three servos logged its own joints (`data/tutorial_arm`). The logs are **synthetic**: another simulator made "
    "them, with 0.12 N m more dry friction in the elbow than the model knows. The diagnosis sees the logs and the nominal "
    "model alone:")
_MORE = (
    "`diagnosis/report.html` has the evidence, the rivals that were tried, intervals, and a 3D replay with the recorded arm as "
    "a ghost.")


@dataclass(frozen=True)
class Found:
    """The diagnosis in the demo: its section of the page, and its verdict in a sentence."""

    section: Section
    headline: str


def diagnosis_section(folder: Path, progress: Progress) -> Found:
    """Diagnoses the bundled logs of an arm and writes the diagnosis into `folder`. progress: called with the current stage and
    the share done."""

    def stage(what: str, done: float | None) -> None:
        progress(f"a diagnosis: {what}", done)

    session = load_session(data_file("tutorial_arm/session.yaml"))
    found = diagnose_session(session, stage, n_jobs=2)
    diagnosis: Diagnosis = found.diagnosis
    folder.mkdir(parents=True, exist_ok=True)
    write_diagnosis(diagnosis, found.takes, folder, "the tutorial's arm", stage)
    parts: list[Part] = [Text(_ABOUT), Text(f"**{headline(diagnosis)}** " + " ".join(sentence_of(f) for f in diagnosis.findings))]
    parts += [Picture(before_after(found.takes[0], place), f"{place}: recorded, by the nominal model, and by the diagnosed one.")
              for f in diagnosis.findings[:1] for place in f.where[:1]]
    return Found(Section("Which physics is missing", [*parts, Text(_MORE)]), headline(diagnosis))
