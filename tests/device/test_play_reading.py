"""How often joints are read through adapters of every latency, and that the joint log says nothing that was not read."""

import csv
import os
import pty

import numpy as np
import pytest

from tests.device.servos import arm, robot
from tests.device.test_play import MOTION
from workbench.device.bus import BusError, open_port
from workbench.device.bus.survey import survey
from workbench.device.controller.serial_line import SerialLine
from workbench.device.play import PlayOptions, perform, reading_plan
from workbench.device.virtual import seconds
from workbench.files import InputError
from workbench.motion import Motion
from workbench.robot import RobotModel

OPTIONS = PlayOptions(rest=0.3)


def chain(folder, count):
    """A robot of so many joints in a row."""
    inertial = "<inertial><mass>0.1</mass><inertia><ixx>1e-4</ixx><iyy>1e-4</iyy><izz>1e-4</izz></inertia></inertial>"
    parts = [f"<link name='l0'>{inertial}</link>"]
    parts += [f"<link name='l{k}'><pose>0.1 0 0 0 0 0</pose>{inertial}</link><joint name='j{k}' type='revolute'>"
              f"<parent>l{k - 1}</parent><child>l{k}</child><axis><xyz>0 1 0</xyz></axis></joint>" for k in range(1, count + 1)]
    path = folder / "chain.sdf"
    path.write_text(f"<sdf version='1.9'><model name='m'>{''.join(parts)}</model></sdf>")
    return RobotModel(description=str(path), base="l0", bus_ids={f"j{k}": k for k in range(1, count + 1)})


