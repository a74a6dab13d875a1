"""What `run` writes, and what it says where it cannot run."""

import json
import math
from dataclasses import replace

import pytest
import yaml

from tests.command import refused, succeeds
from tests.device.motive import MotiveOnSockets
from tests.device.servos import arm, robot
from tests.device.test_play import MOTION, START
from tests.device.whole_loop import of_an_arm
from workbench.api.robot_run import run_on_robot
from workbench.compare.session import load_session
from workbench.compare.session_file import write_session
from workbench.device.capture import BackgroundRecording, Recorder, UdpLink
from workbench.device.play import PlayOptions
from workbench.files import InputError
from workbench.recording.formats.read import read_recording
from workbench.robot import puppy_model
from workbench.simulation.virtual_robot import VirtualRobot


def test_a_session_reads_back_as_it_was_written(tmp_path):
    model = puppy_model()
    servos = {j: replace(s, supply_voltage=10.5, sd=(("supply_voltage", 0.5),)) for j, s in model.servos.items()}
    model = replace(model, servos=servos, feet=("flb_link", "frb_link"))
    (tmp_path / "log.csv").write_text("time,goal.flm,position.flm\n0,0,0\n0.1,1,1\n")
    write_session(tmp_path, model, [{"name": "log", "recording": "log.csv"}])
    read = load_session(tmp_path).model
    assert (read.servos, read.feet) == (model.servos, model.feet)
    assert (tmp_path / "session.yaml").read_text().count("stall_torque") == 1  # alike: said once
    assert (read.bus_ids, read.rigid_bodies, read.base) == (model.bus_ids, model.rigid_bodies, model.base)
    assert read.ground.friction == model.ground.friction
    assert math.isinf(read.ground.stiffness)


def test_a_session_elsewhere_finds_the_packages_of_meshes(tmp_path, monkeypatch):
    """--package names a folder from where the command was called."""
    (tmp_path / "meshes").mkdir()
    monkeypatch.chdir(tmp_path)
    model = replace(arm(tmp_path), packages={"kit": "meshes"})
    (tmp_path / "run").mkdir()
    write_session(tmp_path / "run", model, [])
    monkeypatch.chdir("/")
    content = yaml.safe_load((tmp_path / "run/session.yaml").read_text())
    assert content["robot"]["packages"] == {"kit": str(tmp_path / "meshes")}


def test_the_cameras_and_the_servos_agree(tmp_path):
    """A take that begins when both clocks say, and a log of the same motion; the joints go where the motion says."""
    session = load_session(of_an_arm(tmp_path, ()))
    names = [take.name for take in session.takes]
    assert names == ["wave", "wave_joints"]
    capture = json.loads((tmp_path / "wave.capture.json").read_text())
    assert session.takes[0].starts_at == pytest.approx(0.9, abs=0.01)
    log = read_recording(tmp_path / "wave_joints.csv")
    camera = read_recording(tmp_path / "wave.csv")
    assert camera.time[-1] == pytest.approx(0.9 + 3.6, abs=0.02), "no frame after the motion's end"
    assert capture["frames"]["lost"] == 0
    assert session.registers is not None
    assert log.commands is not None
    assert not (tmp_path / "wave.natnet").exists()
    assert not (tmp_path / "wave_joints.play").exists()


def test_a_hidden_slope_stands_in_the_registers(tmp_path):
    model = arm(tmp_path)
    real = replace(model, servos={j: replace(model.servo(j), compliance_slope=64 if j == "two" else 32) for j in model.joints})
    virtual = VirtualRobot(real, "fixed")
    assert virtual.servos["two"]["cw_compliance_slope"] == 64
    assert virtual.servos["one"]["cw_compliance_slope"] == 32


def test_cameras_that_do_not_come_keep_the_robot_still(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    with MotiveOnSockets(mute=True) as server:
        recorder = Recorder(UdpLink("127.0.0.1", command_port=server.port))
        with pytest.raises(InputError, match="no frame came"):
            run_on_robot(r.bus(), r.model, MOTION, 1, tmp_path, lambda: "", base="fixed", recorder=recorder)
    assert not any(servo.written for servo in r.servos.values())


def test_a_recording_beside_a_motion(tmp_path):
    """Real sockets, a thread, and a motion in virtual time: the take is there when the motion is over."""
    r = robot(angles=START, model=arm(tmp_path))
    with MotiveOnSockets(version=(4, 1)) as server:
        recorder = Recorder(UdpLink("127.0.0.1", command_port=server.port))
        background = BackgroundRecording(recorder, tmp_path / "take.csv")
        background.start()
        assert recorder.counts_received
        capture = background.stop()
    assert capture.counts.received > 1
    assert (tmp_path / "take.csv").exists()
    assert run_on_robot(r.bus(), r.model, MOTION, 1, tmp_path, lambda: "", base="fixed",
                        options=PlayOptions(rest=0.3)).capture is None


def test_run_refuses_in_one_line(capsys, tmp_path):
    out = ("--port", "/dev/ttyNONE", "--out", str(tmp_path / "o"))
    assert "port /dev/ttyNONE: there is no such port" in refused(capsys, "run", "data/robotis_walk.csv", *out)
    fast = tmp_path / "fast.csv"
    fast.write_text("time,flm\n0,0\n0.12,60\n0.24,0\n")
    assert "not played" in refused(capsys, "run", str(fast), *out)


@pytest.mark.slow
def test_run_on_the_emulated_puppy(capsys, tmp_path):
    """Nothing hidden: cameras and joint log differ from the simulation by no more than they must."""
    said = succeeds(capsys, "run", "data/robotis_walk.csv", "--cycles", "3", "--out", str(tmp_path / "run"))
    assert "wrote" in said
    comparison = json.loads((tmp_path / "run" / "comparison" / "comparison.json").read_text())
    for take in comparison["takes"]:
        for joint, said in take["joints"].items():
            assert said["error"] < 0.5, (take["name"], joint)
    assert load_session(tmp_path / "run").registers is not None
