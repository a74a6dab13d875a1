"""A joint is moved a little, to be seen: swapped IDs and wrong signs come out, and its torque is off afterwards."""

import math

import pytest

from tests.device.servos import FAMILIES, arm, robot
from workbench.device.bus import BusError
from workbench.device.bus.survey import survey
from workbench.device.play.wiggle import Answers, wiggle
from workbench.device.virtual import seconds
from workbench.files import InputError
from workbench.robot.ranges import joint_ranges

IDS = {"one": 1, "two": 2, "three": 3}


def found(r, joint):
    bus = r.bus()
    return bus, next(s for s in survey(bus, r.model, ids=()).found.values() if s.joint == joint)


@pytest.mark.parametrize("family", FAMILIES)
def test_one_joint_goes_three_degrees_and_back_and_is_limp(tmp_path, family):
    r = robot(family, {"two": 0.3, "one": -0.2}, model=arm(tmp_path))
    bus, servo = found(r, "two")
    before = len(r.servos["two"].written)
    done = wiggle(bus, servo)
    assert math.degrees(done.went) == pytest.approx(3.0, abs=0.4)
    assert not done.blocked
    assert r.body.sense(2, r.wire.clock.now).angle == pytest.approx(0.3, abs=0.01)
    assert not any(s["torque_enable"] for s in r.servos.values())
    assert not r.servos["one"].written
    assert r.servos["two"]["torque_limit"] == servo.registers["torque_limit"]
    written = r.servos["two"].written[before:]
    speed = r.servos["two"].profile.by_name["moving_speed"].address
    assert all(v for _, a, v in written if a == speed)
    assert seconds(r.wire.clock.now) < 5


def test_a_joint_that_is_held_is_told_of_and_released(tmp_path):
    r = robot(model=arm(tmp_path))
    sense = r.body.sense
    r.body.sense = lambda joint, now: type(sense(joint, now))(0.0) if joint == 2 else sense(joint, now)
    bus, servo = found(r, "two")
    assert wiggle(bus, servo).blocked
    assert not r.servos["two"]["torque_enable"]


def test_torque_goes_off_where_the_servo_fails_in_between(tmp_path):
    r = robot(model=arm(tmp_path))
    bus, servo = found(r, "two")
    r.at(0.1, lambda: setattr(r.servos["two"], "mute", True))
    with pytest.raises(BusError, match=r"servo 2 \(two\), register present_position: no answer"):
        wiggle(bus, servo)
    assert not r.servos["two"]["torque_enable"]


def test_a_servo_that_has_torque_is_left_alone(tmp_path):
    r = robot(model=arm(tmp_path))
    r.servos["two"]["torque_enable"] = 1
    bus, servo = found(r, "two")
    with pytest.raises(BusError, match="its torque is on; switch the robot off and on first"):
        wiggle(bus, servo)


def test_answers_find_swapped_ids_and_signs():
    answers = Answers()
    for joint, answer in (("one", "\n"), ("two", "three -"), ("three", "two")):
        answers.take(joint, answer, IDS)
    assert answers.findings(IDS) == [
        "servo 2 is three, not two: bus_ids should say three: 2",
        "servo 3 is two, not three: bus_ids should say two: 3",
        "joint three turns the other way than in the model"]
    with pytest.raises(InputError, match="'left': expected Enter, -, or the joint that moved: one two three"):
        answers.take("one", "left", IDS)
    fine = Answers()
    fine.take("one", "yes", IDS)
    assert fine.findings(IDS) == []


def test_angle_limits_are_those_that_the_firmware_keeps_to():
    """One source: the puppy's table of ranges, narrower than its description."""
    from workbench.device.bus.setup import wanted_registers
    from workbench.robot import puppy_model
    from workbench.robot.servo_profile_file import servo_profile

    model, profile = puppy_model(), servo_profile("AX-12A")
    for joint, own in joint_ranges(model).items():
        wanted = wanted_registers(model, joint, profile)
        assert profile.angle(wanted["cw_angle_limit"]) == pytest.approx(max(own.lower, profile.angle(0)), abs=profile.count)
