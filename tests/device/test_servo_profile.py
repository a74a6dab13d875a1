"""Servo families as data."""

import math
from dataclasses import replace

import pytest

from workbench.device.virtual import AX12A, STS3215, XL330, XL430
from workbench.files import InputError
from workbench.motion import load_motion
from workbench.robot import ServoConstants, data_file, puppy_model
from workbench.robot.servo_profile_file import load_profile, model_name, servo_profile, servo_profiles

VIRTUAL = {"AX-12A": AX12A, "XL-330": XL330, "XL-430": XL430, "STS3215": STS3215}


def test_the_shipped_families():
    assert set(servo_profiles()) == {"AX-12A", "MX-28", "XL-330", "XL-430", "STS3215"}
    constants = servo_profile("AX-12A").constants()
    assert replace(constants, sd=(), torque_tolerance=None, back_emf_tolerance=None) == ServoConstants()
    assert constants.share_known("torque_at_full_duty") == constants.share_known("back_emf") == 0.5
    for key in ("supply_voltage", "no_load_speed", "coulomb_friction", "viscous_friction", "reflected_inertia"):
        assert constants.share_known(key) == pytest.approx(ServoConstants().share_known(key), abs=0.01), key
    assert constants.share_known("compliance_slope") == 0
    assert servo_profile("mx64").name == "MX-28"
    assert servo_profile("XL330-M077-T").name == "XL-330"
    assert model_name(1200, 2) == "XL330-M288-T"
    assert model_name(4711, 1) == "unknown model 4711"
    with pytest.raises(InputError, match=r"no servo profile for 'SG90'; expected one of AX-12A"):
        servo_profile("SG90")


@pytest.mark.parametrize("name", VIRTUAL)
def test_registers_lie_where_the_virtual_servos_have_them(name):
    """The virtual servos' tables were written from the manuals apart from the profiles."""
    profile, table = servo_profile(name), VIRTUAL[name].by_name
    for register in profile.registers.values():
        if register.name in table:
            assert (register.address, register.size) == (table[register.name].address, table[register.name].size), register.name
            assert table[register.name].eeprom == (register.address < profile.eeprom_below), register.name
    assert {"goal_position", "moving_speed", "present_position", "id"} <= set(profile.registers) & set(table)
    rates = profile.bit_rates
    assert {v: VIRTUAL[name].bit_rate(v) for v in rates} == pytest.approx(rates, rel=0.022)
    assert profile.count == pytest.approx(VIRTUAL[name].span / VIRTUAL[name].counts)
    assert profile.speed_unit == pytest.approx(VIRTUAL[name].speed_unit, rel=1e-5)


def test_counts_are_those_of_the_firmware_tables():
    profile, model = servo_profile("AX-12A"), puppy_model()
    motion = load_motion(data_file("robotis_walk.csv"), model)
    table, commands = motion.as_table(), motion.commands()
    assert [[profile.position(a) for a in row] for row in commands.goals.tolist()] == table.goals.tolist()
    assert [[profile.speed(s) if s else 0 for s in row] for row in commands.speeds.tolist()] == table.speeds.tolist()


def test_numbers_with_a_sign():
    ax, xl, sts = (servo_profile(n).registers for n in ("AX-12A", "XL-330", "STS3215"))
    assert ax["present_load"].decode(bytes([0x64, 0x04])) == -100
    assert xl["present_position"].decode(bytes([0xFF, 0xFF, 0xFF, 0xFF])) == -1
    assert xl["goal_position"].encode(-1) == b"\xff\xff\xff\xff"
    assert sts["present_speed"].decode(sts["goal_position"].encode(-300)) == -300
    for register in (ax["present_load"], xl["present_load"], sts["present_speed"]):
        for value in (-700, -1, 0, 1, 512):
            assert register.decode(register.encode(value)) == value
    with pytest.raises(ValueError, match="goal_position: 70000 does not fit into 2 bytes"):
        ax["goal_position"].encode(70000)
    with pytest.raises(InputError, match=r"160\.0 deg is count 1058; expected 0 to 1023"):
        servo_profile("AX-12A").position(math.radians(160))


def test_the_slope_has_seven_effective_values():
    law = servo_profile("AX-12A").law["compliance_slope"]
    assert [law.value(c) for c in (0, 3, 4, 7, 8, 31, 32, 63, 64, 127, 128, 254)] == [2, 2, 4, 4, 8, 16, 32, 32, 64, 64, 128, 128]


@pytest.mark.parametrize(("old", "new", "said"), [
    ("format: 1", "format: 2", "format: expected 1"),
    ("protocol: 1", "protocol: 3", "protocol: expected 1 or 2"),
    ("goal_position: [30, 2]", "goal_position: [30, 3]", r"registers.goal_position: expected \[address, size\]"),
    ("  goal_position: [30, 2]\n", "", "registers.goal_position: is missing"),
    ("  goal_position: [30, 2]\n  moving_speed: [32, 2]\n", "", "registers.goal_position, moving_speed: are missing"),
    ("present_load: [40, 2, 10]", "present_load: [40, 2, 17]", "registers.present_load: expected `two` or a bit"),
    ("registers: [punch]", "registers: [bite]", "law.punch.registers: expected names of registers"),
    ("supply: [9, 12.6]", "supply: [12, 9]", r"supply: expected \[lowest, highest\]"),
    ("punch: {value: 32, sd: 0}", "punch: {value: 32}", "nominal.punch.sd: is missing"),
    ("  punch: {value: 32, sd: 0}\n", "", "nominal: expected compliance_slope"),
    ("  stall_torque: {value: 1.5, sd: 0} ", "  #", "nominal.stall_torque: is missing"),
    ("full_torque: 1023", "full_torque: 1023\ncolour: red", "colour: unknown key"),
])
def test_a_profile_that_is_wrong_is_named_with_its_place(tmp_path, old, new, said):
    text = data_file("servos/ax12a.yaml").read_text()
    assert old in text
    path = tmp_path / "servo.yaml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=rf"servo\.yaml: {said}"):
        load_profile(path)


def test_a_feetech_ramps_its_goals_and_rubs_under_load():
    servo = servo_profile("STS3215").constants()
    assert servo.ramp == pytest.approx(5.1, abs=0.1)
    assert servo.goal_delay == 0.02
    assert {servo.share_known(k) for k in ("goal_delay", "minimum_duty")} == {0.5}
    assert servo.share_known("load_friction") == pytest.approx(0.6)
    assert servo.punch_duty == 0.015
    assert servo.margin == pytest.approx(2 * math.pi / 4096, rel=1e-3)
