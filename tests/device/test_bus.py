"""The strict bus, on virtual servos of three families: what they answer, and each fault of the SDK as one line."""

from dataclasses import replace

import pytest

from tests.device.servos import FAMILIES, arm, robot
from workbench.device.bus import Bus, BusError, BusOptions, NoAnswerError, PortGoneError, open_port
from workbench.device.bus.survey import survey
from workbench.device.virtual import Protocol1, VirtualServo, bit_flips
from workbench.robot import BUS_IDS
from workbench.robot.servo_profile_file import servo_profile

FLM = BUS_IDS["flm"]


@pytest.mark.parametrize("family", FAMILIES)
def test_read_and_write(family):
    r = robot(family, {"flm": 0.3}, ["flm", "frm"])
    bus, profile = r.bus(), servo_profile(family)
    assert profile.angle(bus.read(FLM, "present_position")["present_position"]) == pytest.approx(0.3, abs=profile.count)
    bus.write(FLM, {"return_delay_time": 5, "cw_angle_limit": 200})
    assert (r.servos["flm"]["return_delay_time"], r.servos["flm"]["cw_angle_limit"]) == (5, 200)
    assert r.servos["frm"]["return_delay_time"] == 0
    assert bus.read(FLM, "present_voltage")["present_voltage"] / 10 == FAMILIES[family][1]
    more = {"goal_time": 0} if "goal_time" in profile.registers else {}
    goals = {FLM: profile.position(-0.2), BUS_IDS["frm"]: profile.position(0.4)}
    bus.sync_write({i: {"goal_position": g, "moving_speed": 77} | more for i, g in goals.items()})
    bus.pause(0.01)
    assert r.servos["flm"]["goal_position"] == profile.position(-0.2)
    assert r.servos["frm"]["goal_position"] == profile.position(0.4)
    assert r.servos["frm"]["moving_speed"] == 77
    assert bus.alarms[FLM] == ()


@pytest.mark.parametrize("family", FAMILIES)
def test_alarms_come_beside_good_answers(family):
    r = robot(family, joints=["flm"])
    bus = r.bus()
    r.servos["flm"].temperature = 90
    assert bus.read(FLM, "present_temperature") == {"present_temperature": 90}
    assert bus.alarms[FLM] == ("heat",)


def test_a_refused_value_names_servo_joint_and_register():
    bus = robot(joints=["flm"]).bus()
    with pytest.raises(BusError, match=r"^servo 7 \(flm\), register temperature_limit: refused: value out of range$") as e:
        bus.write(FLM, {"temperature_limit": 200})
    assert (e.value.servo, e.value.joint, e.value.register) == (7, "flm", "temperature_limit")
    with pytest.raises(BusError, match="register position_p_gain: AX-12A has no such register"):
        bus.read(FLM, "position_p_gain")


def test_a_register_that_does_not_keep_its_value_is_found_by_reading_back():
    r = robot("STS3215", joints=["flm"])
    r.servos["flm"]["lock"] = 1
    bus = r.bus()
    bus.profile = replace(bus.profile, unlock=None)
    with pytest.raises(BusError, match=r"register temperature_limit: (reads 70 after 60 was written|refused)"):
        bus.write(FLM, {"temperature_limit": 60})


def test_an_absent_servo_is_one_line_and_quick():
    bus = robot(joints=["flm"]).bus()
    before = bus.now()
    with pytest.raises(NoAnswerError, match=r"^servo 99, register present_position: no answer in 3 tries$"):
        bus.read(99, "present_position")
    assert bus.now() - before < 0.015, "3 ms and the bytes, three times, and not 34 ms"
    assert bus.exists(99) is None
    assert bus.exists(FLM) == 12


@pytest.mark.parametrize("family", FAMILIES)
def test_an_adapter_that_echoes_is_refused_or_stripped(family):
    r = robot(family, joints=["flm"])
    r.port.echo = True
    with pytest.raises(BusError, match="the adapter echoes its own transmissions"):
        r.bus()
    bus = r.bus(strip_echo=True)
    assert bus.read(FLM, "id") == {"id": FLM}
    with pytest.raises(NoAnswerError):
        bus.read(99, "id")


