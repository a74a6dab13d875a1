"""Effects on timing, servo constants, ground and forces: each changes its own joint or link alone; and how effects are found."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from tests.plug_in import install_plug_in
from workbench.effects.apply import apply_to_commands, apply_to_measurement, physics_of
from workbench.effects.base import Effect, si_values
from workbench.effects.registry import ENTRY_POINT_GROUP, known_effects
from workbench.effects.schedules import delay_commands, delay_each
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.recording import Measurement
from workbench.robot import BUS_IDS, EffectSpec, Ground, puppy_model
from workbench.servo import ServoLaw
from workbench.simulation import Simulation, SimulationConfig
from workbench.simulation.contact import model_geometries

PUPPY = puppy_model(ground=Ground(friction=0.6, stiffness=1e5, dissipation=20.0))
WEIGHT = sum(PUPPY.kinematics.masses.values()) * 9.81
DEG = np.pi / 180


def with_effect(name, where=(), **parameters):
    return PUPPY.with_effect(EffectSpec(name, (where,) if isinstance(where, str) else where, parameters))


@pytest.fixture(scope="module")
def nominal():
    return physics_of(PUPPY)


@pytest.fixture
def commands() -> Commands:
    """Four poses of two joints at uneven times."""
    goals = np.array([[0.1, -0.1], [0.2, -0.2], [0.3, -0.3], [0.4, -0.4]])
    return Commands(np.array([0.0, 0.1, 0.25, 0.45]), ("flb", "flm"), goals, goals * 10 + 20, np.ones((4, 2), bool), 0.6,
                    np.array([0, 1, 0, 1]))


# Servo constants


@pytest.mark.parametrize(("name", "parameters", "field", "expected"), [
    ("coulomb_friction", {"torque": 0.04}, "coulomb", lambda old: old + 0.04),
    ("viscous_friction", {"coefficient": 0.03}, "viscous", lambda old: old + 0.03),
    ("reflected_inertia", {"inertia": 0.003}, "inertia", lambda old: old + 0.003),
    ("dead_band", {"margin": 1.5}, "margin", lambda old: old + 1.5 * DEG),
    ("servo_gain", {"ratio": 0.7}, "gain", lambda old: old * 0.7),
    ("minimum_duty", {"duty": 0.04}, "punch", lambda old: old + 0.04),
    ("command_filter", {"time": 0.02}, "lag", lambda old: old + 0.02),
    ("damping_gain", {"gain": 0.03}, "derivative", lambda old: old + 0.03),
    ("goal_ramp", {"speed": 180.0}, "ramp", lambda old: np.full_like(old, np.pi)),
])
def test_a_servos_constant_changes_at_its_joint_alone(nominal, name, parameters, field, expected):
    law = physics_of(with_effect(name, ("flm", "tail"), **parameters)).law
    for f in fields(ServoLaw):
        old, new = getattr(nominal.law, f.name), getattr(law, f.name)
        if f.name != field:
            np.testing.assert_array_equal(new, old)
            continue
        changed = [PUPPY.joints.index(j) for j in ("flm", "tail")]
        np.testing.assert_allclose(new[changed], expected(old[changed]))
        np.testing.assert_array_equal(np.delete(new, changed), np.delete(old, changed))


def test_supply_voltage_sets_stall_torque_and_no_load_speed_of_all(nominal):
    """At V of 12 V rated: the stall torque is 1.5 V/12, the speed at which back-EMF takes it all 6.18 V/12."""
    law = physics_of(with_effect("supply_voltage", voltage=9.0)).law
    np.testing.assert_allclose(law.full_torque, 1.5 * 9 / 12)
    np.testing.assert_allclose(law.full_torque / law.back_emf, 6.18 * 9 / 12)
    np.testing.assert_array_equal(law.gain, nominal.law.gain)


def test_a_zero_offset_is_link_angle_less_servo_angle():
    """Commanded to its centre, the servo stands there, and the link off by the offset; logs see the servo."""
    model = with_effect("zero_offset", "flb", angle=10.0)
    np.testing.assert_allclose(physics_of(model).zero, np.where(np.array(model.joints) == "flb", 10 * DEG, 0))
    take = Simulation(model, SimulationConfig(base="fixed")).run(duration=0.01)
    plain = Simulation(PUPPY, SimulationConfig(base="fixed")).run(duration=0.01)
    knee = take.column("flb")
    assert 9.8 * DEG < take.q[-1, knee] - plain.q[-1, knee] < 10 * DEG, "it sags: it did not come from elsewhere, and beyond"
    np.testing.assert_allclose(take.as_logged().q[-1], take.q[-1] - physics_of(model).zero, atol=1e-12)


def test_effects_add_up_in_their_order(nominal):
    model = replace(PUPPY, effects=(EffectSpec("coulomb_friction", ("flm",), {"torque": 0.04}),
                                    EffectSpec("supply_voltage", (), {"voltage": 9.0}),
                                    EffectSpec("coulomb_friction", ("flm",), {"torque": 0.01})))
    law = physics_of(model).law
    assert law.coulomb[PUPPY.joints.index("flm")] == pytest.approx(0.06 + 0.05)
    np.testing.assert_allclose(law.full_torque, 1.5 * 9 / 12)


# Commands


def test_a_delay_of_all_moves_every_time(commands):
    late = apply_to_commands(commands, with_effect("command_delay", delay=0.03))
    np.testing.assert_allclose(late.times, commands.times + 0.03)
    assert late.end == pytest.approx(0.63)
    np.testing.assert_array_equal(late.goals, commands.goals)


@pytest.mark.parametrize("delay", [0.03, 0.1, 0.5])
def test_a_delay_of_one_joint_moves_its_goals_alone(commands, delay):
    """Also where it falls on another command (0.1) or is longer than the first dwells (0.5)."""
    late = apply_to_commands(commands, with_effect("command_delay", "flm", delay=delay))

    def goal(c: Commands, t: float, column: int) -> float:
        sent = np.searchsorted(c.times, t, side="right") - 1
        return float(c.goals[sent, column]) if sent >= 0 else 0.0

    for t in np.arange(-0.05, 1.2, 0.0137):
        assert goal(late, t, 0) == goal(commands, t, 0)
        assert goal(late, t, 1) == goal(commands, t - delay, 1)
    assert late.end == pytest.approx(0.6 + delay)
    first = np.argmax(late.goals[:, 1] != 0)
    assert late.times[first] == pytest.approx(delay, abs=1e-12)
    assert late.speeds[first, 1] == commands.speeds[0, 1]


@pytest.mark.parametrize("begun", [True, False])
@pytest.mark.parametrize("late", [(0.018, 0.0213), (0.0, 0.03), (0.1, 0.15)], ids=["apart", "one", "on other commands"])
def test_servos_that_hear_their_goals_at_different_times_do_as_if_delayed_one_by_one(commands, late, begun):
    """In one pass, as a search delays each joint of a robot by another time in every rollout."""
    sent = replace(commands, begun=begun)
    one_by_one = delay_commands(delay_commands(sent, [0], late[0]), [1], late[1])
    at_once = delay_each(sent, np.array(late))
    for name in ("times", "goals", "speeds", "enabled", "poses"):
        np.testing.assert_array_equal(getattr(at_once, name), getattr(one_by_one, name))
    assert at_once.end == pytest.approx(0.6 + max(late))


def test_what_is_sent_after_the_end_of_a_run_is_not_delayed(commands):
    whole, needed = (delay_each(commands, np.array([0.018, 0.0213]), until) for until in (np.inf, 0.3))
    heard = needed.times < 0.3
    assert 0 < len(needed.times) < len(whole.times)
    np.testing.assert_array_equal(needed.times[heard], whole.times[:heard.sum()])
    np.testing.assert_array_equal(needed.goals[heard], whole.goals[:heard.sum()])


def test_one_joint_may_be_later_than_all_are(commands):
    """Instants that differ only by rounding are one: adding the common delay would make them equal."""
    joint = 0.3 - 0.2  # another command's time, but for rounding
    both = PUPPY.with_effects((EffectSpec("command_delay", ("flm",), {"delay": joint}),
                               EffectSpec("command_delay", (), {"delay": 0.4})))
    late = apply_to_commands(commands, both)
    assert np.diff(late.times).min() > 1e-6
    assert late.end == pytest.approx(0.6 + joint + 0.4)


def test_clock_rate_stretches_times(commands):
    slow = apply_to_commands(commands, with_effect("clock_rate", ratio=1.02))
    np.testing.assert_allclose(slow.times, commands.times * 1.02)
    assert slow.end == pytest.approx(0.6 * 1.02)


def test_timing_drift_loses_the_same_at_each_pose(commands):
    late = apply_to_commands(commands, with_effect("timing_drift", per_pose=0.004))
    np.testing.assert_allclose(late.times, commands.times + 0.004 * np.arange(4))
    assert late.end == pytest.approx(0.6 + 4 * 0.004)


def test_a_dropped_command_keeps_the_pose_before(commands):
    all_missed = apply_to_commands(commands, with_effect("dropped_command", "flm", probability=1.0))
    np.testing.assert_array_equal(all_missed.goals[:, 1], 0)
    np.testing.assert_array_equal(all_missed.goals[:, 0], commands.goals[:, 0])
    none = apply_to_commands(commands, with_effect("dropped_command", "flm", probability=0.0))
    np.testing.assert_array_equal(none.goals, commands.goals)
    many = np.arange(1.0, 2001.0)[:, None] * np.ones((1, 2))
    long = Commands(many[:, 0], commands.joints, many, many, np.ones((2000, 2), bool), 2001.0, np.zeros(2000, int))
    some = apply_to_commands(long, with_effect("dropped_command", "flm", probability=0.3))
    missed = some.goals[:, 1] != many[:, 1]
    assert missed.mean() == pytest.approx(0.3, abs=0.04)
    held = np.maximum.accumulate(np.where(missed, 0, many[:, 1]))
    np.testing.assert_array_equal(some.goals[:, 1], held)
    np.testing.assert_array_equal(some.speeds[:, 1], held)
    np.testing.assert_array_equal(some.goals[:, 0], many[:, 0])


def test_speed_order_gives_the_kth_bus_id_the_kth_names_speed():
    speeds = np.arange(1.0, 16.0)[None]
    sent = Commands(np.zeros(1), PUPPY.joints, speeds / 10, speeds, np.ones((1, 15), bool), 0.1, np.zeros(1, int))
    got = apply_to_commands(sent, with_effect("speed_order"))
    by_id = sorted(PUPPY.joints, key=lambda j: BUS_IDS[j])
    for k, joint in enumerate(by_id):
        assert got.speeds[0, got.column(joint)] == k + 1
    np.testing.assert_array_equal(got.goals, sent.goals)
    with pytest.raises(InputError, match="'blb' has no bus ID"):
        apply_to_commands(sent, replace(PUPPY, bus_ids={}).with_effect(EffectSpec("speed_order")))


def test_a_take_keeps_what_was_sent(commands):
    """The recording's commands are what went out; what reached the servos shows in the motion."""
    late = with_effect("command_delay", "flm", delay=0.2)
    take = Simulation(late, SimulationConfig(base="fixed")).run(commands, duration=0.3)
    np.testing.assert_array_equal(take.commands.times, commands.times)
    moving = np.abs(np.rad2deg(take.q - take.q[0])) > 1
    assert take.time[np.argmax(moving[:, take.column("flm")])] > 0.2
    assert take.time[np.argmax(moving[:, take.column("flb")])] < 0.1


