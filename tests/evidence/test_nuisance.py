"""The nominal law as nuisance: uncertainty of its constants, their recalibration, and bounds from the servos' registers."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from tests.evidence.linear import JOINT, candidate
from tests.servo_rig import rig_model
from workbench.effects.registers import Registers
from workbench.effects.registry import effect_named
from workbench.effects.sdf import SdfRobot
from workbench.files import InputError
from workbench.identify.evidence.hypothesis import FAR, ZERO, Uncertain, start
from workbench.identify.evidence.nuisance import as_mapping, recalibrate, uncertain_numbers, with_known
from workbench.identify.evidence.plausible import at_their_end
from workbench.identify.evidence.recalibration import list_changes
from workbench.identify.parameters import Candidate
from workbench.robot import ServoConstants
from workbench.robot.servo_constants import SHARES_KNOWN, load_servo_constants
from workbench.view.report.words import suspect_constants

SERVO = {"stall_torque": 0.7, "no_load_speed": 19.0, "rated_voltage": 7.4, "supply_voltage": 7.4, "coulomb_friction": 0.013,
         "viscous_friction": 0.004, "reflected_inertia": 0.0018, "proportional_gain": 1.15}


def written(tmp_path, **changes):
    path = tmp_path / "servo.yaml"
    path.write_text(yaml.safe_dump(SERVO | changes))
    return path


def test_a_number_may_say_how_well_it_is_known(tmp_path):
    servo = load_servo_constants(written(tmp_path, supply_voltage={"value": 7.2, "sd": 0.36}))
    assert servo.supply_voltage == 7.2
    assert servo.share_known("supply_voltage") == pytest.approx(0.05)
    assert servo.share_known("coulomb_friction") == SHARES_KNOWN["coulomb_friction"]
    path = tmp_path / "again.yaml"
    path.write_text(yaml.safe_dump(servo.as_dict()))
    assert load_servo_constants(path) == servo


@pytest.mark.parametrize(("value", "said"), [
    ({"value": 7.4}, "supply_voltage: expected a number, or {value: number, sd: number}"),
    ({"value": 7.4, "sd": -1.0}, "supply_voltage: sd: expected a non-negative number, got -1.0"),
    ({"value": "full", "sd": 1.0}, "supply_voltage: expected a number, got 'full'")])
def test_what_is_no_number_is_refused_by_its_key(tmp_path, value, said):
    with pytest.raises(InputError) as e:
        load_servo_constants(written(tmp_path, supply_voltage=value))
    assert said in str(e.value)


def test_numbers_that_are_exact_are_no_nuisance(tmp_path):
    model = rig_model(tmp_path, ServoConstants(sd=tuple((key, 0.0) for key in SHARES_KNOWN)))
    assert [n.name for n in uncertain_numbers(model, "j")] == ["zero"]


def test_recalibration_changes_one_number_of_the_law_and_says_so(tmp_path):
    model = rig_model(tmp_path, ServoConstants())
    servo = model.servo("j")
    numbers = {n.name: n for n in uncertain_numbers(model, "j")}
    assert set(numbers) == {"torque_at_full_duty", "back_emf", "coulomb_friction", "viscous_friction", "reflected_inertia",
                            "zero"}
    for name, number in numbers.items():
        if name == "zero":
            continue
        changed = recalibrate(model, {number: 2.0}).servo("j")
        for other in numbers:
            if other != "zero":
                factor = np.exp(2.0 * number.sd) if other == name else 1.0
                assert getattr(changed, other) == pytest.approx(factor * getattr(servo, other)), (name, other)
    turned = recalibrate(model, {numbers["zero"]: -1.0})
    assert turned.effects[0].effect == "zero_offset"
    assert turned.effects[0].parameters["angle"] == pytest.approx(-np.degrees(numbers["zero"].sd))
    z = {numbers["coulomb_friction"]: 1.0, numbers["back_emf"]: -3.0}
    (said, other) = list_changes(model, start(tuple(z)).at(np.array(list(z.values()))))
    assert (said.number, other.number) == ("back_emf", "coulomb_friction")
    assert other.value == pytest.approx(servo.coulomb_friction * np.exp(0.5))
    assert (said.at_end, other.at_end) == (True, False)
    (warned,) = suspect_constants((said, other))
    assert warned.startswith("back emf at j: adjusted from 0.243 to 0.0542 N m s/rad, as far")


def test_all_numbers_recalibrated_as_far_as_they_go_are_still_those_of_a_servo(tmp_path):
    model = rig_model(tmp_path, load_servo_constants(written(tmp_path)))
    numbers = uncertain_numbers(model, "j")
    for signs in (1.0, -1.0):
        apart = {n: signs * FAR * (-1.0 if n.name == "back_emf" else 1.0) for n in numbers}
        servo = recalibrate(model, apart).servo("j")
        assert servo.no_load_speed == pytest.approx(200.0 if signs > 0 else 19.0 * np.exp(-2 * 1.5))


def test_a_number_is_known_by_its_joint_and_name():
    assert Uncertain("j", "back_emf", 0.1) != Uncertain("k", "back_emf", 0.1)


def registers(drop: float, seed: int) -> Registers:
    rng = np.random.default_rng(seed)
    duty = np.clip(rng.uniform(-1.5, 1.5, 400), -1.0, 1.0)
    voltage = np.round(7.4 - drop * np.abs(duty) + rng.normal(size=400) * 0.03, 1)
    return Registers({"j": duty}, voltage)


@pytest.mark.parametrize("drop", [0.0, 1.2])
def test_the_register_of_voltage_tells_a_sag(drop):
    value, error = effect_named("supply_sag").in_registers([registers(drop, k) for k in range(4)], ())
    assert value == pytest.approx(drop, abs=2 * error)
    assert error < 0.1


def test_registers_that_are_not_there_say_nothing():
    bare = [replace(registers(0.0, k), voltage=None, duty={}) for k in range(4)]
    assert effect_named("supply_sag").in_registers(bare, ()) is None


def test_a_supply_that_would_burn_the_servo_is_refuted(tmp_path):
    """On a servo of 7.4 V, 11.1 V is the end: what gets there is refuted, a sagging supply or full cells are not."""
    model = rig_model(tmp_path, load_servo_constants(written(tmp_path)))
    effect = effect_named("supply_voltage")
    reach = effect.reach(SdfRobot(model.path), model, ())
    free = Candidate.of(effect, (), effect.neutral(model))
    supply = replace(free, reach=reach)
    for volts, refuted in [(17.9, True), (11.1, True), (10.5, False), (5.0, False)]:
        h = start(()).with_effect(supply, supply.sizes([volts]))
        assert supply.values(h.theta)[0] == pytest.approx(min(volts, 11.1))
        said = at_their_end(h, [supply])
        assert list(said) == [supply] * refuted
        assert all("voltage would have to be 11.1 V or beyond" in str(why) for why in said.values())
    assert not at_their_end(start(()).with_effect(free, free.sizes([17.9])), [free])


def test_a_centre_of_mass_moved_by_half_its_link_is_refuted(tmp_path):
    """On an arm of 100 mm, 50 mm is the end, whichever way."""
    model = rig_model(tmp_path, ServoConstants())
    effect = effect_named("com_shift")
    free = Candidate.of(effect, ("arm",), effect.neutral(model))
    shift = replace(free, reach=effect.reach(SdfRobot(model.path), model, ("arm",)))
    for offset, refuted in [((0.0, 0.0, 0.09), True), ((0.04, 0.0, 0.04), True), ((0.03, 0.0, -0.03), False)]:
        h = start(()).with_effect(shift, shift.sizes(offset))
        said = at_their_end(h, [shift])
        assert list(said) == [shift] * refuted
    assert "its offset would have to be 0.0566 m or beyond" in str(
        at_their_end(start(()).with_effect(shift, shift.sizes((0.04, 0.0, 0.04))), [shift])[shift])


def test_what_vanishes_at_infinity_is_at_no_end(tmp_path):
    """A gear's stiffness is as far from neutral as can be, however stiff; where no reach is said, that refutes nothing."""
    effect = effect_named("joint_compliance")
    soft = Candidate.of(effect, ("j",), effect.neutral(rig_model(tmp_path, ServoConstants())))
    assert not at_their_end(start(()).with_effect(soft, np.ones(1)), [soft])


