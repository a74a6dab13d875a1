"""Single decisions of the player: the state in which it leaves the servos, its refusals, the reach and speed of its ramps."""

import math

import numpy as np
import pytest

from tests.device.servos import arm, robot
from tests.device.test_play import START, limp
from tests.device.test_play_rude import interrupted, perform_on, wave
from workbench.device.bus import BusError, PortGoneError
from workbench.device.bus.survey import survey
from workbench.device.play import PlayOptions, perform
from workbench.device.play.player import HOLDING
from workbench.device.virtual import seconds
from workbench.device.virtual.body import Sense

OPTIONS = PlayOptions(rest=0.3)
HOLD = PlayOptions(rest=0.3, hold=True)


def goals(servo, register="goal_position"):
    """When it was written [s], and what."""
    address = servo.profile.by_name[register].address
    return [(seconds(t), value) for t, a, value in servo.written if a == address]


class Elsewhere:
    """A body of which one joint stands elsewhere than its servo brings it. angle: of the angle that it would have [rad]."""

    def __init__(self, body, joint, angle):
        self.body, self.joint, self.angle = body, joint, angle

    def drive(self, joint, now, drive):
        self.body.drive(joint, now, drive)

    def sense(self, joint, now):
        felt = self.body.sense(joint, now)
        return Sense(self.angle(felt.angle), felt.velocity, felt.duty) if joint == self.joint else felt


def offset(r, joint, angle):
    """That joint of a robot stands elsewhere."""
    servo = r.servos[joint]
    servo.body = Elsewhere(servo.body, servo.joint, angle)


