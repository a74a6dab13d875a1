"""A model predicts takes that it was not fitted to (docs/formats.md, sections 1, 3 and 5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from workbench.compare.options import COMPARE
from workbench.compare.session import PredictSpec, Session
from workbench.compare.session_takes import LeftOut, capture_yaw, read_takes
from workbench.effects.apply import apply_to_measurement
from workbench.files import InputError
from workbench.motion import load_motion
from workbench.recording.formats.joint_log import write_joint_log
from workbench.recording.formats.motive_write import write_motive
from workbench.recording.formats.read import read_recording
from workbench.recording.joint_names import named_by_model
from workbench.recording.mocap.conventions import layout_yaw
from workbench.recording.mocap.observe import observe
from workbench.recording.mocap.registration import register
from workbench.recording.mocap.tracks import check_assets, tracks_of
from workbench.recording.recording import Recording
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig, Start
from workbench.simulation.batch import Job, run_job, simulate_batch
from workbench.types import Array, Progress, no_progress


@dataclass(frozen=True)
class Predicted:
    """The predictions. paths: files, in the format of a recording. takes: the simulated take (SI, radians) behind each file, in
    the same order. left_out: name of each damaged take of the session, and why it was left out."""

    paths: tuple[Path, ...]
    takes: tuple[Take, ...]
    left_out: LeftOut = ()


def predict_session(session: Session, model: RobotModel, out_dir: Path, progress: Progress = no_progress, *,
                    nominal: RobotModel | None = None, config: SimulationConfig | None = None, yaw: float | None = None,
                    n_jobs: int = 2) -> Predicted:
    """Plays each of the session's `predict` entries on `model` and writes OUT_DIR/NAME.csv, as the recording would look.

    nominal: another model, whose predictions are written to NAME.nominal.csv beside. config: of the rollouts, their base as each
    entry says; by default Drake's. yaw [rad]: of the session, where it is known already; else found from its takes, as a start
    file, in which the robot stands still, does not tell it. A captured take becomes a Motive CSV: `frames` frames at the start
    file's rate and units, its assets, axes, pivots and clock. A prediction of `commands` becomes a joint log with their times,
    from the state in their first row. InputError where a file does not fit, there is nothing to predict, or no yaw can be found.
    """
    config = config or SimulationConfig(contact_period=0, engine="drake")  # nobody asks for contact forces
    if not session.predict:
        raise InputError(session.path, "predict: expected at least one entry")
    models = {"": model} if nominal is None else {"": model, ".nominal": nominal}
    versions = {ending: session.with_model(m) for ending, m in models.items()}
    captured = [_Captured(spec, read_start(spec.start)) for spec in session.predict if spec.start is not None]
    left_out: LeftOut = ()
    if captured and yaw is None and not session.takes:
        yaw = session.yaw if session.yaw is not None else _yaw_of_starts(session, [c.start for c in captured])
    if captured and yaw is None:
        progress("finding the yaw", None)
        takes, left_out = read_takes(session)
        yaw = capture_yaw(session, takes)
        if yaw is None:
            raise InputError(session.path, "takes: expected a captured one, from which the yaw of the capture can be found")
    jobs = [(c, ending, c.job(s, config)) for c in captured for ending, s in versions.items()]
    rollouts = list(simulate_batch([job for *_, job in jobs], n_jobs, lambda n, of: progress("simulating", n / of)))
    paths = [c.write(take, job.model, yaw or 0.0, out_dir / f"{c.spec.name}{ending}.csv")
             for (c, ending, job), take in zip(jobs, rollouts)]
    for spec in session.predict:
        if spec.commands is not None:
            progress(f"simulating {spec.name}", None)
            for ending, s in versions.items():
                paths.append(out_dir / f"{spec.name}{ending}.csv")
                rollouts.append(predict_log(s, spec, paths[-1], config))
    return Predicted(tuple(paths), tuple(rollouts), left_out)


def _yaw_of_starts(session: Session, starts: Sequence[Recording]) -> float:
    """The yaw [rad] of a session of predictions alone, from where the bodies stand: good to some degrees, as pivots lie
    anywhere on their links. InputError where that does not give it."""
    yaws = [layout_yaw(tracks_of(start), session.model) for start in starts]
    known = [yaw for yaw in yaws if yaw is not None]
    if not known:
        raise InputError(session.path, "yaw: is missing, and cannot be found from takes, nor from where the bodies of the "
                         "start files stand")
    return float(np.angle(np.mean(np.exp(1j * np.array(known)))))


def read_start(path: Path) -> Recording:
    """The first frames of a captured take."""
    start = read_recording(path)
    if start.sensing != "mocap" or not start.rigid_bodies:
        raise InputError(path, "expected the start of a Motive take with rigid bodies")
    return start


@dataclass(frozen=True)
class _Captured:
    """A take that cameras are to see, and its start as they saw it."""

    spec: PredictSpec
    start: Recording

    @property
    def time(self) -> Array:
        """Times of the frames, counted from the start file's first [s]."""
        assert self.spec.frames is not None
        return np.arange(self.spec.frames) / self.start.rate

    @property
    def starts_at(self) -> float:
        assert self.spec.starts_at is not None
        return self.spec.starts_at

    def job(self, session: Session, config: SimulationConfig) -> Job:
        model = session.model_of(self.spec)
        assert self.spec.motion is not None
        commands = load_motion(self.spec.motion, model).commands(self.spec.cycles)
        check_assets(self.start, model)
        after = max(float(self.time[-1]) - self.starts_at, 0.0) + config.logged_every
        return Job(model, replace(config, base=self.spec.base), commands, after, COMPARE.lead, name=self.spec.name)

    def write(self, take: Take, model: RobotModel, yaw: float, path: Path) -> Path:
        """Writes a rollout as the cameras of the start file would have seen it."""
        start = self.start
        measurement = register(start, model, take.commands, take, self.starts_at, yaw, self.spec.base)
        _, bodies = observe(take, apply_to_measurement(measurement, model), model, self.time)
        return write_motive(path, {asset: bodies[asset] for asset in start.rigid_bodies}, start.rate, units=start.units,
                            take_name=self.spec.name, first_frame=int(start.frames[0]), metadata=start.metadata)


