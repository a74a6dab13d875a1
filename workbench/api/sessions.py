"""Compare, diagnose and predict a session; each result can save itself."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Literal

from workbench.compare import compare_session as comparing
from workbench.compare.prediction import predict_session
from workbench.compare.results import Comparison
from workbench.compare.session import Session, load_session
from workbench.compare.session_takes import LeftOut
from workbench.experiment.next_experiment import with_next_experiment
from workbench.files import InputError
from workbench.identify.diagnosis import diagnose_session
from workbench.identify.judge import COMPILED
from workbench.identify.results.findings import Diagnosis
from workbench.identify.results.take_report import TakeReport
from workbench.motion import Motion, save_motion
from workbench.recording import Take
from workbench.robot import RobotModel, load_model
from workbench.simulation import SimulationConfig
from workbench.types import Progress, no_progress
from workbench.view.report.comparison import headline as comparison_headline
from workbench.view.report.comparison import write_comparison
from workbench.view.report.diagnosis import write_diagnosis
from workbench.view.report.notebook import comparison_html, diagnosis_html, prediction_html


@dataclass(frozen=True)
class ComparisonResult:
    """A session's takes compared with their simulation.

    comparison: errors by take and joint, in SI units and radians (`Comparison.to_json` gives degrees); its `takes` hold the
    recorded and the simulated trajectories, its `left_out` the damaged takes. session: the session that was compared.
    """

    comparison: Comparison
    session: Session

    @property
    def headline(self) -> str:
        """The result in a sentence, for the report's head."""
        return comparison_headline(self.comparison)

    def save(self, folder: str | PathLike[str], progress: Progress = no_progress) -> list[Path]:
        """Writes comparison.json, report.html and a 3D replay of each take into `folder`; returns their paths, the report first.
        InputError where they cannot be written."""
        Path(folder).mkdir(parents=True, exist_ok=True)
        title = f"Session {self.session.path}"
        return write_comparison(self.comparison, self.session.model, Path(folder), title, progress)

    def _repr_html_(self) -> str:
        return comparison_html(self.comparison)


@dataclass(frozen=True)
class DiagnoseOptions:
    """How a session is diagnosed.

    jobs: number of parallel simulations. thorough: search to the end, however long it takes, instead of stopping at a limit of
    work. resume: folder for cached rollouts, from which an interrupted run continues; None: nothing is kept. without: names of
    effects (docs/formats.md, section 7) that are known to be absent; they are not searched for. previous: model.yaml of an
    earlier diagnosis of this robot, taken as nominal, so that findings are the changes since. engine: "auto" (compiled rollouts,
    checked by Drake) or "drake" (all rollouts by Drake, much slower). InputError for fewer than one process or an unknown engine.
    """

    jobs: int = 2
    thorough: bool = False
    resume: Path | None = None
    without: tuple[str, ...] = ()
    previous: Path | None = None
    engine: Literal["auto", "drake"] = "auto"

    def __post_init__(self) -> None:
        if self.jobs < 1:
            raise InputError(None, f"jobs: expected 1 or more processes, got {self.jobs}")
        if self.engine not in ("auto", "drake"):
            raise InputError(None, f"engine: expected 'auto' or 'drake', got {self.engine!r}")


