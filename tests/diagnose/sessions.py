"""Short captured sessions of robots with a known effect, used by the table of diagnoses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from tests.gap_sessions import session_content, write_session
from workbench.compare.session import Session, load_session
from workbench.effects.apply import apply_to_measurement
from workbench.motion import save_motion
from workbench.motion.motion import Motion
from workbench.recording import BodyTrack, Measurement, observe, write_motive
from workbench.robot import EffectSpec, RobotModel
from workbench.simulation import Simulation, SimulationConfig

STARTS_AT, RATE = 0.4137, 120.0
ANGLE_NOISE, POSITION_NOISE = np.deg2rad(0.12), 1e-4
"""Of a tracked body [rad] and [m], standard deviation: a good capture room's."""


def arm_session(folder: Path, hidden: Sequence[EffectSpec], cycles: int = 3) -> Session:
    """An arm of three joints on a fixed base, filmed in one take."""
    content = session_content()
    content["takes"][0]["cycles"] = cycles
    session = load_session(write_session(folder, content))
    record(folder / "takes/wave.csv", session, 0, hidden, seed=1)
    return session


def puppy_session(folder: Path, hidden: Sequence[EffectSpec], motions: dict[str, Motion], cycles: dict[str, int]) -> Session:
    """The puppy that ships with the workbench, in takes by name, on the floor where the name is "walk", else on a stand."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "takes").mkdir(exist_ok=True)
    takes = []
    for name, motion in motions.items():
        save_motion(motion, folder / f"{name}.csv")
        (folder / f"takes/{name}.csv").write_text("time\n")
        takes.append({"name": name, "motion": f"{name}.csv", "cycles": cycles[name], "recording": f"takes/{name}.csv",
                      "base": "free" if name == "walk" else "fixed"})
    robot = {"model": "package://puppy/puppy.sdf"}
    (folder / "session.yaml").write_text(yaml.safe_dump({"format": 1, "robot": robot, "takes": takes}, sort_keys=False))
    session = load_session(folder / "session.yaml")
    for k in range(len(takes)):
        record(session.takes[k].recording, session, k, hidden, seed=k)
    return session


def record(path: Path, session: Session, take: int, hidden: Sequence[EffectSpec], seed: int) -> None:
    """Films one take of a robot with hidden effects."""
    spec = session.takes[take]
    model: RobotModel = replace(session.model, effects=tuple(hidden))
    commands = spec.commands(session.model)
    assert commands is not None
    seen_take = Simulation(model, SimulationConfig(base=spec.base)).run(commands, commands.end + 0.6, 0.3)
    rng = np.random.default_rng(seed)
    measurement = apply_to_measurement(Measurement(
        starts_at=STARTS_AT, yaw=0.3, origin=np.array([0.5, -0.2, 0.1]),
        pivots={a: rng.normal(0, 0.01, 3) + np.array([0, 0, 0.04]) for a in model.rigid_bodies}), model)
    time = np.arange(0, STARTS_AT + commands.end + 0.5, 1 / RATE)
    bodies = {}
    for asset, track in observe(seen_take, measurement, model, time)[1].items():
        turn = Rotation.from_rotvec(rng.normal(0, ANGLE_NOISE, (len(time), 3)))
        quat = (turn * Rotation.from_quat(track.quat, scalar_first=True)).as_quat(scalar_first=True)
        bodies[asset] = BodyTrack(track.p + rng.normal(0, POSITION_NOISE, track.p.shape), quat)
    write_motive(path, bodies, RATE)
