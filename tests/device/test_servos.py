"""What hangs on the bus against the model, as a verb and as evidence."""

from dataclasses import replace

import pytest

from tests.command import refused
from tests.device.servos import FAMILIES, arm, robot
from workbench.device.bus import BusError
from workbench.device.bus.setup import set_id, set_up, wider_limits
from workbench.device.bus.survey import survey
from workbench.device.virtual import VirtualServo
from workbench.files import InputError
from workbench.robot import bus_ids
from workbench.robot.servo_registers import load_registers, save_registers


def test_a_healthy_robot():
    r = robot(angles={"flm": 0.3})
    found = survey(r.bus(), r.model)
    assert found.problems() == ()
    assert len(found.found) == 15
    servo = found.found[7]
    assert (servo.joint, servo.model, servo.voltage, servo.temperature) == ("flm", "AX-12A", 11.1, 30)
    assert servo.angle == pytest.approx(0.3, abs=0.003)
    assert found.registers().departures(r.model) == ()


def test_strangers_and_missing():
    r = robot()
    VirtualServo(r.wire, FAMILIES["AX-12A"][0], 42, r.body)
    r.servos["tail"].power(False)
    found = survey(r.bus(), r.model)
    assert found.missing == ("tail",)
    assert found.found[42].joint is None


def test_registers_that_differ_are_evidence(tmp_path):
    """A knee with slope 64 is known before the first step."""
    r = robot()
    knee, hip, ankle = r.servos["flm"], r.servos["frt"], r.servos["blb"]
    knee["cw_compliance_slope"] = knee["ccw_compliance_slope"] = 64
    hip["cw_compliance_margin"] = hip["ccw_compliance_margin"] = 4
    ankle["torque_limit"] = 512
    found = survey(r.bus(), r.model, ids=())
    path = save_registers(found.registers(), tmp_path / "registers.yaml")
    registers = load_registers(path, r.model)
    assert registers == found.registers() or registers.joints == found.registers().joints
    effects = {(d.effect.effect, d.joint): d.effect.parameters for d in registers.departures(r.model)}
    assert effects["servo_gain", "flm"] == {"ratio": 0.5}
    assert effects["dead_band", "frt"]["margin"] == pytest.approx(3 * 300 / 1023)
    assert effects["torque_ceiling", "blb"]["torque"] == pytest.approx(1.5 * 11.1 / 12 * 512 / 1023)
    assert len(effects) == 3
    said = [str(d) for d in registers.departures(r.model)]
    assert "blb: torque_limit is 512, the model has 1023 (torque_ceiling, torque 0.694)" in said


def test_limits_wider_than_the_model_are_told(tmp_path):
    r = robot(model=arm(tmp_path))
    bus = r.bus()
    list(set_up(bus, r.model, survey(bus, r.model, ids=())))
    assert wider_limits(r.model, survey(bus, r.model, ids=())) == ()
    r.servos["two"]["ccw_angle_limit"] = 1023
    r.servos["three"]["cw_angle_limit"] += 30  # narrower: the controller will not walk with it
    (line,) = wider_limits(r.model, survey(bus, r.model, ids=()))
    assert line.startswith("servo 2 (two): turns from ")
    assert " to 1023, the model's joint from " in line


def test_a_robot_without_bus_ids_takes_nobody_elses(tmp_path):
    with pytest.raises(InputError, match="joint one has no bus ID; give them as"):
        bus_ids(replace(arm(tmp_path), bus_ids={}))
    assert bus_ids(replace(robot().model, bus_ids={}))["flm"] == 7  # the puppy's, by name


def test_gains_of_other_families(tmp_path):
    r = robot("XL-330", model=arm(tmp_path))
    r.servos["two"]["position_p_gain"] = 800
    (departure,) = survey(r.bus(), r.model, ids=()).registers().departures(r.model)
    assert (departure.joint, departure.key, departure.effect.effect) == ("two", "proportional_gain", "servo_gain")
    assert departure.effect.parameters["ratio"] == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize(("old", "new", "said"), [
    ("format: 1", "format: 3", "format: expected 1"),
    ("  flm:", "  wing:", "joints.wing: the robot has no such joint"),
    ("punch: 32", "punch: soft", "registers.punch: expected a whole number"),
    ("punch: 32", "bite: 32", "registers.bite: AX-12A has no such register"),
    ("profile: AX-12A", "profile: SG90", "no servo profile for 'SG90'"),
])
def test_a_wrong_evidence_file_is_named_with_its_place(tmp_path, old, new, said):
    r = robot()
    path = save_registers(survey(r.bus(), r.model, ids=()).registers(), tmp_path / "registers.yaml")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=said):
        load_registers(path, r.model)


