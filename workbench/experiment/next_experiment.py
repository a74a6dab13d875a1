"""Chooses the next experiment: adds to a diagnosis with ties a motion that separates them."""

from __future__ import annotations

from dataclasses import replace

from workbench.experiment.design import design_experiment
from workbench.identify.diagnosis import DiagnosisResult
from workbench.identify.results.findings import Diagnosis
from workbench.motion import Motion
from workbench.types import Progress, no_progress

MOTION = "next_experiment.csv"
"""Name of the motion's file, next to findings.json."""


def with_next_experiment(result: DiagnosisResult, n_jobs: int = 2, progress: Progress = no_progress
                         ) -> tuple[Diagnosis, Motion | None]:
    """The diagnosis with its next experiment, and that experiment's motion; the unchanged diagnosis and None where nothing is
    tied or no motion separates the tie. progress: called with the current stage and the share done."""
    if not result.ties:
        return result.diagnosis, None
    rivals = [(tie.found, tie.rival) for tie in result.ties]
    experiment = design_experiment(result.diagnosis.nominal, rivals, result.observations, n_jobs, progress)
    entry = experiment.entry(MOTION)
    if entry is None:
        return result.diagnosis, None
    return replace(result.diagnosis, next_experiment=entry), experiment.motion
