"""Servos that turn against their joint or have their zero elsewhere: on the bus, in tables, in LeRobot's calibration file."""

import csv
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from tests.device.servos import arm, robot
from workbench.device import export, read_tables
from workbench.device.bus.setup import wanted_registers
from workbench.device.bus.survey import survey
from workbench.device.play import PlayOptions, perform
from workbench.device.play.wiggle import Answers, wiggle
from workbench.device.tables.table_file import read_table_file, table_file
from workbench.files import InputError
from workbench.motion import Motion
from workbench.motion.mtn import load_mtn
from workbench.robot import load_model, save_model
from workbench.robot.mounting import JointServo, Mounting
from workbench.robot.servo_profile_file import servo_profile
from workbench.simulation.virtual_robot import VirtualRobot

ANGLES = np.radians([[0.0, 0, 0], [12, -10, 8], [-6, 9, -12], [0, 0, 0]])
MOTION = Motion("wave", 0.2 * np.arange(4), ("one", "three", "two"), ANGLES)
MOUNTED = {"two": Mounting(-1, math.radians(20)), "three": Mounting(offset=math.radians(-15))}


def mounted(folder):
    return replace(arm(folder), mountings=MOUNTED)


def test_positions_and_limits_of_a_servo_that_turns_against_its_joint():
    servo = JointServo(servo_profile("XL-330"), Mounting(-1, math.radians(45)))
    assert servo.zero == 2048 + 512
    assert servo.position(math.radians(10)) == 2560 - 114
    assert servo.angle(2560 - 114) == pytest.approx(math.radians(10), abs=servo.profile.count / 2)
    assert servo.limits(math.radians(-90), math.radians(30)) == (2560 - 341, 2560 + 1024)
    assert servo.limits(-math.inf, math.inf) == (0, 4095)
    assert servo.from_servo(servo.to_servo(0.3)) == pytest.approx(0.3)
    with pytest.raises(InputError, match=r"-170.0 deg is count 4494; expected 0 to 4095"):
        servo.position(math.radians(-170))


@pytest.mark.parametrize("family", ["AX-12A", "XL-330", "STS3215"])
def test_a_motion_moves_joints_as_the_model_says(tmp_path, family):
    """The same joint log, whichever way the servos are mounted; the servos' own angles differ."""
    logs = []
    for model in (arm(tmp_path), mounted(tmp_path)):
        r = robot(family, model=model)
        profile = servo_profile(family)
        start = {"one": 0.2, "two": 0.1, "three": -0.2}
        for joint, angle in start.items():
            there = JointServo(profile, model.mountings.get(joint, Mounting())).to_servo(angle)
            r.body.turn(model.bus_ids[joint], there)
        bus = r.bus()
        found = survey(bus, r.model, ids=())
        by_joint = {s.joint: s.angle for s in found.found.values()}
        assert by_joint == pytest.approx(start, abs=0.003)
        log = tmp_path / f"{len(logs)}.csv"
        perform(bus, found, MOTION.commands(1), log, lambda: "", PlayOptions(rest=0.2))
        sent = {j: [v for _, a, v in s.written if a == s.profile.by_name["goal_position"].address] for j, s in r.servos.items()}
        logs.append((list(csv.DictReader(log.read_text().splitlines())), sent))
    (plain, sent_plain), (other, sent_other) = logs
    goals = {j: np.degrees(ANGLES[:, k]) for k, j in enumerate(MOTION.joints)}
    for rows in (plain, other):
        for joint in MOTION.joints:
            for column in ("goal", "position"):
                values = [float(row[f"{column}.{joint}"]) for row in rows if row[f"{column}.{joint}"]]
                assert (min(values), max(values)) == pytest.approx((goals[joint].min(), goals[joint].max()), abs=0.8)
    assert sent_plain["one"] == sent_other["one"]
    zero = JointServo(servo_profile(family), MOUNTED["two"]).zero
    centre = servo_profile(family).centre
    ends = slice(-6, None)
    assert [zero - (c - centre) for c in sent_plain["two"]][ends] == sent_other["two"][ends]


