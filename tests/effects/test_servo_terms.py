"""Effects that act in motion, friction that varies, a supply and motors that give way: closed forms on a one-joint rig, and the
puppy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydrake.planning import RobotDiagramBuilder
from scipy.integrate import quad

from tests.servo_rig import GRAVITY, LENGTH, SDF, make_rig, rig_model
from workbench.effects.apply import physics_of
from workbench.effects.registry import effect_named
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.robot import EffectSpec, RobotModel, ServoConstants, puppy_model
from workbench.servo import AddServos, ServoBank, ServoTerm
from workbench.simulation import Simulation, SimulationConfig

MASS, STEP = 0.1, 5e-4
PLANTS = {"lagged": {"time_step": STEP}, "lagged 2 ms": {"time_step": 2e-3}, "sap": {"time_step": STEP, "approximation": "kSap"},
          "runge_kutta3": {"time_step": 0.0, "integrator": "runge_kutta3", "accuracy": 1e-5}}
each_plant = pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
SMOOTH = ServoConstants(coulomb_friction=0.0, viscous_friction=0.0)
DRY = ServoConstants(coulomb_friction=0.06, viscous_friction=0.0)
CASES = {
    "stribeck_friction": EffectSpec("stribeck_friction", ("flm",), {"torque": 0.15, "speed": 20.0}),
    "load_friction": EffectSpec("load_friction", ("flm",), {"coefficient": 0.5}),
    "friction_asymmetry": EffectSpec("friction_asymmetry", ("flm",), {"ratio": 4.0}),
    "supply_sag": EffectSpec("supply_sag", (), {"drop": 1.0}),
    "torque_ceiling": EffectSpec("torque_ceiling", ("flm",), {"torque": 0.1}),
    "torque_saturation": EffectSpec("torque_saturation", ("flm",), {"torque": 0.2}),
    "thermal_fade": EffectSpec("thermal_fade", (), {"rate": 1.0}),
}
each_effect = pytest.mark.parametrize("name", CASES)


def terms(tmp_path, servo, name, where=("j",), **parameters):
    model = rig_model(tmp_path, servo).with_effect(EffectSpec(name, where, parameters))
    return physics_of(model).terms


def load_at(angle: float, mass: float = MASS) -> float:
    return mass * GRAVITY * LENGTH * float(np.sin(angle))


def angle_of(load: float, mass: float = MASS) -> float:
    return float(np.arcsin(load / load_at(np.pi / 2, mass)))


def moved_when_let_go(rig, load: float, duration: float = 0.5) -> float:
    """How far the joint turns in a second half of `duration` from rest at a load, with its servo off."""
    rig.command(0.0, enabled=False)
    rig.put(angle_of(load))
    first = rig.run(duration)[0]
    return abs(rig.run(duration)[0] - first)


# Friction


@each_plant
@pytest.mark.parametrize(("share", "held"), [(0.97, True), (1.05, False)])
def test_a_servo_that_sticks_holds_to_the_sum_of_both_frictions(tmp_path, plant, share, held):
    friction = terms(tmp_path, DRY, "stribeck_friction", torque=0.03, speed=10.0)
    rig = make_rig(tmp_path, DRY, terms=friction, **plant)
    assert (moved_when_let_go(rig, share * 0.09) < 1e-4) == held


@each_plant
def test_a_servo_that_sticks_slides_as_far_and_as_long_as_stribecks_curve_says(tmp_path, plant):
    speed, start = np.radians(60.0), 2.0
    friction = terms(tmp_path, DRY, "stribeck_friction", torque=0.05, speed=60.0)
    rig = make_rig(tmp_path, DRY, gravity=False, terms=friction, **plant)
    rig.command(0.0, enabled=False)
    rig.put(0.0, rate=start)
    inertia = DRY.reflected_inertia + MASS * LENGTH**2

    def brake(v: float) -> float:
        return 0.06 + 0.05 * float(np.exp(-((v / speed) ** 2)))

    later = 0.12  # by then it has slowed to about 0.8 rad/s, where the curve is steep
    half = rig.run(later)[1]
    assert quad(lambda v: inertia / brake(v), half, start)[0] == pytest.approx(later, rel=0.02)
    assert rig.run(0.5)[0] == pytest.approx(quad(lambda v: inertia * v / brake(v), 0.0, start)[0], rel=0.02)
    assert abs(rig.run(0.1)[1]) < 2e-4


@each_plant
@pytest.mark.parametrize("coefficient", [0.2, 0.5])
@pytest.mark.parametrize(("share", "held"), [(0.96, True), (1.05, False)])
def test_friction_of_a_load_holds_it_until_it_takes_itself_along(tmp_path, plant, coefficient, share, held):
    """Driven backwards with the motor off, the joint hands on its friction: f = c + k f."""
    servo = replace(DRY, coulomb_friction=0.03)
    rig = make_rig(tmp_path, servo, terms=terms(tmp_path, servo, "load_friction", coefficient=coefficient), **plant)
    assert (moved_when_let_go(rig, share * 0.03 / (1 - coefficient)) < 1e-3) == held


@each_plant
@pytest.mark.parametrize(("way", "share", "held"), [(1, 0.95, True), (1, 1.05, False), (-1, 0.95, True), (-1, 1.05, False)])
def test_friction_of_a_load_is_overcome_upwards_and_backwards_by_the_same_torque(tmp_path, plant, way, share, held):
    """A motor at rest turns when its torque leaves the load L by c + k L, up or down."""
    coefficient, load = 0.4, load_at(np.pi / 2, mass=0.5)
    servo = ServoConstants(compliance_slope=None, compliance_margin=None, punch=None, proportional_gain=0.02,
                           viscous_friction=0.0)
    rig = make_rig(tmp_path, servo, mass=0.5, terms=terms(tmp_path, servo, "load_friction", coefficient=coefficient), **plant)
    torque = load + way * share * (servo.coulomb_friction + coefficient * load)
    reference = np.pi / 2 + torque / (servo.gain * servo.torque_at_full_duty)
    balanced = np.pi / 2 + load / (servo.gain * servo.torque_at_full_duty)
    rig.command(balanced)
    rig.put(np.pi / 2, reference=balanced)
    before = rig.run(0.1)[0]  # until the load is felt
    rig.command(reference, speed=4.0 * abs(reference - balanced))
    rig.run(0.3)
    there = rig.run(0.1)[0]
    turned = rig.run(0.2)[0] - there
    assert before == pytest.approx(np.pi / 2, abs=2e-4)
    if held:
        assert abs(turned) < 2e-4
    else:
        assert way * turned > 2e-3


@each_plant
def test_friction_of_a_load_brakes_a_joint_by_what_it_hands_on(tmp_path, plant):
    """In free fall from an angle: the link takes f + I_servo a, of which k is friction: f = c + k |f + I_servo a|."""
    k, servo = 0.4, replace(DRY, coulomb_friction=0.02)
    rig = make_rig(tmp_path, servo, mass=0.5, terms=terms(tmp_path, servo, "load_friction", coefficient=k), **plant)
    rig.command(0.0, enabled=False)
    rig.put(np.pi / 2)
    rig.run(0.03)
    (_, first), (angle, last) = rig.run(0.01), rig.run(0.02)
    link, load = 0.5 * LENGTH**2, load_at(np.pi / 2, mass=0.5)
    # Falling by a: load - f = (link + servo) a, handed on h = load - link a, f = c + k h
    a = ((1 - k) * load - 0.02) / (servo.reflected_inertia + (1 - k) * link)
    assert angle > 1.4  # the load has hardly changed
    assert (first - last) / 0.02 == pytest.approx(a, rel=0.02)


@each_plant
@pytest.mark.parametrize(("share", "held"), [(0.95, True), (1.06, False)])
def test_friction_of_a_load_is_more_at_rest(tmp_path, plant, share, held):
    """A released load stays where static load friction, k + s times the transmitted torque, holds it: f = c + (k + s) f."""
    servo = replace(DRY, coulomb_friction=0.03)
    rubbing = terms(tmp_path, servo, "load_friction", coefficient=0.2, static=0.3, speed=5.0)
    rig = make_rig(tmp_path, servo, terms=rubbing, **plant)
    assert (moved_when_let_go(rig, share * 0.03 / (1 - 0.5)) < 1e-3) == held


@each_plant
@pytest.mark.parametrize(("way", "share", "held"), [(1, 0.95, True), (1, 1.05, False), (-1, 0.95, True), (-1, 1.05, False)])
def test_a_gear_that_is_driven_backwards_holds_more_of_its_load(tmp_path, plant, way, share, held):
    """A motor at rest turns upwards when its torque leaves the load L by c + k L, downwards, against it, by c + (k + b) L."""
    k, b, load = 0.1, 0.3, load_at(np.pi / 2, mass=0.5)
    servo = ServoConstants(compliance_slope=None, compliance_margin=None, punch=None, proportional_gain=0.02,
                           viscous_friction=0.0)
    rig = make_rig(tmp_path, servo, mass=0.5, terms=terms(tmp_path, servo, "load_friction", coefficient=k, backdrive=b), **plant)
    torque = load + way * share * (servo.coulomb_friction + (k if way > 0 else k + b) * load)
    balanced = np.pi / 2 + load / (servo.gain * servo.torque_at_full_duty)
    reference = np.pi / 2 + torque / (servo.gain * servo.torque_at_full_duty)
    rig.command(balanced)
    rig.put(np.pi / 2, reference=balanced)
    rig.run(0.1)
    rig.command(reference, speed=4.0 * abs(reference - balanced))
    rig.run(0.3)
    there = rig.run(0.1)[0]
    turned = rig.run(0.2)[0] - there
    assert abs(turned) < 2e-4 if held else way * turned > 2e-3


@each_plant
@pytest.mark.parametrize(("side", "holds"), [(1, 0.06 * 2 * 3 / 4), (-1, 0.06 * 2 / 4)])
@pytest.mark.parametrize(("share", "held"), [(0.9, True), (1.06, False)])
def test_a_gear_that_turns_harder_one_way_holds_more_on_that_way(tmp_path, plant, side, holds, share, held):
    """A load at a negative angle would turn the joint forwards."""
    rig = make_rig(tmp_path, DRY, terms=terms(tmp_path, DRY, "friction_asymmetry", ratio=3.0), mass=0.2, **plant)
    rig.command(0.0, enabled=False)
    rig.put(-side * angle_of(share * holds, 0.2))
    start = rig.run(0.25)[0]
    assert (abs(rig.run(0.25)[0] - start) < 1e-4) == held


def test_a_held_joint_creeps_no_faster_than_with_plain_friction(tmp_path):
    friction = terms(tmp_path, DRY, "load_friction", coefficient=0.9)
    rig = make_rig(tmp_path, DRY, mass=1.0, terms=friction)
    rig.command(0.0, enabled=False)
    rig.put(0.3)
    start = rig.run(0.5)[0]
    assert abs(rig.run(2.0)[0] - start) < 2 * 1.2e-4


def test_friction_that_varies_is_refused_where_it_cannot_act(tmp_path):
    friction = terms(tmp_path, DRY, "stribeck_friction", torque=0.05, speed=10.0)
    with pytest.raises(InputError, match="CENIC"):
        make_rig(tmp_path, DRY, time_step=0.0, integrator="cenic", terms=friction)
    builder = RobotDiagramBuilder(time_step=1e-3)
    model = rig_model(tmp_path, DRY)
    builder.parser().AddModels(str(model.path))
    with pytest.raises(InputError, match="the plant's step"):
        AddServos(builder.builder(), builder.plant(), model, period=2e-3, terms=friction)
    with pytest.raises(InputError, match="expected drive 'servo'"):
        Simulation(puppy_model().with_effect(CASES["supply_sag"]), SimulationConfig(drive="fast_servo"))


# Supply and motor


def two_servos(tmp_path, drop: float) -> tuple[ServoBank, object]:
    """The bank of two arms side by side, and a context of it within their diagram."""
    arm = SDF.format(length=LENGTH, mass=MASS)
    second = arm[arm.index('<link name="arm">'):arm.index("</model>")].replace('"arm"', '"arm2"').replace(">arm<", ">arm2<")
    path = tmp_path / "two.sdf"
    path.write_text(arm.replace("</model>", second.replace('"j"', '"j2"') + "</model>"))
    model = RobotModel(description=str(path), base="base", servos={"j": SMOOTH, "j2": SMOOTH})
    model = model.with_effect(EffectSpec("supply_sag", (), {"drop": drop}))
    builder = RobotDiagramBuilder(time_step=1e-3)
    builder.parser().AddModels(str(path))
    bank = AddServos(builder.builder(), builder.plant(), replace(model, effects=()), terms=physics_of(model).terms)
    for port in ("goal_position", "moving_speed", "torque_enable"):
        builder.builder().ExportInput(bank.GetInputPort(port), port)
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    diagram.GetInputPort("goal_position").FixValue(root, [3.0, 3.0])
    diagram.GetInputPort("moving_speed").FixValue(root, [0.0, 0.0])
    return bank, (diagram, root)


@pytest.mark.parametrize(("on", "ratio"), [((1, 1), 1 - 2 * 0.9 / 11.1), ((1, 0), 1 - 0.9 / 11.1)])
def test_servos_share_what_a_sagging_supply_leaves(tmp_path, on, ratio):
    bank, (diagram, root) = two_servos(tmp_path, 0.9)
    diagram.GetInputPort("torque_enable").FixValue(root, np.array(on, dtype=float))
    context = bank.GetMyMutableContextFromRoot(root)
    bank.SetReference(context, [3.0, -3.0])
    expected = np.array([1.0, -1.0]) * on * SMOOTH.torque_at_full_duty * ratio
    np.testing.assert_allclose(bank.GetOutputPort("motor_torque").Eval(context), expected, rtol=1e-12)
    assert np.abs(bank.GetOutputPort("generalized_force").Eval(context)).sum() == pytest.approx(np.abs(expected).sum())


def test_a_supply_sags_to_nothing_not_below(tmp_path):
    bank, (diagram, root) = two_servos(tmp_path, 5.0)
    diagram.GetInputPort("torque_enable").FixValue(root, [1.0, 1.0])
    context = bank.GetMyMutableContextFromRoot(root)
    bank.SetReference(context, [3.0, 3.0])
    assert bank.GetOutputPort("motor_torque").Eval(context)[0] == pytest.approx(1.3875 * (1.1 / 11.1))
    two = physics_of(rig_model(tmp_path, SMOOTH).with_effect(EffectSpec("supply_sag", (), {"drop": 5.0})))
    weak = replace(two.law, full_torque=two.law.torque_per_volt * 4.0)
    now = type("Now", (), {"duty": np.ones(1)})()
    assert two.terms[0].strength(weak, now) == 0.0


@each_plant
def test_no_load_speed_falls_with_a_sagging_supply(tmp_path, plant):
    rig = make_rig(tmp_path, SMOOTH, gravity=False, terms=terms(tmp_path, SMOOTH, "supply_sag", where=(), drop=2.0), **plant)
    rig.command(100.0)
    rig.put(0.0, reference=100.0)
    assert rig.run(0.5)[1] == pytest.approx(6.18 * (11.1 - 2.0) / 12, rel=1e-4)


@each_plant
def test_a_ceiling_cuts_the_motors_torque_at_stall_and_in_motion(tmp_path, plant):
    """Constant acceleration while the motor could give more; the no-load speed stays."""
    rig = make_rig(tmp_path, SMOOTH, gravity=False, terms=terms(tmp_path, SMOOTH, "torque_ceiling", torque=0.3), **plant)
    rig.command(100.0)
    rig.put(0.0, reference=100.0)
    assert rig.output("motor_torque") == pytest.approx(0.3)
    acceleration = 0.3 / (SMOOTH.reflected_inertia + MASS * LENGTH**2)
    for t in (0.05, 0.1):
        angle, speed = rig.run(t - rig.context.get_time())
        assert speed == pytest.approx(acceleration * t, rel=4e-3)  # the first step does not know what comes
        assert angle == pytest.approx(acceleration * t * t / 2, rel=0.04)
        assert rig.output("motor_torque") == pytest.approx(0.3)
    speed = rig.run(0.5)[1]
    assert speed == pytest.approx(6.18 * 11.1 / 12, rel=1e-3)
    assert rig.output("motor_torque") == pytest.approx(1.3875 - SMOOTH.back_emf * speed, abs=1e-9)


@each_plant
def test_a_ceiling_holds_when_the_motor_brakes(tmp_path, plant):
    """Turning against full duty, back-EMF adds to it; still the ceiling holds."""
    rig = make_rig(tmp_path, SMOOTH, gravity=False, terms=terms(tmp_path, SMOOTH, "torque_ceiling", torque=0.3), **plant)
    rig.command(-100.0)
    rig.put(0.0, rate=4.0, reference=-100.0)
    deceleration = 0.3 / (SMOOTH.reflected_inertia + MASS * LENGTH**2)
    assert rig.run(0.05)[1] == pytest.approx(4.0 - 0.05 * deceleration, rel=4e-3)


@each_plant
def test_a_saturating_motor_gives_half_at_its_torque_and_keeps_its_no_load_speed(tmp_path, plant):
    saturating = terms(tmp_path, SMOOTH, "torque_saturation", torque=SMOOTH.torque_at_full_duty)
    rig = make_rig(tmp_path, SMOOTH, gravity=False, terms=saturating, **plant)
    rig.command(100.0)
    rig.put(0.0, reference=100.0)
    assert rig.output("motor_torque") == pytest.approx(SMOOTH.torque_at_full_duty / 2)
    inertia, full, stall = SMOOTH.reflected_inertia + MASS * LENGTH**2, 6.18 * 11.1 / 12, SMOOTH.torque_at_full_duty
    later = 0.05
    speed = rig.run(later)[1]

    def slope(v: float) -> float:
        left = stall - SMOOTH.back_emf * v
        return left / (1 + left / stall) / inertia

    assert quad(lambda v: 1 / slope(v), 0.0, speed)[0] == pytest.approx(later, rel=0.02)
    assert rig.run(1.5)[1] == pytest.approx(full, rel=1e-3)


def test_motors_fade_from_the_first_command_on(tmp_path):
    rig = make_rig(tmp_path, SMOOTH, gravity=False, terms=terms(tmp_path, SMOOTH, "thermal_fade", where=(), rate=0.5))
    rig.command(1e3)
    rig.put(0.0, reference=1e3)
    bank = rig.bank.GetMyMutableContextFromRoot(rig.context)
    for begin, elapsed in ((0.0, 0.0), (2.0, 0.0), (np.inf, 0.0), (-2.0, 2.0)):
        rig.bank.SetFirstCommand(bank, begin)
        assert rig.output("generalized_force") == pytest.approx(1.3875 * np.exp(-0.5 * elapsed))
    rig.bank.SetFirstCommand(bank, 0.0)
    rig.run(2.0)
    assert rig.output("generalized_force") == pytest.approx(1.3875 / np.e)


def holding(model: RobotModel, config: SimulationConfig, **options):
    """A take of a rig that holds its weight at 1 rad for 0.6 s, then goes back and holds it until 2 s."""
    goals = np.array([[1.0], [0.4]])
    commands = Commands(np.array([0.0, 0.6]), ("j",), goals, goals * 0 + 3.0, np.ones((2, 1), bool), 2.0, np.array([0, 1]))
    return Simulation(model, config).run(commands, **options)


def test_fading_counts_from_a_takes_first_command_and_from_what_was_played_before(tmp_path):
    model = rig_model(tmp_path, SMOOTH, mass=0.6).with_effect(EffectSpec("thermal_fade", (), {"rate": 0.5}))
    simulation = SimulationConfig(base="fixed")
    early, late = holding(model, simulation), holding(model, simulation, lead=0.5)
    np.testing.assert_allclose(late.q[late.time >= 0], early.q[early.time >= 0], atol=1e-6)
    full = SMOOTH.torque_at_full_duty
    for elapsed in (0.0, 1.0):
        take = holding(model, simulation, elapsed=elapsed)
        angle, back_emf = take.q[-1, 0], SMOOTH.back_emf * take.v[-1, 0]
        duty = SMOOTH.punch_duty + SMOOTH.gain * (0.4 - angle - SMOOTH.margin)
        assert duty * full * np.exp(-0.5 * (2.0 + elapsed)) - back_emf == pytest.approx(load_at(angle, 0.6), rel=0.01)


# The bank, logs and the station


@each_plant
def test_a_term_that_does_nothing_changes_nothing(tmp_path, plant):
    servo = ServoConstants()
    rigs = [make_rig(tmp_path, servo, terms=t, **plant) for t in ((), (ServoTerm(),))]
    assert type(rigs[0].bank) is ServoBank
    assert type(rigs[1].bank) is not ServoBank
    for rig in rigs:
        rig.command(0.6, 2.0)
        rig.put(0.1)
    for _ in range(10):
        nominal, idle = (rig.run(0.05) for rig in rigs)
        exact = bool(plant["time_step"])  # a speed near nothing is known to the integrator's accuracy, not to a share of itself
        np.testing.assert_allclose(idle, nominal, rtol=1e-12 if exact else 1e-3, atol=0.0 if exact else plant["accuracy"])


def test_logged_torque_is_what_turns_the_arm(tmp_path):
    """m l^2 + I_servo times the acceleration, and the weight, for all effects at once."""
    servo, mass = ServoConstants(), 0.4
    model = rig_model(tmp_path, servo, mass)
    for spec in (*list(CASES.values())[:3], EffectSpec("torque_ceiling", ("j",), {"torque": 0.4}), CASES["thermal_fade"]):
        model = model.with_effect(replace(spec, where=("j",) if spec.where else ()))
    for step, close in ((5e-4, 0.005), (0.0, 0.04)):  # bristles quiver within the log's period, nominal ones as well
        take = holding(model, SimulationConfig(base="fixed", time_step=step, log_period=5e-4, settle=0.1), duration=0.9)
        assert take.torque is not None
        assert take.v is not None
        acceleration = np.diff(take.v[:, 0]) / 5e-4
        expected = (servo.reflected_inertia + mass * LENGTH**2) * acceleration + mass * GRAVITY * LENGTH * np.sin(take.q[:-1, 0])
        wrong = take.torque[:-1, 0] - expected
        assert np.ptp(expected) > 0.4
        assert np.sqrt(np.mean(np.square(wrong))) < close


@each_effect
def test_acts_on_the_puppy(name):
    goals = np.zeros((2, 15))
    joints = puppy_model().joints
    column = joints.index("flm")
    goals[:, [column, joints.index("frm")]] = [[0.3, -0.3], [-0.3, 0.3]]
    commands = Commands(np.array([0.0, 0.25]), joints, goals, np.full((2, 15), 6.0), np.ones((2, 15), bool), 0.5,
                        np.array([0, 1]))
    config = SimulationConfig(base="fixed", contact_period=0.0, settle=0.3)
    nominal = Simulation(puppy_model(), config).run(commands)
    run = Simulation(puppy_model().with_effect(CASES[name]), config).run(commands)
    change = np.abs(run.q - nominal.q).max(axis=0)
    assert np.isfinite(run.q).all()
    assert change[column] > np.radians(0.3)
    if CASES[name].where:  # others feel it through the base alone, which is held
        others = [i for i, j in enumerate(joints) if not j.startswith("fl")]
        assert change[others].max() < 0.02 * change[column]


@each_effect
@pytest.mark.parametrize("approximation", ["lagged", "sap"])
def test_the_puppy_stands_with_it(name, approximation):
    config = SimulationConfig(contact_period=0.0, approximation=approximation, settle=0.5)
    take = Simulation(puppy_model().with_effect(CASES[name]), config).run(duration=0.3)
    assert np.abs(take.v).max() < 0.3
    assert take.p_WB[-1, 2] == pytest.approx(take.p_WB[0, 2], abs=2e-3)


@each_effect
def test_vanishes_at_neutral(tmp_path, name):
    effect = effect_named(name)
    parameters = {p.name: float(np.clip(v, p.low, p.high)) for p, v in zip(effect.parameters, effect.neutral(puppy_model()))}
    model = rig_model(tmp_path, ServoConstants(), mass=0.4)
    hidden = model.with_effect(EffectSpec(name, ("j",) if CASES[name].where else (), parameters))
    config = SimulationConfig(base="fixed", settle=0.1)
    nominal, run = (holding(m, config, duration=0.9) for m in (model, hidden))
    np.testing.assert_allclose(run.q, nominal.q, atol=1e-9)
    np.testing.assert_allclose(run.torque, nominal.torque, atol=1e-6)
