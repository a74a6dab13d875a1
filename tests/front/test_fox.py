"""A robot with other names, joints and servos than the puppy's goes through every verb."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.collections import LineCollection
from scipy.spatial.transform import Rotation

from tests.command import refused, succeeds
from workbench import load_model, load_motion
from workbench.compare.footfalls import foot_phases
from workbench.device import read_tables
from workbench.experiment.limits import Reach
from workbench.experiment.stance import BodyMoves
from workbench.gait.evaluate import table_sha256
from workbench.gait.machine import GaitMachine
from workbench.gait.shape import GaitShape
from workbench.gait.table import gait_table
from workbench.motion import Motion
from workbench.motion.files import motion_text
from workbench.recording import BodyTrack, Measurement, Take, observe, write_motive
from workbench.recording.formats.read import read_recording
from workbench.robot import RobotModel, data_file
from workbench.simulation import Simulation, SimulationConfig
from workbench.view.figures import film_strip

TROT = data_file("fox/trot.csv")
FEET = {"LF_KFE", "LH_KFE", "RF_KFE", "RH_KFE"}
STARTS_AT, CYCLES, CYCLE = 0.4137, 3, 0.64


@pytest.fixture(scope="module")
def fox() -> RobotModel:
    return load_model("fox")


@pytest.fixture(scope="module")
def trot(fox: RobotModel) -> Take:
    return Simulation(fox, SimulationConfig()).run(load_motion(TROT, fox).commands(cycles=CYCLES), 2.1, 0.4)


def write_session(folder: Path, fox: RobotModel, take: Take, cycles: int) -> Path:
    """The take before cameras, with noise, as a session."""
    rng = np.random.default_rng(3)
    measurement = Measurement(starts_at=STARTS_AT, yaw=0.2, origin=np.array([0.1, -0.2, 0.0]),
                              pivots={a: rng.normal(0, 0.01, 3) for a in fox.rigid_bodies})
    bodies = {}
    for asset, track in observe(take, measurement, fox, np.arange(0, STARTS_AT + take.time[-1] - 0.1, 1 / 120))[1].items():
        turn = Rotation.from_rotvec(rng.normal(0, np.deg2rad(0.1), (len(track.p), 3)))
        bodies[asset] = BodyTrack(track.p + rng.normal(0, 1e-4, track.p.shape),
                                  (turn * Rotation.from_quat(track.quat, scalar_first=True)).as_quat(scalar_first=True))
    write_motive(folder / "trot.csv", bodies, 120.0)
    content = {"format": 1, "robot": {"model": "package://fox/fox.sdf", "servos": str(data_file("fox/servo.yaml")),
                                      "rigid_bodies": dict(fox.rigid_bodies)},
               "ground": {"friction": 0.6},
               "takes": [{"name": "trot", "motion": str(TROT), "cycles": cycles, "recording": "trot.csv", "base": take.base}]}
    (folder / "session.yaml").write_text(yaml.safe_dump(content))
    return folder / "session.yaml"


@pytest.fixture(scope="module")
def session(fox: RobotModel, trot: Take, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_session(tmp_path_factory.mktemp("fox"), fox, trot, CYCLES)


def test_it_trots_forward_on_the_feet_that_were_meant(fox: RobotModel, trot: Take) -> None:
    assert trot.p_WB is not None
    went = np.interp([CYCLE, CYCLES * CYCLE], trot.time, trot.p_WB[:, 0])  # in the first cycle it crouches
    assert went[1] - went[0] > 0.01
    phases = foot_phases(trot, fox)
    assert set(phases) == FEET
    assert all(0.2 < p.duty < 0.98 for p in phases.values())


def test_the_next_experiment_may_move_its_body(fox: RobotModel) -> None:
    pose = BodyMoves(fox, Reach(fox))._pose((0.0, 0.0, -0.15, 0.0, 0.0, 0.0))
    assert pose is not None
    assert set(pose) == set(fox.joints)
    k = fox.kinematics
    for link in fox.foot_links.values():
        at = [k.forward(np.array([[q.get(j, 0.0) for j in fox.joints]]))[link][0][0, 2] for q in ({}, pose)]
        assert at[1] > at[0] + 0.005  # nearer to the body, which goes down


def test_a_session_is_compared_with_footfalls(session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = succeeds(capsys, "compare", str(session), "--out", str(tmp_path), "--jobs", "1")
    (take,) = json.loads((tmp_path / "comparison.json").read_text())["takes"]
    assert set(take["feet"]) == FEET
    assert all(c["error"] < 1.0 for c in take["joints"].values()), said  # deg: the simulation that was recorded, and noise
    assert (tmp_path / "report.html").stat().st_size > 100_000


def test_a_take_is_foretold(fox: RobotModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """From the frames before its first command alone; on a stand, where nothing parts by chaos."""
    commands = load_motion(TROT, fox).commands(cycles=1)
    take = Simulation(fox, SimulationConfig(base="fixed")).run(commands, 1.0, STARTS_AT + 0.02)
    path = write_session(tmp_path, fox, take, 1)
    recorded = read_recording(tmp_path / "trot.csv").rigid_bodies
    head = (tmp_path / "trot.csv").read_text().splitlines(keepends=True)[:7 + 47]
    (tmp_path / "start.csv").write_text("".join(head))
    frames = len(recorded["body"].p)
    path.write_text(yaml.safe_dump(yaml.safe_load(path.read_text()) | {"predict": [
        {"name": "again", "motion": str(TROT), "cycles": 1, "start": "start.csv", "starts_at": STARTS_AT, "frames": frames,
         "base": "fixed"}]}))
    succeeds(capsys, "predict", str(path), "--jobs", "1", "--out", str(tmp_path / "out"))
    foretold = read_recording(tmp_path / "out" / "again.csv").rigid_bodies
    assert set(foretold) == set(fox.rigid_bodies)
    for asset, body in foretold.items():
        turned = [Rotation.from_quat(b.quat, scalar_first=True) for b in (body, recorded[asset])]
        assert np.rad2deg((turned[0].inv() * turned[1]).magnitude().max()) < 1.0, asset  # noise: 0.1 deg on each axis
    shank = Rotation.from_quat(foretold["LF shank"].quat, scalar_first=True)
    assert np.rad2deg((shank[0].inv() * shank).magnitude().max()) > 30


@pytest.mark.parametrize("arguments", [
    ("inspect", "package://fox/fox.sdf"), ("inspect", "fox"), ("inspect", str(data_file("fox/model.yaml"))),
    ("inspect", str(TROT)),
    ("play", str(TROT), "--model", "fox", "--port", "virtual", "--base", "fixed", "--cycles", "1", "--out"),
    ("inverse-dynamics", str(TROT), "--model", "fox", "--cycles", "1", "--out"),
    ("servos", "--model", "fox", "--port", "virtual", "--out")], ids=lambda a: "_".join(a[:1]))
def test_other_verbs_take_it(arguments: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = [str(tmp_path / "out")] if arguments[-1] == "--out" else []
    assert succeeds(capsys, *arguments, *out)


def test_its_tables_are_in_its_own_servos_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = succeeds(capsys, "export", str(TROT), "--model", "fox", "--cycles", "1", "--out", str(tmp_path / "out"))
    assert "no motion.table: joint LF_HAA has a servo of the family XL-430" in said
    assert not (tmp_path / "out" / "motion.table").exists()
    table = read_tables(tmp_path / "out")
    asked = load_motion(TROT).angles[1:]
    assert np.abs(table.angles() - asked).max() <= np.radians(360 / 4096) / 2 + 1e-9
    assert "servos    XL-430" in succeeds(capsys, "inspect", str(tmp_path / "out"))


def test_a_gaits_table_is_in_its_counts_and_comes_back_from_its_file(fox: RobotModel, tmp_path: Path) -> None:
    machine = GaitMachine(fox)
    table = gait_table(machine, GaitShape("trot", (1, 1), 8, 2.0, stride=0.03, duty=0.6, lift=0.015, crouch=0.03))
    assert {u.family for u in table.cycle.units} == {"XL-430"}
    assert np.abs(table.cycle.angles() - table.asked).max() <= np.radians(360 / 4096) / 2 + 1e-12
    assert (table.cycle.speeds <= machine.fastest).all()
    assert table.cycle.rates().max() < 6.4  # rad/s: the servo at no load
    path = tmp_path / "gait.csv"
    path.write_text(motion_text(Motion.from_table(table.cycle)))
    assert table_sha256(load_motion(path, fox).as_table()) == table_sha256(table.cycle)


def test_a_film_strip_shows_legs_to_their_ends_and_the_left_ones_thin(fox: RobotModel) -> None:
    stretched = np.radians([[-80.0 if j.endswith("HFE") else 0.0 for j in fox.joints]] * 9)
    take = Take("pose", "simulation", np.linspace(-0.2, 0.6, 9), fox.joints, stretched, starts_at=0.0, base="fixed")
    axes = film_strip(fox, take, instants=2).axes[0]
    (sticks,) = (c for c in axes.collections if isinstance(c, LineCollection))
    x = np.concatenate(sticks.get_segments())[:, 0]
    assert np.ptp(x) > 25  # cm: legs ahead of the trunk
    assert axes.get_xlim()[0] < x.min()
    assert x.max() < axes.get_xlim()[1]
    assert len(set(sticks.get_linewidths())) == 2


def test_the_cm530s_program_refuses_its_servos(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = refused(capsys, "flash", str(TROT), "--model", "fox", "--dry-run", "--out", str(tmp_path))
    assert "joint LF_HAA has a servo of the family XL-430; the CM-530's program plays the AX-12A's alone" in said


@pytest.mark.slow
def test_dry_friction_in_it_is_found(fox: RobotModel, tmp_path: Path) -> None:
    """Minutes: the whole of `diagnose` on a robot with none of the puppy's names."""
    import workbench

    worn = fox.with_effect(workbench.EffectSpec("coulomb_friction", ("RF_HFE",), {"torque": 0.2}))
    commands = load_motion(TROT, fox).commands(cycles=5)
    take = Simulation(worn, SimulationConfig(base="fixed")).run(commands, commands.end + 0.6, 0.3)
    result = workbench.diagnose(write_session(tmp_path, fox, take, 5))
    (found,) = result.diagnosis.findings
    assert (found.effect, found.where) == ("coulomb_friction", ("RF_HFE",))
    assert found.parameters["torque"].value == pytest.approx(0.2, abs=0.03)