# Ground and forces


def test_ground_and_foot_friction_are_those_of_the_pair():
    assert physics_of(with_effect("ground_friction", friction=0.35)).ground == Ground(0.35, 1e5, 20.0)
    model = with_effect("foot_friction", "frb", friction=0.2)
    pairs = pair_friction(model)
    np.testing.assert_allclose(pairs["frb_link"], 0.2)
    np.testing.assert_allclose([f for link, found in pairs.items() if link != "frb_link" for f in found], 0.6)
    slippery = with_effect("ground_friction", friction=0.3).with_effect(EffectSpec("foot_friction", ("frb",), {"friction": 0.5}))
    pairs = pair_friction(slippery)
    assert (pairs["frb_link"][0], pairs["flb_link"][0]) == pytest.approx((0.5, 0.3))


def test_a_body_with_foot_friction_slides_as_that_friction_says():
    """Standing on a slope of 15 deg: friction 0.35 under every foot holds, tan 15 deg = 0.27 > 0.2 does not."""
    moved = []
    for friction in (0.35, 0.2):
        model = with_effect("ground_friction", friction=friction).with_effect(
            EffectSpec("ground_tilt", (), {"forward": 15.0, "left": 0.0}))
        take = Simulation(model, SimulationConfig(settle=0.2)).run(duration=0.4, lead=0.0)
        moved.append(take.p_WB[-1, 0] - take.p_WB[0, 0])
    assert moved[0] < 2e-3
    assert moved[1] > 0.02


