"""The servos through the CM-530: the flashed image in bridge mode between the bus class and the virtual servos."""

import pytest

from tests.device.servos import robot
from tests.firmware.image import IDS, Robot, needs_compiler
from workbench.device.bus import Bus, BusError, NoAnswerError
from workbench.device.bus.bridge import RATE, enter_bridge, leave_bridge
from workbench.device.bus.survey import survey
from workbench.device.link import FrameType, encode_frame
from workbench.device.virtual.cm530.port import PcLinkPort
from workbench.robot import puppy_model
from workbench.robot.servo_profile_file import servo_profile


def bridged() -> tuple[Robot, PcLinkPort, Bus]:
    """A robot whose controller is a bridge, the port that leads to it, and the servos' bus over that."""
    r = Robot()
    r.run(300)
    r.board.send(r.board.pc, encode_frame(FrameType.RELEASE))
    r.run(100)
    port = PcLinkPort(r.board)
    enter_bridge(port)
    return r, port, Bus(port, servo_profile("AX-12A"))


@needs_compiler
def test_the_bus_through_the_flashed_image():
    r, port, bus = bridged()
    found = survey(bus, puppy_model(), ids=())
    assert sorted(found.found) == sorted(IDS)
    assert found.problems() == ()
    assert found.found[9].angle == pytest.approx(r.body.sense(9, r.clock.now).angle, abs=0.003)
    with pytest.raises(NoAnswerError, match="servo 99"):
        bus.read(99, "id")
    goals = {i: {"goal_position": 500 + i, "moving_speed": 100} for i in IDS}
    bus.sync_write(goals)
    bus.pause(0.02)
    assert {i: r.servos[i]["goal_position"] for i in IDS} == {i: 500 + i for i in IDS}
    bus.release(IDS)
    leave_bridge(port)
    r.run(100)
    r.sound()


@pytest.mark.slow
@needs_compiler
def test_silence_on_the_bridge_ends_with_torque_off():
    """A killed program or a pulled plug stops sending."""
    r, _, bus = bridged()
    bus.sync_write({i: {"goal_position": 540, "moving_speed": 100} for i in IDS})
    r.run(500)
    assert all(s["torque_enable"] for s in r.servos.values())
    r.run(6000)
    assert not any(s["torque_enable"] for s in r.servos.values())


def test_no_bridge_there_is_one_line():
    r = robot(joints=["flm"])
    r.port.setBaudRate(RATE)
    with pytest.raises(BusError, match=r"no CM-530 with the workbench's program answers at 57600 bit/s; `workbench flash`"):
        enter_bridge(r.port)
