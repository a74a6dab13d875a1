"""Inverse dynamics of a file: a take of a session, a rollout, a motion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from workbench.compare.compare_session import Run, roll_out
from workbench.compare.session import Base, Session, TakeSpec, load_session
from workbench.compare.session_takes import read_takes, register_takes
from workbench.dynamics import InverseDynamics, InverseDynamicsResult, inverse_dynamics
from workbench.files import InputError
from workbench.motion import load_motion
from workbench.recording.formats.file_kind import file_kind
from workbench.recording.formats.rollout_table import load_rollout
from workbench.robot import RobotModel
from workbench.simulation import Simulation, SimulationConfig
from workbench.simulation.play import play_motion
from workbench.types import Progress, no_progress


def forces_of_take(path: str | Path, name: str, progress: Progress = no_progress, model: RobotModel | None = None,
                   ) -> tuple[RobotModel, InverseDynamicsResult]:
    """Inverse dynamics of the recorded take `name` of a session, with the robot as it was in that take. model: another one than
    the session's."""
    session = load_session(path)
    session = session if model is None else session.with_model(model)
    chosen = [t for t in session.takes if t.name == name]
    if not chosen:
        raise InputError(path, f"takes: no take '{name}'; takes: {', '.join(t.name for t in session.takes)}")
    return session.model_of(chosen[0]), _of_recording(session, chosen[0], progress)


def forces_of_file(path: str | Path, model: RobotModel, base: Base = "free", cycles: int | None = None,
                   commanded: str | Path | None = None, progress: Progress = no_progress) -> InverseDynamicsResult:
    """Inverse dynamics of a rollout, on its own base; of a motion played `cycles` times on the given base; or of a recording of a
    `commanded` motion, played `cycles` times. On a free base a motion does not determine how the body moves, so it is first
    simulated with ideal joints."""
    kind = file_kind(path)
    if kind == "recording":
        spec = TakeSpec(Path(path).stem, Path(path), None if commanded is None else Path(commanded), cycles, base)
        return _of_recording(Session(Path(path), model, (spec,)), spec, progress)
    if kind == "rollout":
        progress("inverse dynamics", None)
        return inverse_dynamics(model, load_rollout(path))
    motion = load_motion(path, model)
    if base == "fixed":
        progress("inverse dynamics", None)
        return InverseDynamics(model, "fixed").of_motion(motion, cycles)
    model.check_base(floating=True)
    simulation = Simulation(model, SimulationConfig(base="free", drive="ideal"))
    take = play_motion(simulation, motion, cycles, progress=lambda done: progress("simulating ideal joints", done))
    progress("inverse dynamics", None)
    return inverse_dynamics(model, take)


def _of_recording(session: Session, spec: TakeSpec, progress: Progress) -> InverseDynamicsResult:
    """Inverse dynamics of a recording registered against its simulation. A single take may leave the session's yaw slightly off;
    that turns forces with the body about the vertical and changes no torque."""
    (read,), _ = read_takes(replace(session, takes=(spec,)))
    run = Run(spec.name, read.model, read.commands, read.duration, spec.base)
    (rollouts,) = roll_out([run], SimulationConfig(engine="drake"), progress=progress, n_jobs=1, floors=False)
    (take,), _ = register_takes(session, [read], {spec.name: rollouts.nominal}, progress)
    progress("inverse dynamics", None)
    m = take.measurement
    return InverseDynamics(read.model, spec.base).of_take(take.recorded, rest=m.rest_pose, rest_rotation=m.rest_rotation)
