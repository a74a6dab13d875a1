"""Playing a motion on virtual servos: timing, counts, ramps, every reaction, and the joint log."""

import json
import math

import numpy as np
import pytest

from tests.device.servos import FAMILIES, arm, robot
from workbench.device.bus import BusError, PortGoneError
from workbench.device.bus.survey import survey
from workbench.device.play import PlayOptions, finish_log, perform
from workbench.device.play.journal import PlayJournal
from workbench.device.play.watch import Watch
from workbench.device.virtual import MICROSECOND, bit_flips, seconds
from workbench.files import InputError
from workbench.motion import Motion
from workbench.recording.formats.read import read_recording

MOTION = Motion("wave", np.array([0.0, 0.15, 0.27, 0.4]), ("one", "three", "two"),
                np.radians([[0.0, 0, 0], [25, -15, 30], [-20, 12, -25], [0, 0, 0]]))
OPTIONS = PlayOptions(rest=0.3)
START = {"one": 0.6, "two": -0.4, "three": 0.1}


def played(tmp_path, r, cycles=2, stop=lambda: "", options=OPTIONS, before=None):
    bus = r.bus()
    found = survey(bus, r.model, ids=())
    if before is not None:
        before(bus)
    return perform(bus, found, MOTION.commands(cycles), tmp_path / "wave.csv", stop, options)


def stopped(tmp_path, r, at, action, cycles=40):
    """A motion that something ends `at` seconds after its first pose, and when it was ended [s] after that."""
    r.at(at + 1.9, action)  # the ramp from START takes a second
    result = played(tmp_path, r, cycles)
    assert result.stopped
    return result


def limp(r):
    return all(not s["torque_enable"] or not s.powered for s in r.servos.values())


@pytest.mark.parametrize("family", FAMILIES)
def test_every_goal_is_right_to_a_count_and_in_time(tmp_path, family):
    r = robot(family, START, model=arm(tmp_path))
    result = played(tmp_path, r)
    bus = r.bus()
    assert (result.poses, result.stopped, result.released) == (6, "", True)
    assert result.worst_late < 1e-3
    commands = MOTION.commands(2)
    for joint, servo in r.servos.items():
        address = servo.profile.by_name["goal_position"].address
        written = [(seconds(t), value) for t, a, value in servo.written if a == address]
        k = commands.column(joint)
        for t, goal in zip(commands.times, commands.goals[:, k]):
            at = result.started + t
            assert any(value == bus.profile.position(goal) and abs(when - at) < 1e-3 for when, value in written), (joint, t)
    assert limp(r)


def test_it_starts_from_where_the_robot_is(tmp_path):
    """No goal is ever far from where the joint was told to be before, and none is sent before the joint was read."""
    r = robot(angles=START, model=arm(tmp_path))
    played(tmp_path, r)
    profile = r.bus().profile
    for joint, servo in r.servos.items():
        goals = [(seconds(t), value) for t, a, value in servo.written if a == 30]
        assert goals[0][1] == profile.position(START[joint])
        ramp = [value for _, value in goals if value != goals[0][1]][:40]
        assert max(abs(np.diff([goals[0][1], *ramp]))) * profile.count < 0.03
        enabled = [seconds(t) for t, a, value in servo.written if a == 24 and value]
        assert goals[0][0] <= enabled[0]