def predict_log(session: Session, spec: PredictSpec, path: Path, config: SimulationConfig) -> Take:
    """Plays the goals of a log on the session's model and writes the log that the servos would keep: the same times, goals and
    torque enables, and their positions. Joints start at the angles and speeds of the first row; without those, at rest in
    neutral. Returns the simulated take, as the servos' sensors see it."""
    assert spec.commands is not None
    model = session.model_of(spec)
    log = read_recording(spec.commands)
    if log.kind != "joint_log" or log.commands is None:
        raise InputError(spec.commands, "expected a joint log with goals")
    log = named_by_model(log, model)
    first = {kind: np.array([log.channels.get(f"{kind}.{j}", [np.nan])[0] for j in model.joints])
             for kind in ("position", "velocity")}
    known = np.isfinite(first["position"]).any()
    if known and spec.base == "free":
        raise InputError(spec.commands, f"position.{model.joints[0]}: a start away from neutral needs base fixed")
    start = Start(np.nan_to_num(first["position"]), np.nan_to_num(first["velocity"]), logged=True) if known else None
    since = log.time - log.time[0]
    take = run_job(Job(model, replace(config, base=spec.base), log.commands, float(since[-1]) + config.logged_every, COMPARE.lead,
                       name=spec.name, start=start)).as_logged()
    commanded = [j for j in model.joints if f"goal.{j}" in log.channels]
    channels = {name: values for name, values in log.channels.items() if name.startswith(("goal.", "enabled."))}
    channels |= {f"position.{j}": np.interp(since, take.time, take.q[:, take.column(j)]) for j in commanded}
    write_joint_log(path, log.time, channels)
    return take
