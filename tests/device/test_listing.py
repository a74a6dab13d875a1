"""Servos are listed without a robot model: whichever family, whichever bit rate."""

import pytest

from tests.command import succeeds
from tests.device.servos import FAMILIES, arm, robot
from workbench.device.bus import BusError
from workbench.device.bus.listing import list_servos
from workbench.device.bus.survey import survey
from workbench.device.virtual import VirtualServo


@pytest.mark.parametrize("family", FAMILIES)
def test_each_family_is_recognised(tmp_path, family):
    r = robot(family, {"two": 0.3}, model=arm(tmp_path))
    (found,) = list_servos(r.port)
    assert found.profile.name == family
    assert sorted(found.found) == [1, 2, 3]
    assert found.found[2].joint is None
    assert found.found[2].angle == pytest.approx(0.3, abs=0.003)
    assert found.problems() == ()
    assert not any(servo["torque_enable"] for servo in r.servos.values())


def test_two_families_on_one_bus_and_a_stranger(tmp_path):
    r = robot("XL-330", model=arm(tmp_path))
    VirtualServo(r.wire, FAMILIES["AX-12A"][0], 40, r.body)
    stranger = VirtualServo(r.wire, FAMILIES["AX-12A"][0], 41, r.body)
    stranger["model_number"] = 24
    r.wire.supply = 5.0
    by_name = {found.profile.name: found for found in list_servos(r.port)}
    assert {name: sorted(found.found) for name, found in by_name.items()} == {"AX-12A": [40, 41], "XL-330": [1, 2, 3]}
    assert by_name["AX-12A"].found[41].model == "unknown model 24"
    assert any("servo 41: is unknown model 24 (24)" in line for line in by_name["AX-12A"].problems())


@pytest.mark.parametrize(("family", "highest"), [("AX-12A", 253), ("STS3215", 253), ("XL-330", 252)])
def test_every_id_that_the_protocol_allows_is_asked(tmp_path, family, highest):
    r = robot(family, model=arm(tmp_path))
    VirtualServo(r.wire, FAMILIES[family][0], highest, r.body)
    (found,) = list_servos(r.port)
    assert sorted(found.found) == [1, 2, 3, highest]
    assert sorted(survey(r.bus(), None).found) == [1, 2, 3, highest]


def test_another_bit_rate_is_found_and_slow_answers_are_waited_for(tmp_path):
    r = robot("STS3215", model=arm(tmp_path))
    for servo in r.servos.values():
        servo["baud_rate"] = 1
    r.port.latency = 0.016
    (found,) = list_servos(r.port)
    assert (found.rate, sorted(found.found)) == (500_000, [1, 2, 3])
    assert found.latency == pytest.approx(0.016, abs=0.002)


def test_nobody_on_the_bus_is_an_error(tmp_path):
    r = robot("XL-330", joints=[], model=arm(tmp_path))
    for servo in r.servos.values():
        servo.power(False)
    with pytest.raises(BusError, match="no servo answers, at 1000000 bit/s or any other"):
        list_servos(r.port)


def test_the_verb_lists_without_a_model(capsys):
    said = succeeds(capsys, "servos", "--port", "virtual")
    assert "15 servos at 1000000 bit/s (AX-12A)" in said
    assert "compare them with a robot: --model NAME" in said
