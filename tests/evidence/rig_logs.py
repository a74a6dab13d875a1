"""Servo logs of a one-joint rig, written by the station with physics of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import yaml

from tests.servo_rig import SDF
from workbench.compare.session import Session, load_session
from workbench.recording import write_joint_log
from workbench.recording.formats.log_commands import commands_of_rows
from workbench.robot import EffectSpec
from workbench.simulation import Job, SimulationConfig, simulate_batch

SERVO = {"stall_torque": 0.7, "no_load_speed": 19.0, "rated_voltage": 7.4, "supply_voltage": 7.4, "coulomb_friction": 0.013,
         "viscous_friction": 0.004, "reflected_inertia": 0.0018, "proportional_gain": 1.15}
GAINS = (0.3, 0.6, 1.2)
NOISE = 1.5e-3


def record(folder: Path, effects: Sequence[EffectSpec] = (), seed: int = 0, beside: float = 0.0, faster: float = 1.0,
           told: Mapping[str, float] | None = None, **servo: float) -> Session:
    """A session of three logs of 3 s, one a gain, of a rig with other physics than its servo.yaml says. beside: RMS [rad] of what
    lies on top, smooth and no physics. faster: by which the goals move faster than usual. told: constants of servo.yaml that
    differ from SERVO."""
    (folder / "rig.sdf").write_text(SDF.format(length=0.1, mass=0.5))
    (folder / "servo.yaml").write_text(yaml.safe_dump(SERVO | dict(told or {})))
    takes = [{"name": f"gain {g:g}", "recording": f"{g:g}.csv", "base": "fixed", "servos": {"proportional_gain": g}}
             for g in GAINS]
    (folder / "session.yaml").write_text(yaml.safe_dump(
        {"format": 1, "robot": {"model": "rig.sdf", "base": "base", "servos": "servo.yaml"}, "takes": takes}))
    time = np.arange(0.0, 3.0, 0.01)
    goal = 1.1 * np.sin(2.2 * faster * time) + 0.5 * np.sin(7.0 * faster * time + 1.0)
    for g in GAINS:  # so that the session can be read
        write_joint_log(folder / f"{g:g}.csv", time, {"goal.j": goal, "position.j": 0 * goal})
    model = load_session(folder).model
    jobs = []
    for g in GAINS:
        robot = model.with_servos({"proportional_gain": g} | servo)
        for spec in effects:
            robot = robot.with_effect(spec)
        commands = commands_of_rows(time, ("j",), goal[:, None], np.ones((len(time), 1), dtype=bool))
        jobs.append(Job(robot, SimulationConfig(base="fixed", contact_period=0, settle=0.1), commands, 3.0, 0.0, times=time))
    for k, (g, take) in enumerate(zip(GAINS, simulate_batch(jobs, n_jobs=1))):
        rng = np.random.default_rng([seed, k])
        noise = rng.normal(size=len(time)) * NOISE + beside * smooth(rng, len(time))
        q = np.interp(time, take.time, np.nan_to_num(take.as_logged().q[:, 0])) + noise
        write_joint_log(folder / f"{g:g}.csv", time, {"goal.j": goal, "position.j": q})
    return load_session(folder)


def smooth(rng: np.random.Generator, n: int, frame: float = 0.01) -> np.ndarray:
    """A signal (n,), a value every `frame` [s], of RMS 1 over many draws that forgets itself within a fifth of a second."""
    width = 0.1 / frame
    kernel = np.exp(-0.5 * np.square(np.arange(-4 * width, 4 * width + 1) / width))
    return np.convolve(rng.normal(size=n + len(kernel) - 1), kernel / np.linalg.norm(kernel), mode="valid")