def test_ends_that_registers_set_refute_nothing():
    """The register limits the gain to half of its plausible range."""
    gain = replace(candidate("servo_gain"), reach=0.4)
    held = replace(gain, reach=0.2)
    h = start(()).with_effect(held, held.bounds()[1])
    assert not at_their_end(h, [gain])
    assert at_their_end(h, [held])


def test_the_speed_at_which_friction_fades_is_at_no_end():
    """The reach of load friction is a share of the load: a fade speed of 8 or 60 deg/s is not compared with it."""
    pool = replace(candidate("load_friction").with_options(["static"]), reach=1.2)
    for share, speed in [(0.3, 8.0), (0.3, 60.0), (1.0, 20.0), (0.3, 400.0)]:
        assert not at_their_end(start(()).with_effect(pool, pool.sizes((share, share, speed))), [pool])
    low = replace(pool, reach=0.2)
    assert at_their_end(start(()).with_effect(low, low.sizes((0.3, 0.3, 8.0))), [low])


def test_every_number_of_the_law_that_an_effect_changes_too_is_paired_with_it():
    """Their sum alone is seen, of a zero as of a friction."""
    numbers = (Uncertain(JOINT, "coulomb_friction", 0.2), Uncertain(JOINT, ZERO, 0.02))
    at = start(numbers)
    for name, first in (("coulomb_friction", 0), ("zero_offset", 1)):
        assert at.with_effect(candidate(name), np.array([1.0])).alike() == [[first, 2]], name
    assert at.with_effect(candidate("backlash"), np.array([1.0])).alike() == []


def test_a_delay_is_recalibrated_by_sums(tmp_path):
    """Of 20 ± 10 ms nothing may be there; 60 ms are four standard deviations away. How well it is known stays the same in ms."""
    model = rig_model(tmp_path, ServoConstants(goal_delay=0.02, sd=(("goal_delay", 0.01),)))
    numbers = uncertain_numbers(model, "j")
    (k,) = (k for k, n in enumerate(numbers) if n.name == "goal_delay")
    for z, delay in ((-3.0, 0.0), (-2.0, 0.0), (-1.0, 0.01), (3.0, 0.05)):
        h = start(numbers).at(np.where(np.arange(len(numbers)) == k, z, 0.0))
        changed = recalibrate(model, as_mapping(numbers, h.z))
        assert changed.servo("j").goal_delay == pytest.approx(delay, abs=1e-12)
        assert h.constant(k, z) == pytest.approx(delay, abs=1e-12)
        said = next(c for c in list_changes(model, h) if c.number == "goal_delay")
        assert said.value == pytest.approx(delay, abs=1e-12)
        if delay:
            known = with_known(changed, numbers, 0.04 * np.eye(len(numbers)))
            assert dict(known.servo("j").sd)["goal_delay"] == pytest.approx(0.002)