@pytest.mark.parametrize(("effects", "foot"), [((), 1e4), ((EffectSpec("soft_ground", (), {"stiffness": 3e3}),), 3e3)])
def test_soft_ground_is_the_stiffness_of_the_contact_point(effects, foot):
    """Force over depth at rest, in series with the floor's own 1e5 N/m."""
    simulation = Simulation(replace(PUPPY, effects=effects))
    simulation.run(duration=0.05)
    context = simulation.diagram.GetSubsystemContext(simulation.plant, simulation.context)
    results = simulation.plant.get_contact_results_output_port().Eval(context)
    pairs = [results.point_pair_contact_info(i) for i in range(results.num_point_pair_contacts())]
    stiffness = [abs(c.contact_force()[2]) / c.point_pair().depth for c in pairs]
    assert len(pairs) >= 4
    np.testing.assert_allclose(stiffness, 1 / (1 / foot + 1 / 1e5), rtol=0.02)


def test_gravity_leans_in_the_floors_frame():
    gravity = physics_of(with_effect("ground_tilt", forward=10.0, left=-5.0)).gravity
    assert np.linalg.norm(gravity) == pytest.approx(9.81)
    assert gravity[2] < 0
    assert np.rad2deg(np.arctan2(gravity[0], -gravity[2])) == pytest.approx(10)
    assert np.rad2deg(np.arctan2(gravity[1], -gravity[2])) == pytest.approx(-5)
    simulation = Simulation(with_effect("ground_tilt", forward=10.0, left=0.0), SimulationConfig(base="fixed"))
    np.testing.assert_allclose(simulation.plant.gravity_field().gravity_vector(),
                               9.81 * np.array([np.sin(10 * DEG), 0, -np.cos(10 * DEG)]), atol=1e-9)


