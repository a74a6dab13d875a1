"""Playing when the computer, the bus or the operator is not polite: stalls, silences, second signals, what holds a joint."""

import json

import numpy as np
import pytest

from tests.device.servos import arm, robot
from tests.device.test_play import START, limp
from workbench.api.robot_run import run_on_robot
from workbench.device.bus.survey import survey
from workbench.device.play import PlayOptions, perform
from workbench.device.stop import Stop
from workbench.device.tables.limits import check_limits
from workbench.device.virtual import seconds
from workbench.files import InputError
from workbench.motion import Motion
from workbench.recording.formats.read import read_recording

OPTIONS = PlayOptions(rest=0.3)


def wave(dwell, poses=20, degrees=10.0):
    """A sine of so many poses on the arm's joints."""
    shape = np.sin(2 * np.pi * np.arange(poses + 1) / poses)
    angles = np.radians(np.outer(shape, [degrees, -degrees, degrees]))
    return Motion("wave", np.arange(poses + 1) * dwell, ("one", "three", "two"), angles)


def stalled(bus, at, seconds_long):
    """The computer stands still once, in a reading, from a time on [s]."""
    done = []

    def slowed(read):
        def slow(servos, *names):
            if not done and bus.now() >= at:
                done.append(bus.now())
                bus.pause(seconds_long)
            return read(servos, *names)
        return slow

    bus.read, bus.read_all = slowed(bus.read), slowed(bus.read_all)
    return done


def perform_on(r, tmp_path, motion, cycles, stall=None, stop=lambda: "", options=OPTIONS):
    """How it went, when servos were asked [s], and the bus."""
    bus = r.bus()
    found = survey(bus, r.model, ids=())
    if stall:
        stalled(bus, *stall)
    asked, read = [], bus.read

    def noted(servo, *names):
        asked.append(bus.now())
        return read(servo, *names)

    bus.read = noted
    return perform(bus, found, motion.commands(cycles), tmp_path / "w.csv", stop, options), asked


@pytest.mark.parametrize(("dwell", "cycles", "stall"), [(0.02, 20, (3.0, 0.03)), (0.1, 8, (3.0, 0.12)), (0.04, 12, (3.0, 0.2))])
def test_one_hiccup_of_the_computer_does_not_blind_the_watch(tmp_path, dwell, cycles, stall):
    r = robot(angles=START, model=arm(tmp_path))
    r.at(5.0, lambda: setattr(r.servos["two"], "mute", True))
    result, _ = perform_on(r, tmp_path, wave(dwell), cycles, stall)
    assert result.stopped.startswith("servo 2 (two): silent for 0.3 s")
    assert result.ended - 5.0 < 0.4 + dwell