def test_the_emulated_robot_has_servos_mounted_as_its_model_says(tmp_path):
    model = mounted(tmp_path)
    virtual = VirtualRobot(model, "fixed")
    profile = servo_profile("AX-12A")
    two = virtual.servos["two"]
    two._refresh(0)
    assert two["present_position"] == pytest.approx(JointServo(profile, MOUNTED["two"]).zero, abs=1)


def test_tables_hold_the_servos_counts_and_read_back_as_the_joints(tmp_path):
    model = mounted(tmp_path)
    plain = export(MOTION, arm(tmp_path), tmp_path / "plain")
    made = export(MOTION, model, tmp_path / "mounted")
    assert not plain.no_binary
    assert not made.no_binary
    assert np.array_equal(read_tables(tmp_path / "plain").goals, read_tables(tmp_path / "mounted").goals)
    assert "# mounted: three +1 461, two -1 580" in (tmp_path / "mounted" / "pos.txt").read_text()
    ids = {i: j for j, i in model.bus_ids.items()}
    servo, joint = (read_table_file(tmp_path / f / "motion.table", ids) for f in ("mounted", "plain"))
    k = joint.table.joints.index("two")
    assert np.array_equal(servo.table.goals[:, k], 580 - (joint.table.goals[:, k] - 512))
    bounds, plain_bounds = servo.joints[k], joint.joints[k]
    assert bounds.neutral == 580
    assert (bounds.low, bounds.high) == (max(580 - (plain_bounds.high - 512), 0), min(580 - (plain_bounds.low - 512), 1023))
    assert table_file(MOTION.as_table(), model).joints[k].direction == -1


def test_a_goal_that_the_mounted_servo_cannot_hold_is_refused(tmp_path):
    model = replace(arm(tmp_path), mountings={"two": Mounting(offset=math.radians(148))})
    with pytest.raises(InputError, match="pose 1, joint two: goal position 1044 is outside 0 to 1023"):
        export(MOTION, model, tmp_path / "out")


def test_angle_limits_are_turned_round_with_the_servo(tmp_path):
    model, profile = arm(tmp_path), servo_profile("XL-330")
    plain = wanted_registers(model, "two", profile)
    turned = wanted_registers(replace(model, mountings={"two": Mounting(-1)}), "two", profile)
    assert turned["cw_angle_limit"] == max(4096 - plain["ccw_angle_limit"], 0)
    assert turned["ccw_angle_limit"] == min(4096 - plain["cw_angle_limit"], 4095)


def test_a_wiggle_goes_the_joints_positive_way(tmp_path):
    r = robot("XL-330", model=replace(arm(tmp_path), mountings={"two": Mounting(-1)}))
    bus = r.bus()
    servo = next(s for s in survey(bus, r.model, ids=()).found.values() if s.joint == "two")
    before = len(r.servos["two"].written)
    assert math.degrees(wiggle(bus, servo).went) == pytest.approx(3.0, abs=0.2)
    goal = r.servos["two"].profile.by_name["goal_position"].address
    assert min(v for _, a, v in r.servos["two"].written[before:] if a == goal) == 2048 - 34


def test_answers_become_the_keys_that_put_it_right():
    ids = {"one": 1, "two": 2, "three": 3}
    answers = Answers()
    for joint, answer in (("one", ""), ("two", "three -"), ("three", "two")):
        answers.take(joint, answer, ids)
    assert answers.corrections(ids, {}) == {"bus_ids": {"one": 1, "three": 2, "two": 3}, "direction": {"three": -1}}
    turned = Answers()
    turned.take("two", "-", ids)
    assert turned.corrections(ids, {"two": Mounting(-1), "one": Mounting(-1)}) == {"direction": {"one": -1}}
    twice = Answers()
    twice.take("one", "two", ids)
    twice.take("two", "two", ids)
    with pytest.raises(InputError, match="one joint moved for several servos"):
        twice.corrections(ids, {})


def test_a_model_file_keeps_mountings(tmp_path):
    saved = replace(mounted(tmp_path), mountings=MOUNTED | {"one": Mounting(zero=580, homing=-17)})
    again = load_model(save_model(saved, tmp_path / "model.yaml"))
    for joint, mounting in saved.mountings.items():
        profile = servo_profile("AX-12A")
        assert JointServo(profile, again.mountings[joint]).zero == JointServo(profile, mounting).zero
        assert (again.mountings[joint].direction, again.mountings[joint].homing) == (mounting.direction, mounting.homing)


