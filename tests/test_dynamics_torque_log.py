"""A log of angles and torques: the gap to the model, and a hidden load that explains it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.command import main
from tests.inputs.corpus import ROBOT
from workbench.dynamics.machine import Machine
from workbench.dynamics.torque_gap import torque_gap
from workbench.dynamics.torque_log import TorqueLog, is_torque_log, read_torque_log
from workbench.dynamics.trajectory import smoothed
from workbench.files import InputError
from workbench.robot import EffectSpec, RobotModel


@pytest.fixture
def leg(tmp_path: Path) -> RobotModel:
    (tmp_path / "leg.urdf").write_text(ROBOT)
    return RobotModel(str(tmp_path / "leg.urdf"))


def _log(model: RobotModel, mass: float, friction: float) -> TorqueLog:
    """Torques of the robot with a load at the shank, and dry friction in the hip."""
    time = np.arange(1200) / 200
    q = np.column_stack([0.6 * np.sin(1.7 * time), 0.4 + 0.7 * np.sin(2.9 * time)])
    level = np.tile([1.0, 0, 0, 0], (len(time), 1))
    path = smoothed(time, model.joints, q, np.zeros((len(time), 3)), level, 0.1)[0]
    loaded = model.with_effect(EffectSpec("payload", ("shank",), {"mass": mass, "position": (0.0, 0.0, -0.09)}))
    torque = Machine(loaded).demand(path)[1]
    torque[:, 0] += friction * np.sign(path.v[:, 0])
    noise = np.random.default_rng(1).normal(0, 0.005, torque.shape)
    return TorqueLog(time, model.joints, q, torque + noise)


def test_a_load_is_weighed_beside_friction(leg: RobotModel) -> None:
    found = torque_gap(_log(leg, 0.18, 0.05), leg)
    assert found.load is not None
    assert found.load.link == "shank"
    assert found.load.mass == pytest.approx(0.18, rel=0.1)
    assert found.load.position[2] == pytest.approx(-0.09, abs=0.01)
    assert found.load.explains > 0.9
    assert all(g.with_load < 0.02 < g.gap for g in found.joints)


def test_no_load_is_reported_where_there_is_none(leg: RobotModel) -> None:
    log = _log(leg, 1e-6, 0.0)
    assert torque_gap(replace(log, torque=log.torque), leg).load is None


def test_the_command_reads_such_a_log(leg: RobotModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = _log(leg, 0.18, 0.0)
    path = tmp_path / "id.csv"
    rows = np.column_stack([log.time, log.q, 0 * log.q, log.torque])
    text = ["# payload_g=180", "t,q0,q1,qd0,qd1,tau0,tau1", *(",".join(f"{v:.9g}" for v in row) for row in rows)]
    path.write_text("\n".join(text) + "\n")
    assert is_torque_log(path)
    assert main(["inverse-dynamics", str(path), "--model", leg.description, "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr()
    assert "a load of 1" in said.out
    assert "0 is hip, 1 is knee" in said.err
    assert (tmp_path / "out" / "torque_gap.json").is_file()
    path.write_text("\n".join(text).replace("q0", "q_hop").replace("tau0", "tau_hop"))
    with pytest.raises(InputError, match=r"no joint 'hop'"):
        read_torque_log(path, leg)
