"""Effects that are added to a constant of the servos can take it away, to nothing and no further."""

from dataclasses import replace

import pytest

from workbench.effects.apply import add_possible, law_of, physics_of
from workbench.effects.base import Effect, Parameter
from workbench.effects.foreign import check_effect
from workbench.effects.registry import known_effects
from workbench.files import InputError
from workbench.robot import EffectSpec, RobotModel, ServoConstants, puppy_model

ADDED = {e.name: e for e in known_effects().values() if any(p.adds_to for p in e.parameters)}
SERVO = ServoConstants(
    compliance_slope=None, compliance_margin=None, punch=None, proportional_gain=5.0, coulomb_friction=0.15, viscous_friction=0.1,
    reflected_inertia=0.01, minimum_duty=0.06, dead_zone=1.5, goal_delay=0.02, command_filter=0.04, derivative_gain=0.3,
    load_friction=0.2)
KEYS = {"margin": "dead_zone", "punch_duty": "minimum_duty"}
"""Keys of servo.yaml of constants that the workbench has under another name."""


def robot(servo: ServoConstants = SERVO) -> RobotModel:
    puppy = puppy_model()
    return puppy.with_physics(dict.fromkeys(puppy.joints, servo), ())


def less(model: RobotModel, name: str, share: float, where: tuple[str, ...] = ("flm",)) -> EffectSpec:
    """An effect that takes away this share of the constant to which it is added."""
    effect = ADDED[name]
    lowest = dict(zip((p.name for p in effect.parameters), effect.lowest(model, where)))
    return EffectSpec(name, where, {p.name: share * lowest[p.name] for p in effect.parameters if p.adds_to})


def test_friction_inertia_and_what_a_servo_is_set_to_can_be_less_than_nominal():
    assert set(ADDED) == {"coulomb_friction", "viscous_friction", "load_friction", "reflected_inertia", "dead_band",
                          "minimum_duty", "damping_gain", "command_filter"}


@pytest.mark.parametrize("name", sorted(ADDED))
@pytest.mark.parametrize("share", [0.5, 1.0])
def test_a_constant_less_a_part_of_it_acts_as_the_smaller_constant(name, share):
    model, (p,) = robot(), [p for p in ADDED[name].parameters if p.adds_to]
    key = KEYS.get(p.adds_to, p.adds_to)
    smaller = replace(SERVO, **{key: (1 - share) * getattr(SERVO, key)})
    expected, found = robot(smaller), model.with_effect(less(model, name, share))
    column = model.joints.index("flm")
    a, b = physics_of(expected), physics_of(found)
    for field in ("margin", "punch", "coulomb", "viscous", "inertia", "derivative", "lag"):
        assert getattr(b.law, field)[column] == pytest.approx(getattr(a.law, field)[column], abs=1e-12)
    loads = [[t.numbers().rubbing for t in physics.servo_terms] for physics in (a, b)]
    assert sum(r[column] for r in loads[1] if r is not None) == pytest.approx(sum(r[column] for r in loads[0] if r is not None))


def test_the_lower_bound_is_the_smallest_constant_of_several_joints_with_what_the_model_adds():
    model, effect = robot(), ADDED["coulomb_friction"]
    model = model.with_physics({**model.servos, "frm": replace(SERVO, coulomb_friction=0.05)}, ())
    assert effect.lowest(model, ("flm",)) == pytest.approx((-0.15,))
    assert effect.lowest(model, ("flm", "frm")) == pytest.approx((-0.05,))
    more = model.with_effect(EffectSpec("coulomb_friction", ("flm",), {"torque": 0.1}))
    assert effect.lowest(more, ("flm",)) == pytest.approx((-0.25,))
    assert ADDED["load_friction"].lowest(model, ("flm",)) == pytest.approx((-0.2, 0.0, 0.5, 0.0))
    assert known_effects()["backlash"].lowest(model, ("flm",)) == (0.0,)


def test_more_than_the_constant_is_refused_with_what_is_possible():
    with pytest.raises(InputError, match=r"'torque' is -0.2 N m; expected -0.15 to 1.5"):
        law_of(robot().with_effect(EffectSpec("coulomb_friction", ("flm",), {"torque": -0.2})))
    model = robot().with_effects([EffectSpec("dead_band", ("flm",), {"margin": -1.0})] * 2)
    with pytest.raises(InputError, match=r"'margin' is -1 deg; expected -0.5 to 15"):
        law_of(model)
    with pytest.raises(InputError, match=r"'gap' is -1 deg; expected 0 to 30"):
        law_of(robot().with_effect(EffectSpec("backlash", ("flm",), {"gap": -1.0})))


def test_a_search_that_takes_away_more_than_a_recalibrated_constant_takes_all_of_it():
    smaller = robot(replace(SERVO, coulomb_friction=0.09))
    (spec,) = add_possible(smaller, [EffectSpec("coulomb_friction", ("flm",), {"torque": -0.12})]).effects
    assert spec.parameters == {"torque": -0.09}
    (spec,) = add_possible(robot(), [EffectSpec("coulomb_friction", ("flm",), {"torque": -0.12})]).effects
    assert spec.parameters == {"torque": -0.12}


@pytest.mark.parametrize(("name", "sentence"), [
    ("coulomb_friction", "flm has 0.150 N m less dry friction."),
    ("viscous_friction", "flm has 0.100 N m s/rad less viscous friction."),
    ("reflected_inertia", "The reflected inertia of flm is 0.0100 kg m^2 below nominal."),
    ("load_friction", "flm loses 20 % less of the transmitted torque to friction."),
    ("dead_band", "The dead band of flm is 1.5 deg narrower on each side of its goal."),
    ("minimum_duty", "The smallest duty of flm is below nominal by 6.0 % of full duty."),
    ("damping_gain", "flm has a derivative gain 0.3000 duty per rad/s below nominal."),
    ("command_filter", "flm filters its goals with a time constant 40.0 ms below nominal.")])
def test_sentences_say_less_without_a_minus_sign(name, sentence):
    assert ADDED[name].sentence(less(robot(), name, 1.0)) == sentence
    assert "less" not in ADDED[name].sentence(less(robot(), name, -1.0))


def test_a_plug_in_names_a_constant_that_servos_have():
    class Grease(Effect):
        name, layer, places = "grease", "actuator", ("joint",)
        parameters = (Parameter("torque", "N m", 0.0, 1.0, 0.1, adds_to="grease"),)

        def sentence(self, spec):
            return ""

    with pytest.raises(InputError, match=r"'torque': adds_to: expected a number of ServoConstants, got 'grease'"):
        check_effect(Grease())
