"""Small sessions that tests write: an arm of three joints on a fixed base, and its motion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from benchmarks.arm import arm_sdf
from workbench.compare.session import load_session
from workbench.recording import BodyTrack, Measurement, observe, write_motive
from workbench.simulation import Simulation, SimulationConfig

SERVO = """\
model: AX-12A
stall_torque: 1.5
no_load_speed: 6.18
rated_voltage: 12.0
supply_voltage: 11.1
compliance_slope: 32
compliance_margin: 1
punch: 32
coulomb_friction: 0.06
viscous_friction: 1e-2
reflected_inertia: 6.5e-3
"""
MOTION = "time,one,three,two\n0,0,0,0\n0.3,25,-15,30\n0.6,-20,12,-25\n0.9,0,0,0\n"


def session_content() -> dict:
    """A session that load_session accepts, to be changed by a test."""
    return {
        "format": 1,
        "robot": {"model": "robot.sdf", "base": "trunk", "servos": "servo.yaml",
                  "rigid_bodies": {"Trunk": "trunk", "Upper": "upper", "Middle": "middle", "Lower": "lower"},
                  "bus_ids": {"one": 1, "two": 2, "three": 3}},
        "takes": [{"name": "wave", "motion": "motions/wave.csv", "cycles": 2, "recording": "takes/wave.csv", "base": "fixed"}],
    }


def write_session(folder: Path, content: dict | str | None = None, fixed: bool = True) -> Path:
    """Writes session.yaml and all files that it names; returns its path."""
    files = {"robot.sdf": arm_sdf(fixed), "servo.yaml": SERVO, "motions/wave.csv": MOTION, "takes/wave.csv": "time\n"}
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            path.write_text(text)
    content = session_content() if content is None else content
    (folder / "session.yaml").write_text(content if isinstance(content, str) else yaml.safe_dump(content, sort_keys=False))
    return folder / "session.yaml"


STARTS_AT = 0.4137


def record_arm(folder: Path, name: str = "wave", friction: float = 0.06, seed: int = 0, base: str = "fixed") -> Path:
    """Makes takes/NAME.csv: the arm's motion with another Coulomb friction in joint `three`, as cameras see it, with noise."""
    session = load_session(write_session(folder))
    model = session.model
    worn = model.servo("three").updated({"coulomb_friction": friction})
    commands = session.takes[0].commands(model)
    assert commands is not None
    take = Simulation(replace(model, servos={**model.servos, "three": worn}), SimulationConfig(base=base)).run(
        commands, commands.end + 0.6, 0.3)
    rng = np.random.default_rng(seed)
    measurement = Measurement(
        starts_at=STARTS_AT, yaw=0.3, origin=np.array([0.5, -0.2, 0.1]),
        pivots={a: rng.normal(0, 0.01, 3) + np.array([0, 0, 0.04]) for a in model.rigid_bodies})
    time = np.arange(0, STARTS_AT + commands.end + 0.5, 1 / 120)
    bodies = {}
    for asset, track in observe(take, measurement, model, time)[1].items():
        turn = Rotation.from_rotvec(rng.normal(0, np.deg2rad(0.12), (len(time), 3)))
        quat = (turn * Rotation.from_quat(track.quat, scalar_first=True)).as_quat(scalar_first=True)
        bodies[asset] = BodyTrack(track.p + rng.normal(0, 1e-4, track.p.shape), quat)
    return write_motive(folder / f"takes/{name}.csv", bodies, 120.0)