def test_the_log_says_what_was_sent_and_where_the_joints_were(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    result = played(tmp_path, r)
    log = read_recording(tmp_path / "wave.csv")
    assert not (tmp_path / "wave.play").exists()
    commands, sent = MOTION.commands(2), log.commands
    rest = np.flatnonzero((np.abs(sent.goals) > 1e-6).any(axis=1))[0]
    np.testing.assert_allclose(sent.goals[rest:rest + 6], commands.reordered(sent.joints).goals, atol=1e-5)
    np.testing.assert_allclose(sent.speeds[rest:rest + 6], commands.reordered(sent.joints).speeds, atol=1e-4)
    np.testing.assert_allclose(np.diff(sent.times[rest:rest + 6]), np.diff(commands.times), atol=1e-3)
    for joint in r.model.joints:
        truth = commands.reference(log.time - sent.times[rest])[:, commands.column(joint)]
        during = (log.time > sent.times[rest]) & (log.time < sent.times[rest] + commands.end)
        error = np.abs(log.channels[f"position.{joint}"] - truth)[during]
        assert np.nanmax(error) < math.radians(1.5), "a corner from 3 to -6.5 rad/s, and a row 2 ms from its reading"
        assert np.nanmedian(error) < math.radians(0.3)
        assert np.isfinite(error).mean() > 0.5
    assert np.nanmean(log.channels["voltage"]) == pytest.approx(11.1)
    assert result.started > 0


def test_flipped_bits_change_nothing(tmp_path):
    """0.1 % of answer bytes wrong: nothing stops it, and every goal is sent."""
    r = robot(angles=START, model=arm(tmp_path))
    result = played(tmp_path, r, cycles=8, before=lambda bus: setattr(r.wire, "from_servos", bit_flips(1e-3, seed=2)))
    assert (result.stopped, result.poses) == ("", 24)


def test_ctrl_c_ramps_to_neutral_and_releases(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    flag = []
    r.at(2.5, lambda: flag.append("Ctrl-C"))
    result = played(tmp_path, r, 40, stop=lambda: flag[0] if flag else "")
    assert (result.stopped, result.released) == ("Ctrl-C", True)
    assert limp(r)
    last = {j: [v for _, a, v in s.written if a == 30][-1] for j, s in r.servos.items()}
    assert set(last.values()) == {512}
    assert read_recording(tmp_path / "wave.csv").time[-1] > 1


@pytest.mark.parametrize(("action", "said", "within"), [
    (lambda r: setattr(r.servos["two"], "temperature", 69.0), "servo 2 (two): 69 deg C, its limit is 70", 2.0),
    (lambda r: setattr(r.wire, "supply", 8.5), "8.5 V, below 9 V", 2.0),
    (lambda r: setattr(r.wire, "supply", 6.2), "6.2 V, the supply has failed", 0.3),
    (lambda r: setattr(r.servos["two"], "overload", True), "servo 2 (two): alarm: overload", 0.3),
    (lambda r: setattr(r.servos["two"], "mute", True), "servo 2 (two): silent for 0.3 s", 0.4),
    (lambda r: (r.servos["two"].power(False), r.servos["two"].power(True)), "servo 2 (two): it restarted", 0.4),
], ids=["heat", "low", "dead", "overload", "silent", "restart"])
def test_what_stops_a_motion(tmp_path, action, said, within):
    """Each stops it, within its time; what is in the journal says why, and the robot is released."""
    r = robot(angles=START, model=arm(tmp_path))
    when = []

    def strike():
        when.append(seconds(r.wire.clock.now))
        action(r)

    r.at(2.5, strike)
    result = played(tmp_path, r, 40)
    assert said in result.stopped
    speeds = [(seconds(t), v) for t, a, v in r.servos["one"].written if a == 32]
    ramp = speeds[-1][1]
    last = max(t for t, v in speeds if v != ramp)
    assert last - when[0] < within + 0.15, "the last pose, after which all is on the way to neutral"
    assert all(not s["torque_enable"] for j, s in r.servos.items() if j != "two")


def test_a_babbling_servo_stops_it_and_what_is_sent_once_it_is_quiet_is_heard(tmp_path):
    """Nobody's answer can be read; nor does anybody hear while it lasts."""
    r = robot(angles=START, model=arm(tmp_path))
    clock = r.wire.clock

    def babble():
        for k in range(3000):
            clock.at(clock.now + k * 330 * MICROSECOND, lambda: r.wire.talk("babbler", bytes(range(32)), 1_000_000, clock.now))

    r.at(2.5, babble)
    result = played(tmp_path, r, 40)
    assert "silent for 0.3 s" in result.stopped
    assert limp(r)


@pytest.mark.parametrize("glitch", [
    lambda s: setattr(s, "temperature", 69.0), lambda s: setattr(s, "overload", True), lambda s: setattr(s, "mute", True)],
    ids=["heat", "overload", "silent"])
def test_a_single_reading_stops_nothing(tmp_path, glitch):
    r = robot(angles=START, model=arm(tmp_path))
    servo = r.servos["two"]
    servo["alarm_shutdown"] = 0

    def heal():
        servo.temperature, servo.overload, servo.mute = 30.0, False, False

    for k in range(8):
        r.at(2.2 + 0.23 * k, lambda: glitch(servo))
        r.at(2.212 + 0.23 * k, heal)
    assert played(tmp_path, r, 6).stopped == ""


def test_a_joint_that_something_holds_is_let_go(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    sense = r.body.sense
    r.body.sense = lambda joint, now: type(sense(joint, now))(0.6) if joint == 1 else sense(joint, now)
    result = played(tmp_path, r)
    assert "servo 1 (one): is at 34 deg instead of 0; what holds it?" in result.stopped
    assert result.poses == 0
    assert limp(r)


def test_a_pulled_plug_ends_in_one_line_and_the_log_is_kept(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    r.at(3.0, lambda: setattr(r.port, "unplugged", True))
    with pytest.raises(PortGoneError, match="the adapter has disconnected"):
        played(tmp_path, r, 40)
    assert read_recording(tmp_path / "wave.csv").time[-1] > 0.5
    r.port.unplugged = False
    assert r.bus().read(1, "id") == {"id": 1}
    assert not limp(r), "an AX-12A holds its last goal until its power goes: nobody can tell it otherwise"


def test_servos_with_a_watchdog_stop_by_themselves(tmp_path):
    """The plug of an XL-330 robot is pulled: half a second later it stands still, and does as told again once cleared."""
    r = robot("XL-330", START, model=arm(tmp_path))
    r.at(3.0, lambda: setattr(r.port, "unplugged", True))
    with pytest.raises(PortGoneError):
        played(tmp_path, r, 40)
    r.wire.clock.advance(r.wire.clock.now + 72_000_000)
    assert {s["bus_watchdog"] for s in r.servos.values()} == {255}
    r.port.unplugged = False
    assert played(tmp_path, r, 1).stopped == ""
    assert {s["bus_watchdog"] for s in r.servos.values()} == {0}


def test_preflight_moves_nothing(tmp_path):
    for spoil, said in (
        (lambda r: setattr(r.servos["two"], "mute", True), "joint two does not answer; nothing was moved"),
        (lambda r: r.servos["two"].__setitem__("model_number", 29), r"servo 2 \(two\): is MX-28 \(29\); expected AX-12A"),
        (lambda r: setattr(r.servos["two"], "overload", True), r"servo 2 \(two\): alarm: overload"),
        (lambda r: setattr(r.wire, "supply", 8.0), "3 of 3 servos read 8.0 V; expected 9 to 12.6 V"),
        (lambda r: setattr(r.servos["two"], "temperature", 62.0), "62 deg C; expected at least 10 below its limit of 70"),
        (lambda r: r.servos["two"].__setitem__("ccw_angle_limit", 0), "it turns without end"),
        (lambda r: r.servos["two"].__setitem__("torque_limit", 0), r"servo 2 \(two\): its torque is limited to nothing"),
    ):
        r = robot(angles=START, model=arm(tmp_path))
        spoil(r)
        with pytest.raises(InputError, match=said):
            played(tmp_path, r)
        assert not any(servo.written for servo in r.servos.values())
        assert list(tmp_path.glob("wave*")) == []


def test_a_motion_of_joints_that_are_not_there(tmp_path):
    model = arm(tmp_path)
    r = robot(angles=START, model=model)
    bus = r.bus()
    other = Motion("x", MOTION.times, ("one", "two", "tail"), MOTION.angles)
    with pytest.raises(InputError, match="the motion moves joint tail, which is not on the bus"):
        perform(bus, survey(bus, model, ids=()), other.commands(), tmp_path / "x.csv", lambda: "")


def test_a_bus_that_fails_before_anything_moved(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    with pytest.raises(BusError, match=r"servo 1 \(one\), register present_position: no answer in 3 tries"):
        played(tmp_path, r, before=lambda bus: setattr(r.servos["one"], "mute", True))


def test_a_journal_cut_anywhere_can_be_finished_or_is_refused(tmp_path):
    r = robot(angles=START, model=arm(tmp_path))
    bus = r.bus()
    found = survey(bus, r.model, ids=())
    from workbench.device.play import play

    with PlayJournal(tmp_path / "j", {"joints": list(r.model.joints)}) as journal:
        play(bus, found, MOTION.commands(1), journal, lambda: "", OPTIONS)
    whole = (tmp_path / "j").read_bytes()
    done = 0
    for size in np.linspace(1, len(whole), 40).astype(int):
        (tmp_path / "cut").write_bytes(whole[:size])
        try:
            finish_log(tmp_path / "cut", tmp_path / "cut.csv")
        except InputError:
            continue
        done += 1
        assert read_recording(tmp_path / "cut.csv").commands is not None
    assert done > 25
    lines = whole.splitlines(keepends=True)
    (tmp_path / "bad").write_bytes(b"".join([*lines[:5], b"{oops\n", *lines[5:]]))
    with pytest.raises(InputError, match="line 6: damaged"):
        finish_log(tmp_path / "bad", tmp_path / "bad.csv")
    with pytest.raises(InputError, match="not left behind by `workbench play`"):
        finish_log(__file__, tmp_path / "x.csv")
    assert json.loads(lines[0])["kind"].startswith("workbench play")


def test_the_watch_needs_two_readings_of_the_same_servo(tmp_path):
    profile = robot(model=arm(tmp_path)).bus().profile
    watch = Watch(profile, {1: "one", 2: "two"}, {1: 70, 2: 70})
    hot = {"present_temperature": 69, "present_voltage": 111}
    watch.answered(1, 0.0, hot, ())
    watch.answered(2, 0.0, hot, ())
    watch.answered(1, 0.1, {"present_temperature": 30, "present_voltage": 111}, ())
    watch.answered(1, 0.2, hot, ())
    assert watch.reaction is None
    watch.answered(2, 0.2, hot, ())
    assert watch.reaction.how == "neutral"
    assert "servo 2 (two)" in watch.reaction.reason
    watch = Watch(profile, {1: "one"}, {1: 70})
    for time in (0.0, 0.1):
        assert watch.reaction is None
        watch.answered(1, time, {}, ("electrical shock",))
    assert watch.reaction.how == "release"