def test_two_servos_with_one_id_are_told():
    for family in FAMILIES:
        r = robot(family, joints=["flm", "frm"])
        VirtualServo(r.wire, FAMILIES[family][0], BUS_IDS["flm"], r.body, seed=9)
        bus = r.bus()
        assert bus.answers(BUS_IDS["flm"]) == 2
        assert bus.answers(BUS_IDS["frm"]) == 1
        assert bus.answers(99) == 0
        assert any(p.startswith("servo 7: two servos seem to have this ID") for p in survey(bus, r.model, ids=()).problems())


@pytest.mark.parametrize("family", FAMILIES)
def test_two_servos_with_one_id_cost_no_other_its_answer(family):
    """One of the two may still answer when the other has been heard, and would garble the next question."""
    r = robot(family, joints=["flm", "frm"])
    VirtualServo(r.wire, FAMILIES[family][0], BUS_IDS["flm"], r.body, seed=9)["return_delay_time"] = 20
    bus = r.bus(options=BusOptions(tries=1))
    frm, broken = BUS_IDS["frm"], 0
    for _ in range(100):
        try:
            bus.read(FLM, "torque_enable", "present_position")
        except NoAnswerError:
            broken += 1
            assert bus.read(frm, "present_position")["present_position"] > 0
        if bus.group_kind and not bus.read_all([FLM], "torque_enable", "present_position"):
            broken += 1
            assert bus.read(frm, "present_position")["present_position"] > 0
        bus.pause(0.00137)
    assert broken > 50


def test_another_rate_is_found_and_said():
    r = robot()
    for servo in r.servos.values():
        servo["baud_rate"] = 34
    with pytest.raises(BusError, match="no servo answers at 1000000 bit/s, but 15 do at 57600; say --rate 57600"):
        survey(r.bus(), r.model, ids=())
    assert r.port.getBaudRate() == 1_000_000


def test_nobody_at_all():
    r = robot(joints=["flm"])
    r.servos["flm"].power(False)
    with pytest.raises(BusError, match="no servo answers, at 1000000 bit/s or any other; is the servos' power on"):
        survey(r.bus(), r.model, ids=())


def test_a_pulled_plug_is_one_line_and_the_port_usable_again():
    r = robot(joints=["flm"])
    bus = r.bus()
    for action in (lambda: bus.read(FLM, "id"), lambda: bus.sync_write({FLM: {"torque_enable": 1}}), lambda: bus.release([FLM])):
        r.port.unplugged = True
        with pytest.raises(PortGoneError, match=r"the adapter has disconnected .*; reconnect it"):
            action()
        r.port.unplugged = False
        assert bus.read(FLM, "id") == {"id": FLM}, "the SDK alone says busy for ever"


def test_one_percent_of_answer_bytes_flipped():
    """Each read is right or asked again; three tries leave 0.05 % without an answer (8 % of answers are broken)."""
    r = robot(joints=["flm"])
    bus = r.bus(options=BusOptions(tries=5))
    r.wire.from_servos = bit_flips(0.01, seed=3)
    for _ in range(800):
        assert bus.read(FLM, "present_position")["present_position"] == 512
    assert 40 < bus.retries[FLM] < 160


def test_an_answer_of_another_length_is_no_answer():
    """The SDK hands over whatever number of bytes came."""
    r = robot(joints=["flm"])
    bus = r.bus()
    servo = r.servos["flm"]
    servo.profile = replace(servo.profile, protocol=Short())
    with pytest.raises(NoAnswerError, match="only broken answers in 3 tries"):
        bus.read(FLM, "present_position")


class Short(Protocol1):
    """A servo whose answers lack a byte."""

    def status(self, servo, error, parameters):
        return super().status(servo, error, parameters[:1])