def triangle(joints, speed=200.0, dwell=0.1, poses=8):
    """Corners as sharp as a walk's: to and fro at a speed [deg/s]."""
    shape = np.array([0.0, 1, 0, -1] * (poses // 4) + [0]) * speed * dwell
    return Motion("walk", np.arange(poses + 1) * dwell, joints, np.radians(np.outer(shape, np.ones(len(joints)))))


def played(tmp_path, r, motion, cycles=1):
    """How it went, the error of each position in the motion's rows of the log [deg], and how many of their cells are filled."""
    bus = r.bus()
    found = survey(bus, r.model, ids=())
    truth, times, ids = [], [], r.model.bus_ids
    joints = list(motion.joints)

    def watch():
        times.append(seconds(r.wire.clock.now))
        truth.append([r.body.sense(ids[j], r.wire.clock.now).angle for j in joints])
        r.at(0.002, watch)

    r.at(0.0, watch)
    result = perform(bus, found, motion.commands(cycles), tmp_path / "w.csv", lambda: "", OPTIONS)
    rows = list(csv.DictReader((tmp_path / "w.csv").read_text().splitlines()))
    time = np.array([float(row["time"]) for row in rows])
    inside = (time + result.log_start > result.started) & (time + result.log_start < result.ended)
    positions = np.array([[float(row[f"position.{j}"] or "nan") for j in joints] for row in rows])[inside]
    real = np.degrees([np.interp(time[inside] + result.log_start, times, column) for column in np.array(truth).T]).T
    error = (positions - real)[np.isfinite(positions)]
    return result, error, np.isfinite(positions).mean()


@pytest.mark.parametrize(("latency", "jitter"), [(0.0, 0.0), (0.001, 0.0), (0.002, 0.001), (0.004, 0.002), (0.016, 0.008)])
def test_the_log_is_right_or_blank_at_any_latency(tmp_path, latency, jitter):
    r = robot(model=arm(tmp_path))
    r.port.latency, r.port.jitter = latency, jitter
    result, error, filled = played(tmp_path, r, triangle(("one", "two", "three")), 2)
    assert result.stopped == ""
    assert np.sqrt(np.mean(error ** 2)) < 0.3
    assert np.abs(error).max() < 0.55
    assert filled > 0.1
    assert min(result.rates.values()) > min(50.0, 0.6 / (3 * (latency + 0.0003)))


@pytest.mark.parametrize(("family", "count", "least"), [("AX-12A", 15, 50), ("XL-430", 12, 200), ("STS3215", 6, 200),
                                                    ("XL-330", 12, 200), ("MX-28", 12, 100)])
def test_joints_are_read_as_often_as_the_bus_allows(tmp_path, family, count, least):
    """Through an adapter of 1 ms, at 1 Mbit/s."""
    model = chain(tmp_path, count)
    r = robot(family, model=model)
    r.port.latency = 0.001
    result, error, _ = played(tmp_path, r, triangle(model.joints))
    assert result.stopped == ""
    assert min(result.rates.values()) > least
    assert np.sqrt(np.mean(error ** 2)) < 0.3


@pytest.mark.parametrize("family", ["XL-430", "STS3215"])
@pytest.mark.parametrize("first", [True, False])
def test_a_servo_that_is_silent_is_found_among_those_asked_at_once(tmp_path, family, first):
    """Whoever answers after it says nothing either, as each waits for the one before."""
    model = chain(tmp_path, 4)
    r = robot(family, model=model)
    silent = "j1" if first else "j3"
    r.at(2.0, lambda: setattr(r.servos[silent], "mute", True))
    result, _, _ = played(tmp_path, r, triangle(model.joints, speed=100.0), 8)
    assert f"({silent}): silent for 0.3 s" in result.stopped
    assert result.ended < 2.5


def test_the_patience_is_set_by_the_first_answers(tmp_path):
    r = robot(model=arm(tmp_path))
    r.port.latency, r.port.jitter = 0.016, 0.016
    bus = r.bus()
    found = survey(bus, r.model, ids=())
    assert found.problems() == ()
    assert 12 < bus.port.patience < 40
    assert found.latency > 0.004
    assert not bus.retries


def test_a_stray_byte_at_the_turn_of_the_bus_is_no_second_servo(tmp_path):
    r = robot(model=arm(tmp_path))
    talk = r.wire.talk

    def noisy(talker, values, rate, starts):
        if talker in r.servos.values():
            first = starts if isinstance(starts, int) else starts[0]
            talk(r.body, b"\x00", rate, first - 720 - 10)
        return talk(talker, values, rate, starts)

    r.wire.talk = noisy
    bus = r.bus()
    assert survey(bus, r.model, ids=()).doubled == ()


def test_a_motion_that_leaves_no_time_to_watch_is_refused_before_it_begins(tmp_path):
    r = robot(model=chain(tmp_path, 15))
    r.port.latency = 0.016
    bus = r.bus()
    found = survey(bus, r.model, ids=())
    quick = triangle(r.model.joints, dwell=0.02)
    with pytest.raises(InputError, match=r"each servo would be read only every .* answers come 16 ms late.*latency_timer"):
        perform(bus, found, quick.commands(20), tmp_path / "w.csv", lambda: "", OPTIONS)
    assert not any(a in (24, 30) for s in r.servos.values() for _, a, _ in s.written)
    plan = reading_plan(bus, 15, triangle(r.model.joints, dwell=0.5, speed=20.0).commands(2))
    assert plan.longest < 0.3
    assert "each joint is read only every 2" in plan.warning
    bus.latency = 0.0
    assert reading_plan(bus, 3, MOTION.commands(2)).warning == ""


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals")
def test_a_port_has_one_owner():
    """The second one is told so, whichever way it comes."""
    ours, theirs = pty.openpty()
    name = os.ttyname(theirs)
    port = open_port(name, 1_000_000)
    try:
        for again in (lambda: open_port(name, 1_000_000), lambda: SerialLine(name, 57_600)):
            with pytest.raises(BusError, match=f"port {name}: another program has it; ports of this machine"):
                again()
    finally:
        port.closePort()
        os.close(ours)
        os.close(theirs)


def test_a_late_answer_has_no_time(tmp_path):
    """A computer that stood still between a question and its packet does not know when the servo felt what it says."""
    r = robot(model=arm(tmp_path))
    r.port.latency = 0.001
    write, count = r.port.writePort, []

    def held(packet):
        count.append(1)
        if len(count) % 40 == 0:
            r.port.pause(0.03)
        return write(packet)

    r.port.writePort = held
    result, error, filled = played(tmp_path, r, triangle(("one", "two", "three")), 2)
    assert result.stopped == ""
    assert np.abs(error).max() < 0.55
    assert filled > 0.1
