"""Practice sessions: registration succeeds on every take, starts are within a millisecond, healthy joints keep to their noise."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.shared_data import practice
from workbench.motion import load_motion
from workbench.recording import observe, read_recording, register, session_yaw, take_from_recording
from workbench.robot import RobotModel, load_servo_constants
from workbench.simulation import Simulation, SimulationConfig

SESSIONS = ("p0_nothing_hidden", "p1_backlash", "p2_slippery_foot", "p3_payload", "p4_late_firmware", "p5_sagging_supply",
            "p6_stiff_gearbox", "p7_two_at_once")


def load(name: str) -> tuple[Path, dict, RobotModel]:
    folder = practice(name)
    session = yaml.safe_load((folder / "session.yaml").read_text())
    model = RobotModel(description=str(folder / "robot.sdf"), rigid_bodies=session["robot"]["rigid_bodies"])
    return folder, session, replace(model, servos=dict.fromkeys(model.joints, load_servo_constants(folder / "servo.yaml")))


@pytest.mark.parametrize("name", SESSIONS)
def test_registration_succeeds_without_a_simulation(name):
    folder, session, model = load(name)
    recordings = [read_recording(folder / t["recording"]) for t in session["takes"]]
    commands = [load_motion(folder / t["motion"], model).commands(t["cycles"]) for t in session["takes"]]
    found = session_yaw(recordings, model, commands)
    assert found.sigma < np.deg2rad(0.05)
    assert np.ptp(list(found.by_joint.values())) < np.deg2rad(1)
    for spec, recording, c in zip(session["takes"], recordings, commands):
        m = register(recording, model, c, yaw=found.yaw, base=spec["base"])
        assert 0.2 < m.starts_at < 0.65
        assert np.rad2deg(np.median(list(m.noise.values()))) == pytest.approx(0.17, abs=0.02)
        assert m.position_noise == pytest.approx(1e-4, rel=0.1)
        take = take_from_recording(recording, m, model, base=spec["base"])
        assert set(take.joints) == set(model.joints) - {"neck", "head"}
        assert np.isnan(take.q).mean() < 0.05
        assert np.linalg.norm(m.origin[:2]) < 0.2


@pytest.mark.parametrize("name", ["p0_nothing_hidden", "p1_backlash"])
def test_start_and_angles_on_the_stand(name):
    folder, session, model = load(name)
    spec = next(t for t in session["predict"] if t["base"] == "fixed")
    recording = read_recording(folder / "answer" / f"{spec['name']}.csv")
    commands = load_motion(folder / spec["motion"], model).commands(spec["cycles"])
    simulated = Simulation(model, SimulationConfig(base="fixed")).run(commands, duration=3.0, lead=0.3)
    m = register(recording, model, commands, simulated, base="fixed")
    assert m.starts_at == pytest.approx(spec["starts_at"], abs=1.2e-3)
    take = take_from_recording(recording, m, model, base="fixed")
    seen, bodies = observe(simulated, m, model, take.time)
    use = (take.since_start > 0) & (take.since_start < 2.9) & ~take.mended
    error = {j: np.sqrt(np.nanmean(np.square(take.q[use, i] - seen.q[use, seen.column(j)]))) / m.noise[j]
             for i, j in enumerate(take.joints)}
    if name == "p1_backlash":
        assert error.pop("flm") > 5
    assert max(error.values()) < 1.3
    for asset, body in bodies.items():
        rest = take.time < m.starts_at - 0.02
        gap = body.p[rest].mean(axis=0) - np.nanmean(recording.rigid_bodies[asset].p[rest], axis=0)
        assert np.linalg.norm(gap) < 1.5e-3, asset
