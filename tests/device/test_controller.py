"""A table to the CM-530's own program and its log back: the flashed image, virtual servos, a simulated robot."""

import numpy as np
import pytest

from tests.device.whole_loop import stand
from tests.firmware.image import IDS, Ear, Robot, image, needs_compiler
from workbench.api.robot_run import run_by_controller
from workbench.compare.session import load_session
from workbench.device.bus import BusError
from workbench.device.controller.play import Controller
from workbench.device.tables.table_file import JointBounds, TableFile
from workbench.device.virtual import SECOND
from workbench.device.virtual.cm530 import Board
from workbench.device.virtual.cm530.port import PcLinkPort
from workbench.motion import load_motion
from workbench.recording.formats.read import read_recording
from workbench.robot import data_file, puppy_model
from workbench.simulation.virtual_robot import VirtualRobot

pytestmark = needs_compiler


def test_the_flashed_image_plays_an_uploaded_motion(tmp_path):
    """Uploaded, played and released; the log's positions are the robot's at its own times, and the start is the first pose's."""
    model = puppy_model()
    robot = VirtualRobot(model, "fixed")
    board = Board(image(), robot.clock, robot.bus)
    ear = Ear(board)
    board.power_on()
    board.run(robot.clock.now + SECOND // 2)
    motion = stand(model, poses=4)
    done = run_by_controller(PcLinkPort(board), model, motion, 1, tmp_path, lambda: "", base="fixed", virtual=robot)
    assert done.played.stopped == ""
    assert not board.violations
    acted = np.array([t / SECOND + len(p) * 1e-5 for t, p in ear.poses])  # servos act on a packet's end
    first = acted[np.abs(acted - done.played.started).argmin()]
    assert abs(done.played.started - first) < 2.5e-3
    truth = robot.body.take(0.0)
    log = read_recording(tmp_path / "stand_joints.csv")
    count = 300 / 1023
    for joint in model.joints:
        there = np.interp(log.time - done.played.start_in_log + first - robot.body.let_go / SECOND, truth.time,
                          truth.q[:, truth.column(joint)])
        error = np.degrees(log.channels[f"position.{joint}"] - there)
        assert np.sqrt(np.nanmean(np.square(error))) < 0.5 * count, joint
    assert log.time[-1] > motion.duration
    session = load_session(tmp_path)
    assert [take.name for take in session.takes] == ["stand", "stand_joints"]
    assert not any(servo["torque_enable"] for servo in robot.servos.values())


def test_a_servo_that_is_missing_is_the_controllers_to_tell():
    r = Robot()
    r.servos[9].power(False)
    r.run(300)
    with pytest.raises(BusError, match=r"its torque stays off: a servo is silent \(servo 9\)"):
        Controller(PcLinkPort(r.board)).to_neutral()


def test_a_table_of_another_robot_is_refused():
    r = Robot()
    r.run(300)
    controller = Controller(PcLinkPort(r.board))
    controller.to_neutral()
    table = load_motion(data_file("robotis_walk.csv")).as_table()
    with pytest.raises(BusError, match="the table is refused: "):
        controller.upload(TableFile(table, tuple(JointBounds(i + 50) for i in IDS), 1, True))


def test_nobody_there():
    r = Robot()
    r.board.power_off()
    with pytest.raises(BusError, match="no CM-530 with the workbench's program answers"):
        Controller(PcLinkPort(r.board)).state()