@pytest.mark.parametrize("family", FAMILIES)
def test_write_sets_delay_and_limits_and_nothing_else(tmp_path, family):
    r = robot(family, model=arm(tmp_path))
    for servo in r.servos.values():
        servo["return_delay_time"] = 250
    bus = r.bus()
    before = {j: bytes(s._table) for j, s in r.servos.items()}
    lines = list(set_up(bus, r.model, survey(bus, r.model, ids=())))
    assert sum("return_delay_time 250 -> 0" in line for line in lines) == 3
    frames = r.model.kinematics.frames
    for joint, servo in r.servos.items():
        assert servo["return_delay_time"] == 0
        for name, angle in (("cw_angle_limit", frames[joint].lower), ("ccw_angle_limit", frames[joint].upper)):
            wanted = bus.profile.centre + angle / bus.profile.count
            assert servo[name] == pytest.approx(min(max(wanted, 0), bus.profile.largest_position), abs=0.51)
        touched = {n for n in servo.profile.by_name if servo[n] != _read(before[joint], servo, n)}
        assert touched <= {"return_delay_time", "cw_angle_limit", "ccw_angle_limit"}
    assert list(set_up(bus, r.model, survey(bus, r.model, ids=()))) == []


@pytest.mark.parametrize("family", FAMILIES)
def test_a_servo_that_answers_reads_only_is_written_and_then_answers_all(tmp_path, family):
    r = robot(family, model=arm(tmp_path))
    r.servos["two"]["status_return_level"] = 1
    for servo in r.servos.values():
        servo["return_delay_time"] = 250
    bus = r.bus()
    lines = list(set_up(bus, r.model, survey(bus, r.model, ids=())))
    assert "servo 2 (two): status_return_level 1 -> 2" in lines
    assert [s["return_delay_time"] for s in r.servos.values()] == [0, 0, 0]
    assert r.servos["two"]["status_return_level"] == 2
    assert list(set_up(bus, r.model, survey(bus, r.model, ids=()))) == []


def _read(table, servo, name):
    register = servo.profile.by_name[name]
    return int.from_bytes(table[register.address:register.address + register.size], "little")


def test_write_refuses_a_robot_with_torque(tmp_path):
    r = robot(model=arm(tmp_path))
    r.servos["two"]["torque_enable"] = 1
    bus = r.bus()
    with pytest.raises(BusError, match=r"servo 2 \(two\): its torque is on; switch the robot off and on"):
        list(set_up(bus, r.model, survey(bus, r.model, ids=())))


@pytest.mark.parametrize("family", FAMILIES)
def test_an_id_is_set_and_answers(tmp_path, family):
    model = arm(tmp_path)
    r = robot(family, model=model, joints=["one"])
    bus = r.bus()
    found = survey(bus, r.model, ids=(1,))
    assert set_id(bus, r.model, found, "three") == "servo 1 is now 3 (three)"
    assert r.servos["one"].ident == 3
    assert bus.exists(1) is None
    assert set_id(bus, r.model, survey(bus, r.model, ids=(1, 3)), "three") == "servo 3: has the ID of three already"
    with pytest.raises(InputError, match="the robot has no joint 'wing'"):
        set_id(bus, r.model, found, "wing")


def test_an_id_is_set_of_one_servo_alone(tmp_path):
    r = robot(model=arm(tmp_path))
    bus = r.bus()
    with pytest.raises(BusError, match="3 IDs answer; expected one servo alone on the bus"):
        set_id(bus, r.model, survey(bus, r.model, ids=()), "three")


def test_the_verb_refuses_in_one_line(capsys):
    line = refused(capsys, "servos", "--port", "/dev/ttyNONE")
    assert "port /dev/ttyNONE: there is no such port" in line
    line = refused(capsys, "play", "data/robotis_walk.csv", "--port", "/dev/ttyNONE")
    assert "port /dev/ttyNONE: there is no such port" in line
    assert "expected either MOTION or --finish" in refused(capsys, "play", "--port", "/dev/ttyNONE")