def test_torque_stays_on_where_it_is_asked_to_but_not_after_a_stop(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    result, _ = perform_on(r, tmp_path, wave(0.1), 1, options=HOLD)
    assert (result.stopped, result.released) == ("", False)
    assert all(s["torque_enable"] for s in r.servos.values())
    r = robot(angles=START, model=arm(tmp_path))
    stop = interrupted(r, 3.0)
    result, _ = perform_on(r, tmp_path, wave(0.1), 9, stop=lambda: stop.reason, options=HOLD)
    assert (result.stopped, result.released) == ("Ctrl-C", True)
    assert limp(r)


@pytest.mark.parametrize("ends", [(), (3.0,)], ids=["played", "stopped"])
@pytest.mark.parametrize("family", ["AX-12A", "XL-330"])
def test_what_was_set_is_put_back(tmp_path, family, ends):
    r = robot(family, START, model=arm(tmp_path))
    limits = {j: s["torque_limit"] for j, s in r.servos.items()}
    stop = interrupted(r, *ends)
    perform_on(r, tmp_path, wave(0.1), 9 if ends else 1, stop=lambda: stop.reason)
    for joint, servo in r.servos.items():
        assert servo["torque_limit"] == limits[joint]
        assert [v for _, v in goals(servo, "led")][-1] == 0
        if family == "XL-330":
            assert {25} < {v for _, v in goals(servo, "bus_watchdog")} <= {0, 25}, "half a second, in 20 ms"
            assert servo["bus_watchdog"] == 0


def test_a_start_that_fails_puts_torque_limits_back_and_names_who_may_hold(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    bus = r.bus()
    found = survey(bus, r.model, ids=())
    r.at(0.006, lambda: setattr(r.servos["two"], "mute", True))
    with pytest.raises(BusError, match=r"servo 2 \(two\)") as failed:
        perform(bus, found, wave(0.1).commands(1), tmp_path / "w.csv", lambda: "", OPTIONS)
    assert {v for s in r.servos.values() for _, v in goals(s, "torque_limit")} == {512, 1023}, "half, and back"
    assert HOLDING in str(failed.value)
    assert limp(r)
    assert all(s["torque_limit"] == 1023 for s in r.servos.values())


def test_nothing_is_switched_off_that_was_never_on(tmp_path):
    """A bus that fails before torque comes on is no reason to fear for the robot."""
    r = robot(angles=START, model=arm(tmp_path))
    r.at(0.03, lambda: setattr(r.port, "unplugged", True))
    with pytest.raises(PortGoneError) as failed:
        perform_on(r, tmp_path, wave(0.1), 1)
    assert not any(s["torque_enable"] for s in r.servos.values())
    assert HOLDING not in str(failed.value)


def test_who_can_no_longer_be_released_is_told(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    r.at(3.0, lambda: setattr(r.port, "unplugged", True))
    with pytest.raises(PortGoneError) as failed:
        perform_on(r, tmp_path, wave(0.1), 9)
    assert str(failed.value).endswith(HOLDING)


@pytest.mark.parametrize(("count", "degrees"), [(4200, 189), (-100, -189)])
def test_a_joint_beyond_the_range_of_goals_is_turned_back_by_hand(tmp_path, count, degrees):
    """A servo of protocol 2 counts on beyond a turn."""
    r = robot("XL-330", START, model=arm(tmp_path))
    bus = r.bus()
    found, read = survey(bus, r.model, ids=()), bus.read
    told = {(1, "present_position"): {"present_position": count}}
    bus.read = lambda servo, *names: told.get((servo, *names)) or read(servo, *names)
    said = rf"servo 1 \(one\): is at {degrees} deg, beyond the range of its goals; turn it back by hand"
    with pytest.raises(BusError, match=said):
        perform(bus, found, wave(0.1).commands(1), tmp_path / "w.csv", lambda: "", OPTIONS)
    assert not any(goals(s, "torque_enable") for s in r.servos.values())


@pytest.mark.parametrize(("degrees", "fine"), [(10, True), (14, False)])
def test_how_far_from_neutral_a_joint_may_be(tmp_path, degrees, fine):
    """It gets a second for it, and is let go at once then."""
    r = robot(angles=START, model=arm(tmp_path))
    offset(r, "one", lambda angle: angle - math.radians(degrees))
    result, _ = perform_on(r, tmp_path, wave(0.1), 1)
    assert (result.stopped == "") == fine
    if not fine:
        assert "servo 1 (one): is at -14 deg instead of 0; what holds it?" in result.stopped
        arrived = goals(r.servos["one"])[-1][0]
        off = min(t for s in r.servos.values() for t, v in goals(s, "torque_enable") if not v)
        assert 0.9 < off - arrived < 1.25
        assert result.poses == 0


def test_a_joint_is_seated_where_it_hangs_by_a_single_count(tmp_path):
    r = robot(model=arm(tmp_path))
    offset(r, "one", lambda angle: angle - math.radians(300 / 1023))
    result, _ = perform_on(r, tmp_path, wave(0.1), 1)
    assert 513 in [v for t, v in goals(r.servos["one"]) if t < result.started - 0.01]


@pytest.mark.parametrize("degrees", [8, -8])
def test_a_joint_is_seated_by_no_more_than_is_safe(tmp_path, degrees):
    r = robot(model=arm(tmp_path))
    offset(r, "one", lambda angle: angle - math.radians(degrees))
    result, _ = perform_on(r, tmp_path, wave(0.1), 1)
    told = [(v - 512) * 300 / 1023 for t, v in goals(r.servos["one"]) if t < result.started - 0.01]
    told = told[told.index(0):]
    farthest = max(told, key=abs)
    assert farthest == pytest.approx(math.copysign(8, degrees), abs=0.3), "4 deg, twice"
    assert sorted({round(abs(x)) for x in told}) == [0, 4, 8]
    assert told[-1] == 0


def test_ramps_begin_and_end_slowly_and_never_take_no_time(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    perform_on(r, tmp_path, wave(0.1), 1)
    ramp = [(t, (v - 512) * math.radians(300) / 1023) for t, v in goals(r.servos["one"]) if t < 1.9]
    ramp = ramp[2:1 + next(k for k, (_, angle) in enumerate(ramp) if angle == 0)]
    steps = np.abs(np.diff([angle for _, angle in ramp]))
    assert steps[0] < 0.3 * steps.max() > steps[-1]
    assert ramp[-1][0] - ramp[0][0] == pytest.approx(START["one"] / OPTIONS.ramp_speed, abs=0.1), "the farthest joint's way"
    speeds = {v for t, v in goals(r.servos["one"], "moving_speed") if 0.2 < t < 1.0}
    assert speeds == {r.bus().profile.speed(2 * OPTIONS.ramp_speed)}
    r = robot(model=arm(tmp_path))
    result, _ = perform_on(r, tmp_path, wave(0.1), 1)
    assert sum(t < result.log_start for t, _ in goals(r.servos["one"])) > 10, "0.3 s, though it is in neutral"


def test_a_stall_in_the_ramp_is_followed_by_no_jump(tmp_path):
    """Its goals go on where they were, as if the computer had not stood still."""
    r = robot(angles=START, model=arm(tmp_path))
    perform_on(r, tmp_path, wave(0.1), 1, stall=(0.5, 0.25))
    ramp = [v for t, v in goals(r.servos["one"]) if t < 1.4]
    assert max(np.abs(np.diff(ramp))) * math.radians(300) / 1023 < 2 * 1.5 * OPTIONS.ramp_speed * OPTIONS.step + 0.006


def test_the_worst_pose_is_told_however_well_the_last_one_went(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    result, _ = perform_on(r, tmp_path, wave(0.1), 2, stall=(3.0, 0.17))
    assert result.stopped == ""
    assert 0.05 < result.worst_late < 0.2


def test_goals_that_were_lost_before_the_motion_are_none_of_its(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    for k in range(80):
        r.at(0.5 + 0.005 * k, lambda: r.servos["two"].__setitem__("goal_position", 530))
    result, _ = perform_on(r, tmp_path, wave(0.1), 1)
    assert result.stopped == ""
    assert result.repaired > 3
    assert result.missed == 0


def test_a_joint_that_lags_is_brought_back_from_where_it_is(tmp_path):
    """Not from the pose that it never reached."""
    r = robot(angles=START, model=arm(tmp_path))
    caught = []
    offset(r, "one", lambda angle: 0.0 if caught else angle)
    r.at(2.3, lambda: caught.append(True))
    stop = interrupted(r, 3.0)
    result, _ = perform_on(r, tmp_path, wave(0.1, degrees=60.0), 9, stop=lambda: stop.reason)
    assert result.stopped == "Ctrl-C"
    after = [(v - 512) * 300 / 1023 for t, v in goals(r.servos["one"]) if t > result.ended]
    assert max(abs(angle) for angle in after) < 1
    before = [(v - 512) * 300 / 1023 for t, v in goals(r.servos["one"]) if result.started < t < result.ended]
    assert max(abs(angle) for angle in before[-3:]) > 12