def test_sync_write_asks_for_neighbours():
    bus = robot(joints=["flm"]).bus()
    with pytest.raises(ValueError, match="torque_enable and goal_position do not lie side by side"):
        bus.sync_write({FLM: {"torque_enable": 1, "goal_position": 3}})


def test_many_servos_need_several_packets():
    r = robot("XL-330", joints=["flm"])
    for k in range(20, 60):
        VirtualServo(r.wire, FAMILIES["XL-330"][0], k, r.body)
    bus = r.bus()
    bus.sync_write({k: {"goal_position": 1000 + k, "moving_speed": 5} for k in range(20, 60)})
    bus.pause(0.02)
    assert [s["goal_position"] for s in r.wire.servos[1:]] == [1000 + k for k in range(20, 60)]


def test_a_port_that_is_not_there():
    with pytest.raises(BusError, match=r"port /dev/ttyNONE: there is no such port; ports of this machine: "):
        open_port("/dev/ttyNONE", 1_000_000)
    with pytest.raises(BusError, match="dynamixel-sdk has no bit rate of 123456"):
        open_port("/dev/ttyNONE", 123_456)


def test_a_real_port(tmp_path):
    """pyserial, termios and the SDK together, on a pseudo terminal: silence is silence, and the port can be opened again."""
    import os
    import pty

    master, slave = pty.openpty()
    name = os.ttyname(slave)
    for _ in range(2):
        port = open_port(name, 1_000_000)
        bus = Bus(port, servo_profile("AX-12A"))
        with pytest.raises(NoAnswerError):
            bus.read(3, "id")
        bus.close()
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize(("family", "kind"), [("XL-330", "fast"), ("XL-430", "sync"), ("STS3215", "feetech"), ("MX-28", "bulk")])
def test_all_are_read_by_one_question(tmp_path, family, kind):
    r = robot(family, {"two": 0.3, "three": -0.2}, model=arm(tmp_path))
    bus = r.bus()
    survey(bus, r.model, ids=())
    assert bus.group_kind == kind
    got = bus.read_all([1, 2, 3], "present_position", "present_voltage")
    assert [bus.profile.angle(got[i]["present_position"]) for i in (1, 2, 3)] == pytest.approx([0.0, 0.3, -0.2], abs=0.005)
    assert {values["present_voltage"] for values in got.values()} == {round(10 * r.wire.supply)}
    r.servos["two"].mute = True
    assert set(bus.read_all([1, 2, 3], "present_position")) == {1}  # each waits for the one before


def test_servos_of_an_older_firmware_are_not_asked_for_one_packet(tmp_path):
    r = robot("XL-330", model=arm(tmp_path))
    r.servos["three"]["firmware_version"] = 45
    bus = r.bus()
    survey(bus, r.model, ids=())
    assert bus.group_kind == "sync"


def test_a_broken_block_ends_what_is_believed():
    """Every byte of the one packet flipped in turn: nothing wrong is read."""
    from workbench.device.bus.group import answers
    from workbench.device.virtual.protocol2 import HEADER, STATUS, Protocol2

    so_far = HEADER + b"\xfe" + (2 * 8 + 1).to_bytes(2, "little") + bytes([STATUS])
    for servo in (4, 9):
        so_far += Protocol2().block(so_far, servo, 0, bytes([servo, 1, 2, 3]))
    assert answers("fast", so_far, 4, [4, 9]) == {4: (0, b"\x04\x01\x02\x03"), 9: (0, b"\x09\x01\x02\x03")}
    assert answers("fast", b"\xff" + so_far, 4, [4, 9]).keys() == {4, 9}
    assert answers("fast", so_far, 4, [9, 4]) == {}
    for k in range(len(so_far)):
        broken = so_far[:k] + bytes([so_far[k] ^ 0x10]) + so_far[k + 1:]
        got = answers("fast", broken, 4, [4, 9])
        assert got in ({}, {4: (0, b"\x04\x01\x02\x03")}), k