CALIBRATION = {
    "one": {"id": 4, "drive_mode": 0, "homing_offset": -1470, "range_min": 758, "range_max": 3292},
    "two": {"id": 5, "drive_mode": 1, "homing_offset": 12, "range_min": 848, "range_max": 3248},
    "three": {"id": 6, "drive_mode": 0, "homing_offset": 0, "range_min": 0, "range_max": 4095}}


def with_calibration(folder, calibration=CALIBRATION, more=""):
    arm(folder)
    (folder / "so.json").write_text(json.dumps(calibration))
    (folder / "model.yaml").write_text(
        f"format: 1\nrobot: {{model: arm.sdf, base: trunk, calibration: so.json{more}}}\nservos: {{model: STS3215}}\n")
    return load_model(folder / "model.yaml")


def test_lerobots_calibration_gives_ids_zeros_and_directions(tmp_path):
    model = with_calibration(tmp_path)
    assert model.bus_ids == {"one": 4, "two": 5, "three": 6}
    profile = servo_profile("STS3215")
    assert {j: JointServo(profile, m).zero for j, m in model.mountings.items()} == {"one": 2025, "two": 2048, "three": 2048}
    assert {j: m.direction for j, m in model.mountings.items()} == {"one": 1, "two": -1, "three": 1}
    assert model.servo("one").stall_torque == pytest.approx(profile.nominal["stall_torque"].value)
    r = robot("STS3215", model=model)
    r.servos["one"]["homing_offset"] = 1470 | 1 << 11
    (problem,) = survey(r.bus(), r.model, ids=()).problems()
    assert problem == "servo 5 (two): homing_offset is 0, the calibration says 12; its angles are not those of the calibration"


@pytest.mark.parametrize(("change", "said"), [
    ({"elbow": CALIBRATION["one"]}, "motor elbow: the model has no such joint"),
    ({"one": {"id": 4}}, "motor one: expected whole numbers for drive_mode, homing_offset, id, range_max, range_min"),
    ({"one": CALIBRATION["one"] | {"range_min": 3300}}, "motor one: expected range_min below range_max"),
    ({"one": CALIBRATION["one"] | {"id": 5}}, "motor two: expected .* an id of its own"),
])
def test_a_wrong_calibration_is_named_with_its_place(tmp_path, change, said):
    with pytest.raises(InputError, match=said):
        with_calibration(tmp_path, CALIBRATION | change)


@pytest.mark.parametrize(("keys", "said"), [
    ("direction: {two: 2}", "robot.direction.two: expected 1 or -1, got 2"),
    ("offset: {two: 400}", "robot.offset.two: expected degrees from -360 to 360"),
    ("offset: {wing: 4}", "robot.offset.wing: the model has no joint 'wing'"),
    ("homing: {two: much}", "robot.homing.two: expected a whole number of counts"),
    ("calibration: so.json, bus_ids: {two: 1}", "robot.bus_ids: is in the file that `calibration` names"),
])
def test_wrong_keys_are_named(tmp_path, keys, said):
    arm(tmp_path)
    (tmp_path / "so.json").write_text(json.dumps(CALIBRATION))
    (tmp_path / "model.yaml").write_text(f"format: 1\nrobot: {{model: arm.sdf, base: trunk, {keys}}}\n")
    with pytest.raises(InputError, match=said):
        load_model(tmp_path / "model.yaml")


def test_a_robotis_file_is_read_by_the_mounting(tmp_path):
    from tests.motion.test_mtn import GOOD, write

    plain = load_mtn(write(tmp_path, GOOD)).motion("go", {"b": 1, "a": 2})
    turned = load_mtn(write(tmp_path, GOOD)).motion("go", {"b": 1, "a": 2}, {"a": Mounting(-1)})
    k = plain.joints.index("a")
    assert np.allclose(turned.angles[:, k], -plain.angles[:, k])
    assert np.abs(plain.angles[:, k]).max() > 0
