"""The whole loop: motion, bus or flashed image, servos with hidden physics, cameras and joint log, diagnosis."""

import pytest

from tests.device.whole_loop import HIDDEN, from_controller, from_host, named, of_an_arm
from tests.firmware.image import needs_compiler
from workbench.effects.registry import effect_named
from workbench.robot import EffectSpec


def test_a_worn_gear_and_two_registers_of_an_arm_are_named(tmp_path):
    """The gear by what it does, the registers by themselves."""
    worn = EffectSpec("coulomb_friction", ("two",), {"torque": 0.2})
    set_so = {"one": {"compliance_margin": 3}, "three": {"compliance_slope": 64}}
    verdict, found = named(of_an_arm(tmp_path, (worn,), registers=set_so))
    assert ("coulomb_friction", ("two",)) in found
    assert found["dead_band", ("one",)] > 0.95
    assert found["servo_gain", ("three",)] > 0.95
    assert verdict != "no_gap"


def test_a_quiet_arm_is_quiet(tmp_path):
    verdict, found = named(of_an_arm(tmp_path, ()))
    assert (verdict, found) == ("no_gap", {})


@pytest.mark.slow
@pytest.mark.parametrize("what", HIDDEN)
@pytest.mark.parametrize("way", [from_host, pytest.param(from_controller, marks=needs_compiler)], ids=["host", "image"])
def test_the_practice_effects(tmp_path, way, what):
    if way is from_controller and any(effect_named(e.effect).layer == "timing" for e in HIDDEN[what]):
        pytest.skip("the image keeps its own time: what delays commands before they are sent is not in it")
    verdict, found = named(way(tmp_path, HIDDEN[what]), jobs=2)
    assert {(e.effect, e.where) for e in HIDDEN[what]} <= set(found)
    assert verdict == "no_gap" or HIDDEN[what]