def test_a_tilt_and_a_pull_push_the_robot_alike():
    """Along the floor, by the robot's weight; a pull upwards has no tilt."""
    model = puppy_model()
    tilt, pull = known_effects()["ground_tilt"], known_effects()["tether_force"]
    weight = 9.81 * sum(model.kinematics.masses.values())
    spec = EffectSpec("ground_tilt", (), {"forward": 3.0, "left": -2.0})
    force = pull_x, pull_y, pull_z = tilt.as_other("tether_force", spec, model)
    lean = tilt.gravity(np.array([0.0, 0.0, -9.81]), si_values(tilt, spec))
    assert pull_x / weight == pytest.approx(lean[0] / -lean[2])
    assert pull_y / weight == pytest.approx(lean[1] / -lean[2])
    assert pull_z == 0.0
    assert pull.as_other("ground_tilt", EffectSpec("tether_force", (), {"force": force}), model) == pytest.approx((3.0, -2.0))
    assert tilt.as_other("soft_ground", spec, model) == ()
    assert pull.as_other("soft_ground", EffectSpec("tether_force", (), {"force": force}), model) == ()


def test_a_tether_is_held_by_the_feet():
    force = np.array([0.5, -0.3, 1.0])
    model = with_effect("tether_force", force=tuple(force))
    np.testing.assert_array_equal(physics_of(model).tether, force)
    take = Simulation(model).run(duration=0.1)
    held = sum(f[-5:].mean(axis=0) for f in take.contact.values())
    np.testing.assert_allclose(held, [-0.5, 0.3, WEIGHT - 1.0], atol=0.03)


