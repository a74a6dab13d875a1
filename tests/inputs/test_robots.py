"""Robots as people publish them, through the verbs: read, simulated, compared, and diagnosed from their servos' own logs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.command import succeeds
from tests.inputs.robots import ROBOTS, Made, write_robot
from workbench.motion import load_motion
from workbench.recording import write_joint_log
from workbench.robot import EffectSpec, RobotModel, load_servo_constants
from workbench.robot.servo_profile_file import with_family_law
from workbench.simulation import Simulation, SimulationConfig

COUNT = 2 * np.pi / 4096
HIDDEN = 0.3
"""Dry friction [N m], beyond the factor of 4.5 by which a law's own 0.05 may be recalibrated: up to that it is no finding."""


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def _model(urdf: Path) -> RobotModel:
    """The robot as its session reads it, where the profile of its servos tells what servo.yaml omits of their law."""
    model, path = RobotModel(str(urdf)), urdf.parents[1] / "servo.yaml"
    servo = with_family_law(load_servo_constants(path), yaml.safe_load(path.read_text()))
    return RobotModel(str(urdf), servos=dict.fromkeys(model.joints, servo))


def _motion(folder: Path, made: Made, model: RobotModel) -> Path:
    """The last two joints of the first leg swing, slowly, which tells kinds of friction apart, and as quickly as they can, as
    what friction stops at once coasts through a dead band; all others rest."""
    leg = next(iter(made.legs))
    moving = [f"{leg}_{name}" for name, _ in made.joints[-2:]]
    rows = ["time," + ",".join(model.joints)]
    for at, a, b in [(0, 0, 0), (0.2, 20, -25), (0.4, -10, 20), (0.56, 25, -15), (0.76, -15, 25), (1.8, -15, 5), (2.0, 10, -25),
                     (3.0, 0, -10), (3.2, 20, 25), (3.4, 0, 0)]:
        rows.append(f"{at}," + ",".join(str({moving[0]: a, moving[1]: b}.get(j, 0)) for j in model.joints))
    (folder / "swing.csv").write_text("\n".join(rows) + "\n")
    return folder / "swing.csv"


def _record(folder: Path, made: Made, model: RobotModel, motion: Path) -> str:
    """A joint log of the robot, held, with dry friction that its model lacks in the joint whose name is returned."""
    joint = f"{next(iter(made.legs))}_{made.joints[-1][0]}"
    worn = model.with_effect(EffectSpec("coulomb_friction", (joint,), {"torque": HIDDEN}))
    commands = load_motion(motion, model).commands(2)
    take = Simulation(worn, SimulationConfig(base="fixed")).run(commands)
    at = np.arange(take.starts_at, take.time[-1], 1 / 50)
    channels = {}
    latest = np.maximum(np.searchsorted(commands.times, at - take.starts_at + 1e-6, side="right") - 1, 0)
    for name in take.joints:
        channels[f"goal.{name}"] = commands.goals[latest, commands.column(name)]
        channels[f"speed.{name}"] = commands.speeds[latest, commands.column(name)]
        channels[f"position.{name}"] = np.round(np.interp(at, take.time, take.q[:, take.column(name)]) / COUNT) * COUNT
    write_joint_log(folder / "log.csv", at - at[0], channels)
    content = {"format": 1, "robot": {"model": f"urdf/{made.name}.urdf", "servos": "servo.yaml"}, "ground": {"friction": 0.6},
               "takes": [{"name": "swing", "recording": "log.csv", "base": "fixed"}]}
    (folder / "session.yaml").write_text(yaml.safe_dump(content))
    return joint


@pytest.mark.parametrize("made", ROBOTS, ids=lambda made: made.name)
def test_it_is_read_whole(made: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = succeeds(capsys, "inspect", str(write_robot(tmp_path, made)))
    assert f" {len(made.legs) * len(made.joints)}: " in said
    assert "made OBJ for Drake" in said
    assert "no problems" in said


@pytest.mark.slow
@pytest.mark.parametrize("made", ROBOTS, ids=lambda made: made.name)
def test_it_goes_through_the_verbs(made: Made, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = _model(write_robot(tmp_path, made))
    motion = _motion(tmp_path, made, model)
    joint = _record(tmp_path, made, model, motion)
    assert "no problems" in succeeds(capsys, "inspect", str(tmp_path))
    session = str(tmp_path / "session.yaml")
    said = succeeds(capsys, "simulate", str(motion), "--model", session, "--out", str(tmp_path / "simulate"))
    assert "on a stand; largest angle" in said  # as in its take
    succeeds(capsys, "compare", str(tmp_path), "--out", str(tmp_path / "compare"), "--jobs", "1")
    (take,) = json.loads((tmp_path / "compare" / "comparison.json").read_text())["takes"]
    assert take["joints"][joint]["error"] > 1.3 * np.hypot(take["joints"][joint]["noise"], take["joints"][joint]["floor"])
    succeeds(capsys, "diagnose", str(tmp_path), "--out", str(tmp_path / "diagnose"), "--jobs", "1")
    findings = json.loads((tmp_path / "diagnose" / "findings.json").read_text())
    (found,) = findings["findings"]
    assert (found["effect"], found["where"]) == ("coulomb_friction", [joint])
    nominal = model.servo(joint).coulomb_friction  # known to a half: the log tells what there is in all
    (own,) = (r["value"] for r in findings["recalibrated"] if (r["number"], r["where"]) == ("coulomb_friction", [joint]))
    assert own + found["parameters"]["torque"]["value"] == pytest.approx(nominal + HIDDEN, rel=0.2)
    assert findings["verdict"] == "explained"