def test_a_short_stall_of_a_healthy_robot_stops_nothing_and_reading_goes_on(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    result, asked = perform_on(r, tmp_path, wave(0.1), 8, (3.0, 0.12))
    assert (result.stopped, result.released) == ("", True)
    motion = [t for t in asked if result.started < t < result.ended]
    assert max(np.diff(motion)) < 0.25
    assert len(motion) > 100 * (result.ended - result.started)


def test_a_servo_that_nobody_asked_is_missed_as_well(tmp_path):
    """Half a second in which nothing is read ends the motion, though every servo would have answered."""
    r = robot(angles=START, model=arm(tmp_path))
    result, _ = perform_on(r, tmp_path, wave(0.1), 8, (3.0, 0.5))
    assert "could not be read for 0.5 s, as the computer or the adapter was held up" in result.stopped
    assert result.ended < 3.6
    assert limp(r)


def test_servos_whose_watchdog_tripped_are_brought_back(tmp_path):
    """A stall longer than the watchdog freezes XL servos: that is a stop with a reason, and they still go to neutral."""
    r = robot("XL-330", START, model=arm(tmp_path))
    result, _ = perform_on(r, tmp_path, wave(0.1, degrees=20.0), 6, (3.0, 0.6))
    assert "could not be read for 0.6 s" in result.stopped
    assert all(abs(s["present_position"] - 2048) < 20 for s in r.servos.values())
    assert limp(r)
    assert {s["bus_watchdog"] for s in r.servos.values()} == {0}


def test_one_tripped_watchdog_is_a_stop_with_a_reason(tmp_path):
    r = robot("XL-330", START, model=arm(tmp_path))
    r.at(3.0, lambda: r.servos["two"].__setitem__("bus_watchdog", 255))
    result, _ = perform_on(r, tmp_path, wave(0.1), 6)
    assert result.stopped == "servo 2 (two): its bus watchdog stopped it: it heard nothing for too long"
    assert result.ended < 3.4
    assert abs(r.servos["two"]["present_position"] - 2048) < 20


def interrupted(r, *times):
    """A `Stop` that gets a Ctrl-C at each time [s]."""
    stop = Stop()
    for time in times:
        r.at(time, lambda: stop.ask("Ctrl-C"))
    return stop


def test_a_second_ctrl_c_releases_at_once(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    stop = interrupted(r, 3.0, 3.2)
    result, _ = perform_on(r, tmp_path, wave(0.5, degrees=60.0), 20, stop=lambda: stop.reason)
    assert (result.stopped, result.released) == ("Ctrl-C, twice", True)
    off = min(seconds(t) for s in r.servos.values() for t, a, v in s.written if a == 24 and not v)
    assert 3.2 <= off < 3.25


def test_a_third_ctrl_c_ends_what_looks_at_nothing():
    stop = Stop()
    stop.ask("Ctrl-C")
    stop.ask("Ctrl-C")
    with pytest.raises(KeyboardInterrupt):
        stop.ask("Ctrl-C")
    assert stop.interrupted


def test_a_dead_supply_on_the_way_back_releases(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    stop = interrupted(r, 3.0)
    r.at(3.1, lambda: setattr(r.wire, "supply", 6.0))
    result, _ = perform_on(r, tmp_path, wave(0.5, degrees=60.0), 20, stop=lambda: stop.reason)
    assert result.stopped.startswith("Ctrl-C; then servo ")
    assert "6.0 V, the supply has failed" in result.stopped
    off = min(seconds(t) for s in r.servos.values() for t, a, v in s.written if a == 24 and not v)
    assert off < 3.3


def test_ctrl_c_before_the_torque_is_on_leaves_it_off(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    result, _ = perform_on(r, tmp_path, wave(0.1), 2, stop=lambda: "Ctrl-C")
    assert (result.stopped, result.poses) == ("Ctrl-C", 0)
    assert not any(a in (24, 30) for s in r.servos.values() for _, a, _ in s.written), "not even off"
    assert not (tmp_path / "w.play").exists()


@pytest.mark.parametrize("at", [0.004, 0.008, 0.012, 0.016, 0.02, 0.03])
def test_a_servo_that_fails_at_the_start_is_named_and_the_next_play_is_not_refused(tmp_path, at):
    r = robot(angles=START, model=arm(tmp_path))
    bus = r.bus()
    found = survey(bus, r.model, ids=())
    r.at(at, lambda: setattr(r.servos["two"], "mute", True))
    try:
        said = perform(bus, found, wave(0.1).commands(2), tmp_path / "w.csv", lambda: "", OPTIONS).stopped
    except Exception as e:
        said = str(e)
    assert "servo 2 (two)" in said
    assert all(not s["torque_enable"] for s in r.servos.values())
    r.servos["two"].mute = False
    assert perform(bus, found, wave(0.1).commands(1), tmp_path / "w.csv", lambda: "", OPTIONS).stopped == ""


def test_the_first_way_has_little_torque_and_the_limits_are_put_back(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    perform_on(r, tmp_path, wave(0.1), 1, options=PlayOptions(rest=0.3, start_torque=0.4, torque=0.7))
    for servo in r.servos.values():
        limits = [v for _, a, v in servo.written if a == 34]
        assert limits[0] == round(0.4 * 1023)
        assert limits[1] == round(0.7 * 1023)
        assert limits[-1] == 1023
        first_torque = next(t for t, a, v in servo.written if a in (24, 30) and v)
        assert next(t for t, a, _ in servo.written if a == 34) <= first_torque


def test_a_joint_that_did_not_come_back_is_no_success(tmp_path):
    """Something catches a joint in the motion's last pose."""
    r = robot(angles=START, model=arm(tmp_path))
    sense = r.body.sense
    caught = []
    r.body.sense = lambda joint, now: (type(sense(joint, now))(0.5) if joint == 1 and caught else sense(joint, now))
    r.at(3.5, lambda: caught.append(True))
    result, _ = perform_on(r, tmp_path, wave(0.1, degrees=30.0), 1)
    assert "servo 1 (one): is at 29 deg instead of 0; what holds it?" in result.stopped
    assert limp(r)


def test_a_servo_that_does_not_confirm_its_release_is_named(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    r.at(3.0, lambda: setattr(r.servos["two"], "mute", True))
    result, _ = perform_on(r, tmp_path, wave(0.1), 3)
    assert result.unknown == ("two",)
    assert "silent" in result.stopped


def held_away(tmp_path):
    """Joint one stands at 60 deg in every pose, so that the table has speed 0 for it; two moves."""
    model = arm(tmp_path)
    times = np.array([0.0, 0.1, 0.2, 0.3])
    angles = np.radians([[60.0, 0], [60, 10], [60, -5], [60, 0]])
    return model, Motion("held", times, ("one", "two"), angles)


def test_a_first_pose_away_from_neutral_is_approached_slowly(tmp_path):
    model, motion = held_away(tmp_path)
    table = motion.as_table()
    assert (table.speeds[:, 0] == 0).all()
    commands = motion.commands(2)
    assert commands.poses.tolist() == [-1, 0, 1, 2, 0, 1, 2]
    assert commands.times[1] == pytest.approx(np.radians(60) / 0.6, abs=0.01)
    assert 0 < commands.speeds[0, 0] < 0.7
    warnings = [v for v in check_limits(table, model) if v.kind == "speed" and v.joint == "one"]
    assert [v.warning for v in warnings] == [True]
    assert "60.1 deg from neutral" in str(warnings[0])
    r = robot(angles=START, model=model)
    fastest, sense, last = [], r.body.sense, {}

    def watched(joint, now):
        felt = sense(joint, now)
        if joint in last and now > last[joint][0]:
            fastest.append(abs(felt.angle - last[joint][1]) / seconds(now - last[joint][0]))
        last[joint] = now, felt.angle
        return felt

    r.body.sense = watched
    result, _ = perform_on(r, tmp_path, motion, 2)
    assert result.stopped == ""
    assert not [v for s in r.servos.values() for _, a, v in s.written if a == 32 and v == 0]
    assert max(fastest) < 4.0


def test_a_pose_too_short_for_its_way_is_not_finished_at_once(tmp_path):
    """The second pose has the goal of the first, which is not reached by then, and speed 0 in the table: the joint goes on at the
    speed that it has."""
    motion = Motion("short", np.array([0.0, 0.1, 0.3, 0.9]), ("one",), np.radians([[35.0], [40], [40], [35]]))
    assert motion.as_table().speeds[1, 0] == 0
    r = robot(angles=START, model=arm(tmp_path))
    result, _ = perform_on(r, tmp_path, motion, 1)
    sent = [v for t, a, v in r.servos["one"].written if a == 32 and result.started - 0.01 < seconds(t) < result.ended]
    assert sent[0] == sent[1] == motion.as_table().speeds[0, 0]


def test_the_journal_tells_of_the_second_signal(tmp_path):
    """Whatever ends it, the joint log is made, and readable."""
    r = robot(angles=START, model=arm(tmp_path))
    stop = interrupted(r, 3.0, 3.2)
    result, _ = perform_on(r, tmp_path, wave(0.1), 20, stop=lambda: stop.reason)
    assert result.log_problem == ""
    assert read_recording(tmp_path / "w.csv").time[-1] > 0.5
    assert json.dumps(result.stopped)


def test_a_run_that_was_stopped_before_it_began_says_why(tmp_path):
    """Not that there is no joint log, which is only what follows from it."""
    r = robot(angles=START, model=arm(tmp_path))
    with pytest.raises(InputError, match=r"^stopped: Ctrl-C; there is no joint log"):
        run_on_robot(r.bus(), r.model, wave(0.1), 1, tmp_path / "run", lambda: "Ctrl-C", options=OPTIONS)


def test_a_run_whose_servo_did_not_confirm_its_release_is_not_done(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    r.at(3.0, lambda: setattr(r.servos["two"], "mute", True))
    run = run_on_robot(r.bus(), r.model, wave(0.1), 3, tmp_path / "run", lambda: "", options=OPTIONS)
    assert not run.done
    assert any("torque may still be on in two" in warning for warning in run.warnings)