def test_a_marker_frame_is_a_matter_of_the_measurement():
    m = Measurement(0.0)
    model = with_effect("marker_frame", "FLtop", rotation=(1.0, 0.0, -2.0))
    turned = apply_to_measurement(m, model)
    assert set(turned.frames) == {"FLtop"}
    np.testing.assert_allclose(turned.frames["FLtop"], np.deg2rad([1, 0, -2]))
    assert m.frames == {}
    twice = apply_to_measurement(m, with_effect("marker_frame", "FLtop", rotation=(1.0, 0.0, 0.0)).with_effect(
        EffectSpec("marker_frame", ("FLtop",), {"rotation": (2.0, 0.0, 0.0)})))
    np.testing.assert_allclose(twice.frames["FLtop"], np.deg2rad([3, 0, 0]), atol=1e-12)


def test_what_is_not_a_servos_leaves_servos_alone(nominal):
    for model in (with_effect("ground_tilt", forward=3.0, left=0.0), with_effect("tether_force", force=(1.0, 0.0, 0.0)),
                  with_effect("foot_friction", "flb", friction=0.3), with_effect("clock_rate", ratio=1.1)):
        physics = physics_of(model)
        assert physics.description is None
        for f in fields(ServoLaw):
            np.testing.assert_array_equal(getattr(physics.law, f.name), getattr(nominal.law, f.name))


# Specs


@pytest.mark.parametrize(("name", "where", "parameters", "problem"), [
    ("gearbox_gremlin", "flm", {}, "'gearbox_gremlin' is not known, or its package is not installed; known: backlash"),
    ("coulomb_friction", "flx", {"torque": 0.1}, "where: the robot has no 'flx'; did you mean flt?"),
    ("coulomb_friction", (), {"torque": 0.1}, "where: is empty; expected a joint"),
    ("coulomb_friction", "flm", {}, r"parameter 'torque' \[N m\] is missing"),
    ("coulomb_friction", "flm", {"torque": 0.1, "speed": 1.0}, "unknown parameter 'speed'"),
    ("coulomb_friction", "flm", {"torque": float("nan")}, "expected 0 to 1.5"),
    ("coulomb_friction", "flm", {"torque": (0.1, 0.1, 0.1)}, "'torque': expected one number"),
    ("tether_force", (), {"force": 1.0}, "'force': expected three numbers"),
    ("tether_force", "body_link", {"force": (0.0, 0.0, 0.0)}, "'body_link' is given, but it acts on the whole robot"),
    ("foot_friction", "flm", {"friction": 0.5}, "'flm' is not a foot"),
    ("marker_frame", "Tail", {"rotation": (0.0, 0.0, 0.0)}, "the robot has no 'Tail'; did you mean tail"),
])
def test_bad_specs_are_named(name, where, parameters, problem):
    with pytest.raises(InputError, match=problem):
        physics_of(with_effect(name, where, **parameters))


def test_parameters_come_to_si():
    """Degrees and deg/s become radians; SI values of the contract are unchanged."""
    effects = known_effects()
    spec = EffectSpec("dead_band", ("flm",), {"margin": 9.0})
    assert si_values(effects["dead_band"], spec) == {"margin": pytest.approx(np.pi / 20)}
    spec = EffectSpec("marker_frame", ("FLtop",), {"rotation": (180.0, 0.0, -90.0)})
    assert si_values(effects["marker_frame"], spec) == pytest.approx(
        {"rotation.0": np.pi, "rotation.1": 0.0, "rotation.2": -np.pi / 2})
    for effect in effects.values():
        for p in effect.parameters:
            assert p.si == pytest.approx(DEG if p.unit.startswith("deg") else 1.0), (effect.name, p.name)
            assert p.low < p.typical <= p.high, (effect.name, p.name)