@dataclass(frozen=True)
class DiagnosisResult:
    """The physics that the model left out.

    diagnosis: verdict, findings with their parameters (units of docs/formats.md, section 7: degrees, N m, s), errors in deg or m,
    unexplained residuals, damaged takes that were left out. session: the session that was diagnosed. takes: recorded and
    simulated trajectories and residuals, for figures (SI, radians). next_motion: to record next, where the data cannot separate
    two effects; else None.
    """

    diagnosis: Diagnosis
    session: Session
    takes: tuple[TakeReport, ...]
    next_motion: Motion | None = None

    @property
    def model(self) -> RobotModel:
        """The robot with the effects that were found."""
        return self.diagnosis.model

    def save(self, folder: str | PathLike[str], progress: Progress = no_progress, jobs: int = 2) -> list[Path]:
        """Writes findings.json, model.yaml, nominal.yaml, report.html, a 3D replay of each take, the next experiment's motion
        and, in predict/, the predictions that the session asks for; returns their paths, the report first. jobs: processes
        that simulate the predictions. InputError where they cannot be written."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        paths = write_diagnosis(self.diagnosis, self.takes, folder, str(self.session.path), progress)
        if self.next_motion is not None and self.diagnosis.next_experiment is not None:
            paths.append(folder / self.diagnosis.next_experiment.motion)
            save_motion(self.next_motion, paths[-1])
        if self.session.predict:
            (folder / "predict").mkdir(exist_ok=True)
            # Drake has judged the compiled station on these very models
            compiled_agrees = self.diagnosis.provenance.get("engine", {}).get("rollouts by") == COMPILED
            config = SimulationConfig(contact_period=0, engine="auto" if compiled_agrees else "drake")
            paths += predict_session(self.session, self.model, folder / "predict", progress, nominal=self.session.model,
                                     config=config, n_jobs=jobs).paths
        return paths

    def _repr_html_(self) -> str:
        return diagnosis_html(self.diagnosis)


@dataclass(frozen=True)
class PredictionResult:
    """Predictions of a model for takes that it was not fitted to; the files are already written.

    takes: the simulated takes, in SI units and radians, time zero at the first command. paths: the file of each take, in the same
    order. left_out: name of each damaged take of the session, and why it was left out (the capture's yaw is found from the
    others).
    """

    takes: tuple[Take, ...]
    paths: tuple[Path, ...]
    left_out: LeftOut = ()

    def _repr_html_(self) -> str:
        return prediction_html(self.takes, self.paths, self.left_out)


def compare_session(session: Session | str | PathLike[str], config: SimulationConfig | None = None,
                    model: RobotModel | None = None, *, progress: Progress = no_progress, jobs: int = 2,
                    finer_steps: Literal["judged", "drake"] = "judged") -> ComparisonResult:
    """Simulates, registers and compares every take of a session (or of a session.yaml).

    config: of the rollouts, their base as each take says. model: another model of the robot than the session's, such as a
    diagnosed one. progress: called with the stage and the share done. jobs: processes that simulate. finer_steps: of the
    numerical floor, by the compiled station where Drake judged it to do the same ("judged"), or all by Drake.

    Returns errors (RMS after the first command) of each joint [rad] and of the base [m], with noise and numerical floor, and the
    takes in SI units and radians, world x forward, y left, z up. A damaged take is left out and named in `comparison.left_out`;
    InputError for bad input, for a `model` with other links or joints, or where no take remains.
    """
    session = _load(session)
    session = session if model is None else session.with_model(model)
    return ComparisonResult(comparing.compare_session(session, config, progress=progress, n_jobs=jobs, finer_steps=finer_steps),
                            session)


def diagnose(session: Session | str | PathLike[str], options: DiagnoseOptions | None = None, *,
             progress: Progress = no_progress) -> DiagnosisResult:
    """Finds the physics that a session's model left out: 15 to 30 s of processor time for a practice session (docs/validation.md)
    in which one or two effects are missing, some minutes for more.

    session: loaded, or a session.yaml or its folder. progress: called with the stage and the share done. Returns effects with
    probability, parameters and 90 % bounds (units of docs/formats.md, section 7), and the robot with those effects. A damaged
    take is left out and named in `diagnosis.left_out`; InputError for bad input, or where no take remains.
    """
    options = options or DiagnoseOptions()
    session = _load(session)
    previous = None if options.previous is None else load_model(options.previous)
    found = diagnose_session(session, progress, options.jobs, options.resume, options.thorough, options.without, previous,
                             options.engine)
    diagnosis, motion = with_next_experiment(found, options.jobs, progress)
    return DiagnosisResult(diagnosis, session, found.takes, motion)


def predict(session: Session | str | PathLike[str], folder: str | PathLike[str], model: RobotModel | None = None,
            config: SimulationConfig | None = None, *, progress: Progress = no_progress, jobs: int = 2) -> PredictionResult:
    """Simulates the entries of a session's `predict` and writes FOLDER/NAME.csv for each, as the cameras or the servos' log would
    show it (docs/formats.md, section 5).

    model: robot that is simulated; None: the session's own. config: of the rollouts, their base as each entry says. progress:
    called with the stage and the share done. jobs: processes that simulate. InputError for bad input, or a session without
    `predict`.
    """
    session = _load(session)
    Path(folder).mkdir(parents=True, exist_ok=True)
    found = predict_session(session, model or session.model, Path(folder), progress, config=config, n_jobs=jobs)
    return PredictionResult(found.takes, found.paths, found.left_out)


def _load(session: Session | str | PathLike[str]) -> Session:
    return session if isinstance(session, Session) else load_session(Path(session))
