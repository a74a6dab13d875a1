"""A log of angles and torques: the gap to the model, and a hidden load that explains it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.command import main
from tests.inputs.corpus import ROBOT
from workbench.dynamics.machine import Machine
from workbench.dynamics.torque_gap import torque_gap
from workbench.dynamics.torque_log import TorqueLog, is_torque_log, read_torque_log
from workbench.dynamics.trajectory import smooth
from workbench.files import InputError
from workbench.robot import EffectSpec, RobotModel, puppy_model


@pytest.fixture
def leg(tmp_path: Path) -> RobotModel:
    (tmp_path / "leg.urdf").write_text(ROBOT)
    return RobotModel(str(tmp_path / "leg.urdf"))


def _log(model: RobotModel, mass: float, friction: float) -> TorqueLog:
    """Torques of the robot with a load at the shank, and dry friction in the hip."""
    time = np.arange(1200) / 200
    q = np.column_stack([0.6 * np.sin(1.7 * time), 0.4 + 0.7 * np.sin(2.9 * time)])
    level = np.tile([1.0, 0, 0, 0], (len(time), 1))
    path = smooth(time, model.joints, q, np.zeros((len(time), 3)), level, 0.1)[0]
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


REAL = """\
# plant=hardware controller=adaptive_computed_torque payload_g=181
t,q0,q1,q2,q3,q4,q5,qd0,qd1,qd2,qd3,qd4,qd5,tau0,tau1,tau2,tau3,tau4,tau5,ee_x,ee_y,ee_z,estimated_payload_mass
0.005,0.00767,0.09971,0.01687,0.03988,0.03068,-0.07977,0,0,0,0,0,0,-0.0280,-2.3193,-1.8797,-0.9094,-0.0391,0.0933,0.40203,-0.0034,0.20233,0.39084
0.020,0.00767,0.09971,0.01687,0.03988,0.03068,-0.07977,0,0,0,0,0,0,0.0233,-2.2863,-1.8908,-0.8925,-0.0300,0.0933,0.40203,-0.0034,0.20233,0.39084
0.035,0.00767,0.09971,0.01687,0.03988,0.03068,-0.07977,0,0,0,0,0,0,0.0734,-2.2540,-1.9017,-0.8760,-0.0211,0.0933,0.40203,-0.0034,0.20233,0.39084
0.050,0.00767,0.09971,0.01687,0.03988,0.03068,-0.07977,0,0,0,0,0,0,0.1225,-2.2224,-1.9124,-0.8598,-0.0124,0.0933,0.40203,-0.0034,0.20233,0.39084
0.070,0.00767,0.09971,0.01841,0.03682,0.03068,-0.07977,0,0,0,0,0,0,0.1868,-2.1526,-1.9017,-0.7870,-0.0009,0.0932,0.40203,-0.0034,0.20237,0.39084
0.085,0.00767,0.09971,0.01227,0.03375,0.03068,-0.07977,0,0,-0.6136,-0.3068,0,0,0.2346,-2.0860,-1.8412,-0.7884,0.0077,0.0931,0.40220,-0.0034,0.20466,0.39084
0.100,0.00767,0.10124,0.00460,0.03221,0.03068,-0.07977,0,0,-0.6136,0,0,0,0.2823,-1.9663,-1.7168,-0.6886,0.0163,0.0929,0.40251,-0.0034,0.20665,0.39084
0.120,0.00767,0.10124,-0.00614,0.03068,0.03068,-0.07977,0,0,-0.3068,0,0,0,0.3460,-1.9268,-1.7216,-0.7036,0.0276,0.0929,0.40271,-0.0034,0.21005,0.39084
0.140,0.00767,0.10124,-0.01381,0.03068,0.03068,-0.08130,0,0,-0.3068,0,0,0,0.4096,-1.9261,-1.8012,-0.7027,0.0387,0.0947,0.40282,-0.0034,0.21231,0.39084
0.160,0.00767,0.09817,-0.01994,0.03068,0.03068,-0.08130,0,-0.3068,-0.3068,0,0,0,0.4733,-1.8662,-1.7944,-0.6749,0.0501,0.0947,0.40260,-0.0034,0.21514,0.39084
0.180,0.00920,0.09664,-0.02915,0.03068,0.03068,-0.08130,0,0,-0.6136,0,0,0,0.4074,-1.6870,-1.7178,-0.6136,0.0641,0.0945,0.40252,-0.0040,0.21836,0.39084
0.200,0.01381,0.09357,-0.04142,0.02915,0.03068,-0.08130,0,-0.3068,-0.6136,0,0,0,0.4580,-1.6412,-1.6395,-0.5332,0.0760,0.0944,0.40225,-0.0056,0.22325,0.39084
"""
"""Twelve rows of a real SO-101 with 181 g in its gripper (so101-rt-control, docs/data/hw_id_0181.csv, rounded; MIT licence,
Copyright (c) 2026 Atul Agarwal). Torques there are those that the controller asked for."""


def test_a_real_log_is_read_as_its_author_wrote_it(tmp_path: Path) -> None:
    path = tmp_path / "hw_id_0181.csv"
    path.write_text(REAL)
    assert is_torque_log(path)
    model = puppy_model()
    log = read_torque_log(path, model)
    assert log.q.shape == log.torque.shape == (12, 6)
    assert log.joints == tuple(j for link in model.kinematics.links
                               if (j := model.kinematics.joint_of(link)) in model.joints)[:6]
    assert log.torque[0, 1] == -2.3193
    assert "q" not in log.joints
    assert "0 is " in log.assumed


def _write(path: Path, log: TorqueLog) -> Path:
    rows = np.column_stack([log.time, log.q, 0 * log.q, log.torque])
    text = ["# payload_g=180", "t,q0,q1,qd0,qd1,tau0,tau1", *(",".join(f"{v:.9g}" for v in row) for row in rows)]
    path.write_text("\n".join(text) + "\n")
    return path


def test_compare_weighs_one_log_against_the_model_and_two_against_each_other(leg: RobotModel, tmp_path: Path,
                                                                              capsys: pytest.CaptureFixture[str]) -> None:
    empty, loaded = _write(tmp_path / "empty.csv", _log(leg, 0.05, 0.02)), _write(tmp_path / "loaded.csv", _log(leg, 0.18, 0.02))
    out = tmp_path / "out"
    assert main(["compare", str(loaded), "--model", leg.description, "--out", str(out)]) == 0
    assert "of shank explains" in capsys.readouterr().out
    assert json.loads((out / "torque_gap.json").read_text())["load"]["mass"] == pytest.approx(0.18, rel=0.1)
    assert "a load of 1" in (out / "report.html").read_text()
    assert main(["compare", str(empty), str(loaded), "--model", leg.description, "--out", str(out)]) == 0
    told = re.search(r"loaded carries \+(\d+) g against empty, weighed on shank", capsys.readouterr().out)
    assert told is not None
    assert int(told[1]) == pytest.approx(130, abs=10)
    (tmp_path / "motion.csv").write_text("time,hip,knee\n0,0,0\n1,10,5\n2,0,0\n")
    assert main(["compare", str(loaded), str(tmp_path / "motion.csv"), "--model", leg.description, "--out", str(out)]) == 2
    assert "expected a log of angles and torques" in capsys.readouterr().err


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