def test_every_effect_of_the_contract_is_known_and_says_what_it_is():
    contract = {
        "backlash", "joint_compliance", "coulomb_friction", "viscous_friction", "supply_voltage",
        "servo_gain", "dead_band", "reflected_inertia", "joint_stop", "zero_offset", "parallel_spring",
        "command_delay", "timing_drift", "clock_rate", "dropped_command", "speed_order", "loose_mount",
        "link_length", "payload", "com_shift", "ground_friction", "foot_friction", "ground_tilt",
        "soft_ground", "tether_force", "marker_frame"}
    effects = known_effects()
    assert contract <= set(effects)
    example = {"joint": "flm", "foot": "flb", "link": "flm_link", "rigid_body": "FLmid"}
    for name in contract:
        effect = effects[name]
        values = {p.name: (p.typical,) * 3 if p.vector else p.typical for p in effect.parameters}
        for place in effect.places:
            spec = EffectSpec(name, (example[place],) if place in example else (), values)
            sentence = effect.sentence(spec)
            assert sentence.endswith("."), sentence
            assert "\n" not in sentence
            assert all(w in sentence for w in spec.where), sentence
            physics_of(PUPPY.with_effect(spec))


# Effects of other packages


PLUGIN = """
from dataclasses import replace
from workbench.effects.base import Effect, Parameter

class Sticky(Effect):
    name = {name!r}
    layer = "actuator"
    places = ("joint",)
    parameters = (Parameter("torque", "N m", 0.0, 1.0, 0.1),)

    def sentence(self, spec):
        return "Chewing gum."

    def law(self, law, columns, values):
        coulomb = law.coulomb.copy()
        coulomb[columns] *= 1 + values["torque"]
        return replace(law, coulomb=coulomb)

EFFECT = Sticky()
NOT_AN_EFFECT = 3
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Installs a distribution that offers an entry point, as pip would write it; a function of module text and entry."""

    def write(module: str, text: str, entry: str) -> None:
        install_plug_in(tmp_path, monkeypatch, module, text, ENTRY_POINT_GROUP, f"gum = {module}:{entry}")
        known_effects.cache_clear()

    yield write
    monkeypatch.undo()
    known_effects.cache_clear()


def test_another_package_adds_an_effect(install):
    install("gum_plugin", PLUGIN.format(name="chewing_gum"), "EFFECT")
    assert isinstance(known_effects()["chewing_gum"], Effect)
    model = with_effect("chewing_gum", "flm", torque=0.5)
    law = physics_of(model).law
    assert law.coulomb[PUPPY.joints.index("flm")] == pytest.approx(0.06 * 1.5)
    take = Simulation(model, SimulationConfig(base="fixed", settle=0.01)).run(duration=0.01)
    assert np.isfinite(take.q).all()


@pytest.mark.parametrize(("module", "name", "entry", "problem"), [
    ("gum_thief", "backlash", "EFFECT", "'backlash' is known already"),
    ("gum_wrapper", "gum", "NOT_AN_EFFECT", "expected Effect, got int")])
def test_a_plug_in_that_is_none_is_named(install, module, name, entry, problem):
    install(module, PLUGIN.format(name=name), entry)
    with pytest.raises(InputError, match=problem):
        known_effects()


def pair_friction(model) -> dict[str, list[float]]:
    """Friction of each foot shape with the ground in a station, by link, as Drake combines it: 2ab/(a + b)."""
    simulation = Simulation(model)
    plant, inspector = simulation.plant, simulation.diagram.scene_graph().model_inspector()

    def own(g) -> float:
        return inspector.GetProximityProperties(g).GetProperty("material", "coulomb_friction").dynamic_friction()

    ground = own(plant.GetCollisionGeometriesForBody(plant.world_body())[-1])
    out: dict[str, list[float]] = {}
    for g, link in model_geometries(plant, plant.GetBodyByName(model.base).model_instance()).items():
        if inspector.GetProximityProperties(g) is not None:
            out.setdefault(link, []).append(2 * own(g) * ground / (own(g) + ground))
    return out
