"""Effects that change the robot's structure, against closed forms on a one-joint rig and a small arm, and on the puppy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.quadruped import quadruped_sdf
from tests.recording_robot import write_robot
from tests.servo_rig import GRAVITY, LENGTH, rig_model
from tests.shared_data import practice
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes, register_take
from workbench.effects.apply import apply_to_measurement, physics_of
from workbench.effects.base import si_values
from workbench.effects.registry import known_effects
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.recording import Measurement, Recording, Take, observe, take_from_recording
from workbench.recording.mocap.tracks import model_axes
from workbench.robot import EffectSpec, Kinematics, RobotModel, ServoConstants, puppy_model
from workbench.simulation import Simulation, SimulationConfig

SERVO = ServoConstants(compliance_slope=None, compliance_margin=None, punch=None, proportional_gain=8.0,
                       coulomb_friction=0.0)
MASS = 0.1
FIXED = SimulationConfig(base="fixed")
ARM = """<?xml version="1.0"?><sdf version="1.9" xmlns:drake="http://drake.mit.edu"><model name="arm">
<link name="base"><pose>0 0 0.5 0 0 0.1</pose><inertial><mass>1</mass></inertial></link>
<link name="upper"><pose relative_to="base">0 0 -0.05 0 0 0</pose>{inertial}<collision name="arm"><geometry><sphere><radius>0.12
</radius></sphere></geometry></collision></link>
<joint name="a" type="revolute"><parent>base</parent><child>upper</child><axis><xyz>0 1 0</xyz><dynamics><spring_stiffness>2
</spring_stiffness><spring_reference>0.3</spring_reference></dynamics></axis></joint>
<link name="fore"><pose relative_to="b"/>{inertial}</link>
<joint name="b" type="revolute"><pose relative_to="upper">0.02 0 -0.1 0 0 0.3</pose><parent>upper</parent><child>fore</child>
<axis><xyz expressed_in="base">0 1 0</xyz><limit><lower>-2</lower><upper>0.4</upper></limit></axis></joint>
<link name="hand"><pose relative_to="fore">0 0.01 -0.08 0.2 0 0</pose>{inertial}<visual name="shape"/>
<visual name="foot_shape"><pose>0 0 -0.05 0 0 0</pose></visual>
<collision name="foot"><pose>0.01 0 -0.06 0 0 0</pose>
<geometry><sphere><radius>0.01</radius></sphere></geometry></collision></link>
<joint name="c" type="revolute"><pose>0.03 0 0 0 0 0</pose><parent>fore</parent><child>hand</child>
<axis><xyz>1 0 0</xyz></axis></joint></model></sdf>"""
INERTIAL = ('<inertial><pose degrees="true">0.01 0 -0.03 0 0 90</pose><mass>0.2</mass><inertia><ixx>2e-4</ixx><iyy>1e-4</iyy>'
            "<izz>2.5e-4</izz></inertia></inertial>")


@pytest.fixture
def rig(tmp_path):
    return rig_model(tmp_path, SERVO, MASS)


@pytest.fixture
def arm(tmp_path) -> RobotModel:
    path = tmp_path / "arm.sdf"
    path.write_text(ARM.format(inertial=INERTIAL))
    return RobotModel(str(path), base="base", servos=dict.fromkeys("abc", SERVO))


def with_effects(model, *effects):
    for name, where, parameters in effects:
        model = model.with_effect(EffectSpec(name, (where,), parameters))
    return model


def tilted(model, **angles):
    """Gravity leans by angles [deg]."""
    return model.with_effect(EffectSpec("ground_tilt", (), {"forward": 0.0, "left": 0.0} | angles))


def at_rest(model, goals=None, config=FIXED, settle=1.5):
    """A run at whose end all is still, at `goals` {joint: rad}."""
    config = replace(config, settle=settle)
    if goals is None:
        return Simulation(model, config).run(duration=0.05, lead=0.0)
    goal = np.array([[goals.get(j, 0.0) for j in model.joints]])
    commands = Commands(np.zeros(1), model.joints, goal, np.zeros_like(goal), np.ones_like(goal, dtype=bool), 1.5,
                        np.zeros(1, int))
    return Simulation(model, config).run(commands, lead=0.1)


def changed(model) -> Kinematics:
    return Kinematics.from_text(physics_of(model).description, model.path)


def column(take, values, joint):
    return values[-1, take.column(joint)]


# Play and springs between servo and link


@pytest.mark.parametrize("approximation", ["lagged", "sap"])
@pytest.mark.parametrize("step", [1e-3, 4e-3])
def test_a_link_with_backlash_rests_on_the_flank_to_which_gravity_pulls_it(rig, approximation, step):
    gap = np.deg2rad(3.0)
    config = SimulationConfig(base="fixed", approximation=approximation, time_step=step)
    sides = []
    for lean in (20.0, -20.0):
        take = at_rest(tilted(with_effects(rig, ("backlash", "j", {"gap": 3.0})), forward=lean), config=config)
        sides.append(take.q[-1, 0] - take.servo_q[-1, 0])
        assert abs(take.v[-1, 0]) < 1e-4
        # Gravity turns the hanging mass forward, which is to the negative about y; the servo gives way likewise
        assert np.sign(take.q[-1, 0]) == np.sign(take.servo_q[-1, 0]) == -np.sign(lean)
    assert sides == pytest.approx([-gap / 2, gap / 2], abs=2e-5)


def test_backlash_within_its_gap_leaves_the_servo_without_load(rig):
    """Less than half the gap from hanging straight down, the link hangs straight down."""
    model = with_effects(rig, ("backlash", "j", {"gap": 6.0}))
    take = at_rest(model, {"j": np.deg2rad(2.0)})
    assert np.rad2deg(take.servo_q[-1, 0]) == pytest.approx(2.0, abs=1e-3)
    assert np.abs(np.rad2deg(take.q[-100:, 0])).max() < 0.3  # it swings a little still
    assert take.torque[-1, 0] == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("stiffness", [1.0, 20.0, 2000.0])
def test_a_compliant_joint_twists_by_its_torque_over_its_stiffness(rig, stiffness):
    take = at_rest(tilted(with_effects(rig, ("joint_compliance", "j", {"stiffness": stiffness})), forward=30.0), settle=8.0)
    torque = -MASS * GRAVITY * LENGTH * np.sin(np.deg2rad(30.0) + take.q[-1, 0])
    assert stiffness * (take.q[-1, 0] - take.servo_q[-1, 0]) == pytest.approx(torque, rel=2e-3)
    assert take.torque[-1, 0] == pytest.approx(-torque, rel=2e-3)


@pytest.mark.parametrize("step", [1e-4, 1e-3, 2e-3, 5e-3])
def test_a_stiff_spring_on_a_light_link_is_stable_at_any_step(rig, step):
    light = replace(rig, servos={"j": replace(SERVO, reflected_inertia=1e-3)})
    model = with_effects(light, ("joint_compliance", "j", {"stiffness": 1e4}), ("payload", "arm", {
        "mass": 0.1, "position": (0.0, 0.0, 0.1)}))
    goal = np.array([[0.5]])
    commands = Commands(np.zeros(1), ("j",), goal, 0 * goal, goal > 0, 0.4, np.zeros(1, int))
    take = Simulation(model, replace(FIXED, time_step=step)).run(commands)
    assert np.abs(take.q - take.servo_q).max() < 1e-3
    assert take.q[-1, 0] == pytest.approx(0.5, abs=5e-3)


def test_the_reflected_inertia_stays_on_the_servos_side(rig):
    """A link on a soft spring swings, its servo held, with its own inertia alone."""
    stiffness = 2.0
    heavy = replace(rig, servos={"j": replace(SERVO, reflected_inertia=1.0)})  # stands while the link swings
    model = with_effects(heavy, ("joint_compliance", "j", {"stiffness": stiffness}))
    simulation = Simulation(model, SimulationConfig(base="fixed", time_step=2e-4, log_period=1e-3))
    simulation._rest_in_neutral(None)  # settled; kept for the run below
    rest = simulation._rest[1]
    plant_context = simulation.diagram.GetMutableSubsystemContext(simulation.plant, rest)
    simulation.plant.GetJointByName("j_stage_1").set_angle(plant_context, 0.1)
    take = simulation.run(duration=0.5, lead=0.0)
    crossings = take.time[1:][np.diff(np.sign(take.q[:, 0])) != 0]
    period = 2 * np.mean(np.diff(crossings))
    inertia = MASS * LENGTH**2
    assert period == pytest.approx(2 * np.pi * np.sqrt(inertia / (stiffness + MASS * GRAVITY * LENGTH)), rel=0.02)


def test_a_loose_mount_rocks_about_its_axis_and_not_about_the_servos(rig):
    """Axis x in the link's frame; the servo turns about y, and carries the axis round with the link."""
    model = with_effects(rig, ("loose_mount", "j", {"play": 4.0, "axis": (0.5, 0.0, 0.0)}))
    half = np.deg2rad(2.0)
    sides = [at_rest(tilted(model, left=lean)).off_axis[-1, 0] for lean in (15.0, -15.0)]
    np.testing.assert_allclose(sides, [[half, 0, 0], [-half, 0, 0]], atol=2e-5)  # left is +y, about +x from straight down
    take = at_rest(tilted(model, left=15.0), {"j": np.deg2rad(90.0)})
    assert take.q[-1, 0] == pytest.approx(take.servo_q[-1, 0], abs=1e-6)
    angle = take.servo_q[-1, 0]
    turned = np.array([np.cos(angle), 0.0, -np.sin(angle)])  # x, turned about y
    off = take.off_axis[-1, 0]
    assert np.linalg.norm(off) == pytest.approx(half, abs=2e-5)
    assert abs(off @ turned) == pytest.approx(half, abs=2e-5)


def test_stages_add_up(rig):
    """A spring, play and a loose mount on one joint: each deflects as it does alone."""
    model = tilted(with_effects(rig, ("backlash", "j", {"gap": 3.0}), ("joint_compliance", "j", {"stiffness": 5.0}),
                                ("loose_mount", "j", {"play": 4.0, "axis": (1.0, 0.0, 0.0)})), forward=20.0, left=20.0)
    take = at_rest(model)
    lean = np.tan(np.deg2rad(20.0)) / np.sqrt(1 + 2 * np.tan(np.deg2rad(20.0)) ** 2)
    down = lean / np.tan(np.deg2rad(20.0))
    q = take.q[-1, 0]
    # The torque about y of the mass at (-sin q, cos q sin r, -cos q cos r), r the roll of the mount
    torque = -MASS * GRAVITY * LENGTH * np.cos(np.deg2rad(2.0)) * (np.cos(q) * lean + np.sin(q) * down)
    assert q - take.servo_q[-1, 0] == pytest.approx(-np.deg2rad(1.5) + torque / 5.0, abs=2e-4)
    assert np.linalg.norm(take.off_axis[-1, 0]) == pytest.approx(np.deg2rad(2.0), abs=1e-4)


@pytest.mark.parametrize("config", [
    SimulationConfig(base="fixed", drive="fast_servo"), SimulationConfig(base="fixed", drive="ideal"),
    SimulationConfig(base="fixed", time_step=0.0, integrator="cenic", accuracy=1e-3)], ids=["fast_servo", "ideal", "cenic"])
def test_play_is_there_whatever_drives_the_joint(rig, config):
    model = tilted(with_effects(rig, ("backlash", "j", {"gap": 3.0})), forward=20.0)
    take = at_rest(model, config=config)
    assert take.q[-1, 0] - take.servo_q[-1, 0] == pytest.approx(-np.deg2rad(1.5), abs=5e-4)


def test_hard_ends_are_refused_where_drake_would_ignore_them(rig):
    for name, parameters in (("backlash", {"gap": 3.0}), ("joint_stop", {"lower": -1.0, "upper": 1.0})):
        with pytest.raises(InputError, match="hard ends"):
            Simulation(with_effects(rig, (name, "j", parameters)), SimulationConfig(base="fixed", time_step=0.0))


def test_a_run_can_start_where_a_link_was_measured(rig):
    """The servo stands so that the link is where it was seen, springs and play as they rested."""
    loose = with_effects(rig, ("backlash", "j", {"gap": 3.0}), ("joint_compliance", "j", {"stiffness": 5.0}))
    model = tilted(loose, forward=20.0)
    take = Simulation(model, FIXED).run(duration=0.01, start=(np.array([0.3]), np.array([0.0])))
    assert take.q[0, 0] == pytest.approx(0.3, abs=1e-9)
    assert take.servo_q[0, 0] > 0.3 + np.deg2rad(1.5)


# Stops and springs across a joint


def test_a_joint_ends_at_its_stop(rig):
    model = with_effects(rig, ("joint_stop", "j", {"lower": -10.0, "upper": 15.0}))
    for goal, end in ((0.5, 15.0), (-0.5, -10.0)):
        assert np.rad2deg(at_rest(model, {"j": goal}).q[-1, 0]) == pytest.approx(end, abs=0.02)
    assert np.rad2deg(at_rest(model, {"j": 0.1}).q[-1, 0]) == pytest.approx(np.rad2deg(0.1), abs=1.0)


def test_a_nearer_end_in_the_description_stays(arm):
    k = changed(with_effects(arm, ("joint_stop", "b", {"lower": -60.0, "upper": 60.0})))
    assert (k.frames["b"].lower, k.frames["b"].upper) == pytest.approx((-np.pi / 3, 0.4))


def test_a_spring_across_a_joint_balances_its_servo(rig):
    """Servo gain times duty torque against spring and gravity: their equilibrium."""
    stiffness, goal = 3.0, 0.05
    q = at_rest(with_effects(rig, ("parallel_spring", "j", {"stiffness": stiffness})), {"j": goal}).q[-1, 0]
    servo = SERVO.gain * SERVO.torque_at_full_duty * (goal - q)
    assert servo == pytest.approx(stiffness * q + MASS * GRAVITY * LENGTH * np.sin(q), rel=1e-3)


def test_a_spring_adds_to_the_one_that_the_description_has(arm):
    """Springs k1 at r1 and k2 at 0 are one of k1 + k2 at k1 r1/(k1 + k2)."""
    text = physics_of(with_effects(arm, ("parallel_spring", "a", {"stiffness": 4.0}))).description
    assert "<spring_stiffness>6.0</spring_stiffness>" in text
    assert f"<spring_reference>{2 * 0.3 / 6!r}" in text


# Masses


def test_a_payload_adds_its_mass_at_its_point(arm):
    """Against the same point welded on as a body of its own, whatever axes the link's inertia is written in."""
    mass, at = 0.3, np.array([0.04, -0.02, -0.1])
    model = with_effects(arm, ("payload", "hand", {"mass": mass, "position": tuple(at)}))
    point = (f'<link name="point"><pose relative_to="hand">{at[0]} {at[1]} {at[2]} 0 0 0</pose><inertial><mass>{mass}</mass>'
             "<inertia><ixx>1e-12</ixx><iyy>1e-12</iyy><izz>1e-12</izz></inertia></inertial></link>"
             '<joint name="weld" type="fixed"><parent>hand</parent><child>point</child></joint></model>')
    welded = ARM.format(inertial=INERTIAL).replace("</model>", point)
    q = np.array([0.3, -0.4, 0.5])
    matrices = [mass_matrix(text, q) for text in (physics_of(model).description, welded)]
    np.testing.assert_allclose(matrices[0], matrices[1], rtol=1e-9, atol=1e-12)
    k = changed(model)
    assert k.masses["hand"] == pytest.approx(0.5)
    np.testing.assert_allclose(k.centers["hand"], (0.2 * np.array([0.01, 0, -0.03]) + mass * at) / 0.5)


def test_a_payload_is_to_the_links_centre_what_a_shift_of_it_is(arm):
    spec = EffectSpec("payload", ("hand",), {"mass": 0.1, "position": (0.03, -0.02, 0.05)})
    offset = known_effects()["payload"].as_other("com_shift", spec, arm)
    loaded, shifted = (changed(with_effects(arm, e)).centers["hand"] for e in (
        ("payload", "hand", dict(spec.parameters)), ("com_shift", "hand", {"offset": offset})))
    np.testing.assert_allclose(loaded, shifted, atol=1e-12)


def test_a_payload_pulls_its_servo_down(rig):
    bare, loaded = (at_rest(tilted(m, forward=30.0)) for m in (rig, with_effects(rig, ("payload", "arm", {
        "mass": 0.2, "position": (0.0, 0.0, -0.05)}))))
    for take, moment in ((bare, 0.1 * 0.1), (loaded, 0.1 * 0.1 + 0.2 * 0.05)):
        droop = take.q[-1, 0]
        torque = -GRAVITY * moment * np.sin(np.deg2rad(30.0) + droop)
        assert SERVO.gain * SERVO.torque_at_full_duty * droop == pytest.approx(torque, rel=2e-3)


def test_a_shifted_centre_of_mass_keeps_mass_and_inertia_about_it(arm):
    offset = np.array([0.01, 0.02, -0.03])
    k = changed(with_effects(arm, ("com_shift", "fore", {"offset": tuple(offset)})))
    assert k.masses["fore"] == 0.2
    np.testing.assert_allclose(k.centers["fore"], np.array([0.01, 0, -0.03]) + offset)
    inertia = body_inertia(physics_of(with_effects(arm, ("com_shift", "fore", {"offset": tuple(offset)}))).description, "fore")
    np.testing.assert_allclose(inertia, np.diag([1e-4, 2e-4, 2.5e-4]), atol=1e-18)  # about it, turned by 90 deg about z


# Lengths


@pytest.mark.parametrize(("link", "next_joint"), [("upper", "b"), ("fore", "c")])
def test_a_longer_link_carries_its_next_joint_on(arm, link, next_joint):
    change = 0.013
    old, new = arm.kinematics, changed(with_effects(arm, ("link_length", link, {"change": change})))
    q = np.random.default_rng(0).uniform(-1, 1, (5, 3))

    def way(k: Kinematics) -> np.ndarray:
        carrier = k.frames[k.parent_joint[link]]
        return k.frames[next_joint].X_PF_p + carrier.X_MB_R.T @ carrier.X_MB_p

    length = np.linalg.norm(way(old))
    np.testing.assert_allclose(way(new), way(old) * (1 + change / length), atol=1e-12)
    before, after = old.forward(q), new.forward(q)
    carried = [name for name in old.links if link in old.ancestors(name)]
    assert carried
    for name in old.links:
        np.testing.assert_allclose(after[name][1], before[name][1], atol=1e-12)
        shift = after[name][0] - before[name][0]
        expected = before[link][1] @ (way(old) / length * change) if name in carried else np.zeros((5, 3))
        np.testing.assert_allclose(shift, expected, atol=1e-12)
    assert new.masses == old.masses
    for name in old.links:
        np.testing.assert_allclose(new.centers[name], old.centers[name], atol=1e-15)


def test_a_last_links_length_is_to_its_foot(arm):
    """The shapes named so move, away from the joint; others stay."""
    text = physics_of(with_effects(arm, ("link_length", "hand", {"change": -0.01}))).description
    way = np.array([0.01 - 0.03, 0, -0.06])  # from the joint, which is off the link's origin
    shift = -0.01 * way / np.linalg.norm(way)
    positions = shape_positions(text, "hand")
    np.testing.assert_allclose(positions["foot"], np.array([0.01, 0, -0.06]) + shift, atol=1e-12)
    np.testing.assert_allclose(positions["foot_shape"], np.array([0, 0, -0.05]) + shift, atol=1e-12)
    np.testing.assert_allclose(positions["shape"], np.zeros(3))


def test_longer_legs_stand_higher():
    puppy = puppy_model()
    level = Simulation(puppy).run(duration=0.01)
    knees = puppy.with_effect(EffectSpec("link_length", ("flb_link", "frb_link", "blb_link", "brb_link"), {"change": 0.01}))
    thighs = puppy.with_effect(EffectSpec("link_length", ("flm_link", "frm_link", "blm_link", "brm_link"), {"change": 0.01}))
    for model in (knees, thighs):
        take = Simulation(model).run(duration=0.01)
        assert take.p_WB[-1, 2] - level.p_WB[-1, 2] == pytest.approx(0.01, abs=3e-4)


# What is seen


def test_links_are_where_the_plant_has_them(arm):
    model = tilted(with_effects(arm, ("backlash", "a", {"gap": 3.0}), ("loose_mount", "b", {"play": 5.0, "axis": (0.3, 0, 1.0)}),
                                ("link_length", "fore", {"change": 0.02})), forward=20.0)
    simulation = Simulation(model, FIXED)
    goal = np.array([[0.4, -0.5, 0.6]])
    commands = Commands(np.zeros(1), model.joints, goal, 0 * goal, np.ones((1, 3), bool), 0.3, np.zeros(1, int))
    take = simulation.run(commands)
    context = simulation.diagram.GetSubsystemContext(simulation.plant, simulation.context)
    for link in model.kinematics.links:
        X = simulation.plant.EvalBodyPoseInWorld(context, simulation.plant.GetBodyByName(link))
        np.testing.assert_allclose(take.links[link].p[-1], X.translation(), atol=1e-9)
        R = Rotation.from_quat(take.links[link].quat[-1], scalar_first=True).as_matrix()
        np.testing.assert_allclose(R, X.rotation().matrix(), atol=1e-9)
    assert set(take.links) == set(model.kinematics.links)


@pytest.fixture(scope="module")
def captured():
    """The puppy with play, a loose mount and a longer thigh, waving a leg, and a measurement with yaw and pivots."""
    model = with_effects(puppy_model(), ("backlash", "flb", {"gap": 4.0}), ("link_length", "frm_link", {"change": 0.02}),
                         ("loose_mount", "flm", {"play": 6.0, "axis": (1.0, 0.2, 0.0)}))
    goal = np.zeros((1, len(model.joints)))
    for joint, angle in (("flt", 0.5), ("flm", 0.7), ("flb", -0.6), ("frm", 0.4), ("tail", 0.1)):
        goal[0, model.joints.index(joint)] = angle
    commands = Commands(np.zeros(1), model.joints, goal, 0 * goal + 3.0, np.ones_like(goal, dtype=bool), 0.5, np.zeros(1, int))
    simulation = Simulation(tilted(model, left=10.0), FIXED)
    rng = np.random.default_rng(1)
    pivots = {a: rng.normal(0, 0.02, 3) for a in model.rigid_bodies}
    m = Measurement(starts_at=0.2041, yaw=0.8, origin=np.array([0.4, -0.2, 0.3]), pivots=pivots)
    return model, simulation.run(commands, lead=0.1), m


def recorded(bodies, clock) -> Recording:
    return Recording("made", "motive", "1.23", clock, np.arange(len(clock)), 120.0, rigid_bodies=bodies, sensing="mocap")


def test_cameras_see_the_links_of_a_changed_robot(captured):
    """Where links are, and the joint angles that a recording of them would be read to."""
    model, take, m = captured
    clock = np.arange(80) / 120
    zeroed, bodies = observe(take, m, model, clock)
    again = take_from_recording(recorded(bodies, clock), m, model, base="fixed")
    for joint in again.joints:
        c = zeroed.column(joint)
        np.testing.assert_allclose(zeroed.q[:, c], again.q[:, again.column(joint)], atol=1e-9)
        np.testing.assert_allclose(zeroed.off_axis[:, c], again.off_axis[:, again.column(joint)], atol=1e-9)
    moved = np.linalg.norm(zeroed.off_axis[-1, zeroed.column("flm")])
    assert moved < np.deg2rad(6.5)
    for c in range(len(model.joints)):  # as the simulation has them, but for the tilt in which they rest
        np.testing.assert_allclose(zeroed.q[-1, c], take.resampled(clock[-1:] - m.starts_at).q[0, c]
                                   - take.q[take.resting, c].mean(), atol=0.02)
    asset, link = "FRbtm", "frb_link"
    track = take.resampled(np.maximum(clock - m.starts_at, take.time[0])).links[link]
    p_W = track.p + Rotation.from_quat(track.quat, scalar_first=True).apply(m.pivots[asset])
    yaw = Rotation.from_euler("Z", m.yaw)
    p = yaw.apply(p_W - take.p_WB[0]) + m.origin
    np.testing.assert_allclose(model_axes(bodies[asset].p), p, atol=1e-9)


def test_given_links_and_the_models_kinematics_agree_where_nothing_is_changed(captured):
    _, _, m = captured
    puppy = puppy_model()
    model = with_effects(puppy, ("link_length", "flm_link", {"change": 0.0}))
    goal = np.full((1, len(model.joints)), 0.2)
    commands = Commands(np.zeros(1), model.joints, goal, 0 * goal + 2.0, np.ones_like(goal, dtype=bool), 0.2, np.zeros(1, int))
    take = Simulation(model).run(commands)
    clock = np.arange(45) / 120
    seen_links, bodies = observe(take, m, puppy, clock)
    seen_angles, same = observe(replace(take, links={}), m, puppy, clock)
    for asset in bodies:
        np.testing.assert_allclose(bodies[asset].p, same[asset].p, atol=1e-5)
        np.testing.assert_allclose(bodies[asset].quat, same[asset].quat, atol=5e-5)
    tracked = [seen_links.column(j) for j in model.joints if j not in ("neck", "head")]
    np.testing.assert_allclose(seen_links.q[:, tracked], seen_angles.q[:, tracked], atol=5e-4)  # the base rests a little tilted


def test_logs_see_the_servos_side(rig):
    model = with_effects(tilted(rig, forward=20.0), ("backlash", "j", {"gap": 3.0}), ("zero_offset", "j", {"angle": 4.0}))
    take = at_rest(model)
    logged = take.as_logged()
    assert np.rad2deg(logged.q[-1, 0]) == pytest.approx(np.rad2deg(take.q[-1, 0]) - 4.0 + 1.5, abs=1e-2)
    plain = Simulation(rig, FIXED).run(duration=0.01)
    assert plain.as_logged() is plain


def test_a_robot_as_modelled_carries_nothing_more(rig):
    """Nothing is computed for a build that is the model's, masses and stops included."""
    for model in (rig, with_effects(rig, ("payload", "arm", {"mass": 0.1, "position": (0.0, 0.0, 0.0)}),
                                    ("joint_stop", "j", {"lower": -50.0, "upper": 50.0}), ("backlash", "j", {"gap": 0.0}))):
        simulation = Simulation(model, FIXED)
        take = simulation.run(duration=0.01)
        assert simulation.plant.num_positions() == 1
        assert (take.servo_q, take.links, take.off_axis) == (None, {}, None)
    assert physics_of(rig).description is None


# Marker frames


def test_a_turned_marker_frame_shows_at_rest_as_its_own_rotation_and_as_opposite_angles_beside_it(captured):
    """The asset's frame is parallel to the capture's axes (x, y up, z right) at rest: components along these, at any yaw."""
    _, _, m = captured
    puppy = puppy_model()
    rotation = np.deg2rad([0.0, 0.0, 3.0])  # about right, where the hips' and knees' axes lie along
    model = puppy.with_effect(EffectSpec("marker_frame", ("FLmid",), {"rotation": (0.0, 0.0, 3.0)}))
    still = np.zeros((50, len(puppy.joints)))
    take = Take("s", "simulation", np.arange(50) * 0.01 - 0.2, puppy.joints, still, starts_at=0.0)
    m = replace(m, yaw=0.0)
    clock = np.arange(30) / 120
    zeroed, bodies = observe(take, apply_to_measurement(m, model), model, clock)
    quat = Rotation.from_rotvec(rotation).as_quat(scalar_first=True)
    np.testing.assert_allclose(bodies["FLmid"].quat, np.tile(quat, (30, 1)), atol=1e-12)
    np.testing.assert_allclose(bodies["FLbtm"].quat, np.tile([1.0, 0, 0, 0], (30, 1)), atol=1e-12)
    axis = {j: (puppy.kinematics.frames[j].X_PF_R @ puppy.kinematics.frames[j].axis) for j in ("flm", "flb")}
    for joint, sign in (("flm", 1), ("flb", -1)):
        expected = sign * axis[joint] @ model_axes(rotation)
        assert abs(expected) == pytest.approx(np.deg2rad(3.0))
        np.testing.assert_allclose(zeroed.q[:, zeroed.column(joint)], expected, atol=1e-12)
    others = [c for c, j in enumerate(puppy.joints) if j not in ("flm", "flb")]
    np.testing.assert_allclose(zeroed.q[:, others], 0, atol=1e-12)
    turned = observe(take, apply_to_measurement(replace(m, yaw=1.1), model), model, clock)[1]["FLmid"].quat
    np.testing.assert_allclose(turned, bodies["FLmid"].quat, atol=1e-12)


@pytest.mark.parametrize("asset", ["body", "FLtop"])
def test_turned_marker_frames_are_read_as_from_a_recording(captured, asset):
    model, take, m = captured
    turned = model.with_effect(EffectSpec("marker_frame", (asset,), {"rotation": (2.0, -5.0, 4.0)}))
    m, clock = apply_to_measurement(m, turned), np.arange(60) / 120
    zeroed, bodies = observe(take, m, turned, clock)
    again = take_from_recording(recorded(bodies, clock), m, turned, base="fixed")
    columns = [zeroed.column(j) for j in again.joints]
    np.testing.assert_allclose(zeroed.q[:, columns], again.q, atol=1e-9)
    np.testing.assert_allclose(zeroed.off_axis[:, columns], again.off_axis, atol=1e-9)
    np.testing.assert_allclose(zeroed.quat_WB, again.quat_WB, atol=1e-9)
    np.testing.assert_allclose(zeroed.p_WB, again.p_WB, atol=1e-9)
    plain = observe(take, replace(m, frames={}), model, clock)[1]
    np.testing.assert_allclose(bodies[asset].p, plain[asset].p, atol=1e-12)
    before, after = (Rotation.from_quat(b[asset].quat, scalar_first=True) for b in (plain, bodies))
    np.testing.assert_allclose(np.rad2deg((before.inv() * after).as_rotvec()), np.tile([2.0, -5.0, 4.0], (60, 1)), atol=1e-9)


# Any description, and bad input


def test_turned_link_frames_and_axes_in_the_models_frame(tmp_path):
    """Effects on a robot whose links are turned in neutral: play about the joint's own axis, a mount about the link's."""
    model = write_robot(tmp_path)
    k = changed(with_effects(model, ("backlash", "flm", {"gap": 3.0}),
                             ("loose_mount", "blm", {"play": 3.0, "axis": (1.0, 0.0, 0.0)})))
    q = np.random.default_rng(2).uniform(-0.5, 0.5, (4, len(model.joints)))
    poses = k.forward(np.column_stack([q, np.full((4, 2), 0.3)]), (*model.joints, "flm_stage_1", "blm_stage_1"))
    more = q.copy()
    more[:, model.joints.index("flm")] += 0.3
    nominal = model.kinematics.forward(more)
    for link in ("flm_link", "brm_link"):
        np.testing.assert_allclose(poses[link][0], nominal[link][0], atol=1e-12)
        np.testing.assert_allclose(poses[link][1], nominal[link][1], atol=1e-12)
    rocked = np.swapaxes(nominal["blm_link"][1], 1, 2) @ poses["blm_link"][1]
    np.testing.assert_allclose(Rotation.from_matrix(rocked).as_rotvec(), np.tile([0.3, 0, 0], (4, 1)), atol=1e-9)
    np.testing.assert_allclose(poses["blm_link"][0], nominal["blm_link"][0], atol=1e-12)


def test_neighbours_that_overlap_still_do_not_collide(arm):
    """The upper arm's ball reaches round the base and the forearm; a gear between them must not wake that up."""
    text = ARM.format(inertial=INERTIAL).replace('<visual name="shape"/>', "")
    ball = '<collision name="arm"><geometry><sphere><radius>0.1</radius></sphere></geometry></collision>'
    text = text.replace('<pose relative_to="b"/>', f'<pose relative_to="b"/>{ball}')
    arm.path.write_text(text)
    plain, loose = (at_rest(m) for m in (arm, with_effects(arm, ("joint_compliance", "b", {"stiffness": 1e4}))))
    np.testing.assert_allclose(loose.q[-1], plain.q[-1], atol=2e-3)


def test_a_quadruped_takes_all_of_them():
    model = RobotModel(str(quadruped_sdf()), servos={})
    effects = (("backlash", "flm", {"gap": 2.0}), ("joint_compliance", "frm", {"stiffness": 8.0}),
               ("loose_mount", "blm", {"play": 2.0, "axis": (1.0, 0.0, 0.0)}),
               ("joint_stop", "tail", {"lower": -5.0, "upper": 5.0}),
               ("parallel_spring", "neck", {"stiffness": 0.2}), ("link_length", "flb_link", {"change": 0.004}),
               ("link_length", "tail_link", {"change": -0.004}),
               ("payload", "body_link", {"mass": 0.1, "position": (0.0, 0.0, 0.05)}),
               ("com_shift", "brm_link", {"offset": (0.0, 0.01, 0.0)}))
    take = Simulation(with_effects(model, *effects)).run(duration=0.1)
    assert np.isfinite(take.q).all()
    assert np.abs(np.rad2deg(take.q[-1])).max() < 8
    assert np.abs(take.v[-1]).max() < 0.02
    weight = sum(f[-1, 2] for f in take.contact.values())
    assert weight == pytest.approx((sum(model.kinematics.masses.values()) + 0.1 + 3e-4) * GRAVITY, rel=5e-3)


def test_backlash_explains_another_engines_recording_of_it():
    """Four seconds on the stand of the practice session whose answer is 3 deg of play in flm: down to the noise."""
    session = load_session(practice("p1_backlash"))
    stand = next(t for t in read_takes(session)[0] if t.spec.name == "stand")
    errors = []
    for model in (stand.model, with_effects(stand.model, ("backlash", "flm", {"gap": 3.0}))):
        rollout = Simulation(model, replace(FIXED, contact_period=0.0)).run(stand.commands, duration=4.0, lead=0.3)
        take = register_take(stand, rollout, None)
        apart = (take.recorded.q - take.observe(rollout, model).q[:, [model.joints.index(j) for j in take.recorded.joints]])
        moving = np.isfinite(apart).all(axis=1) & (take.recorded.time > take.measurement.starts_at)
        errors.append(np.rad2deg(np.sqrt(np.mean(apart[moving, take.recorded.column("flm")] ** 2))))
    assert errors[0] > 1.0
    assert errors[1] < 0.25


@pytest.mark.parametrize(("effect", "where", "parameters", "problem"), [
    ("backlash", "upper", {"gap": 1.0}, "'upper' is not a joint"),
    ("backlash", "a", {"gap": -1.0}, "expected 0 to 30"),
    ("joint_compliance", "a", {"stiffness": 0.0}, "expected 0.2 to"),
    ("joint_compliance", "a", {}, "'stiffness' .* is missing"),
    ("loose_mount", "a", {"play": 1.0, "axis": (0.0, 0.0, 0.0)}, "axis: expected a direction other"),
    ("loose_mount", "b", {"play": 1.0, "axis": (0.2955202, 0.9553365, 0.0)}, "axis: expected a direction other"),
    ("joint_stop", "a", {"lower": 5.0, "upper": -5.0}, "lower below upper"),
    ("joint_stop", "b", {"lower": 30.0, "upper": 40.0}, "lower below upper"),
    ("link_length", "base", {"change": 0.01}, "has no joint"),
    ("link_length", "upper", {"change": -0.15}, "cannot change by -0.15"),
    ("link_length", "a", {"change": 0.01}, "'a' is not a link"),
    ("payload", "hand", {"mass": 0.1, "position": 0.2}, "'position': expected three numbers"),
    ("payload", "hand", {"mass": -0.1, "position": (0.0, 0.0, 0.0)}, "expected 0 to 5"),
    ("com_shift", "nowhere", {"offset": (0.0, 0.0, 0.0)}, "the robot has no 'nowhere'"),
])
def test_impossible_places_and_values_are_named(arm, effect, where, parameters, problem):
    with pytest.raises(InputError, match=problem):
        physics_of(with_effects(arm, (effect, where, parameters)))


def test_a_link_without_mass_or_end_is_named(rig, tmp_path):
    with pytest.raises(InputError, match="'base' has no <inertial>"):
        physics_of(with_effects(rig, ("payload", "base", {"mass": 0.1, "position": (0.0, 0.0, 0.0)})))
    with pytest.raises(InputError, match="expected a joint or a collision shape at its end"):
        physics_of(with_effects(rig, ("link_length", "arm", {"change": 0.01})))


def test_a_urdf_takes_effects_as_an_sdf_does(tmp_path):
    path = tmp_path / "rig.urdf"
    inertial = '<inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>'
    path.write_text(f'<robot name="r"><link name="base">{inertial}</link><link name="arm">{inertial}</link><joint name="j" '
                    'type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>'
                    '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>')
    physics = physics_of(with_effects(RobotModel(str(path), base="base"), ("backlash", "j", {"gap": 1.0})))
    assert physics.stages["j"]


@pytest.mark.parametrize(("name", "where", "parameters", "sentence"), [
    ("backlash", "flm", {"gap": 3.12}, "flm has 3.1 deg of free play between servo and link."),
    ("joint_compliance", "flm", {"stiffness": 8.0}, "flm is coupled to its servo with a stiffness of 8.0 N m/rad."),
    ("loose_mount", "flm", {"play": 2.0, "axis": (1.0, 0.0, 0.0)},
     "The link of flm is loose: it rocks by 2.0 deg about (1.00, 0.00, 0.00), which is not the servo's axis."),
    ("joint_stop", "flm", {"lower": -20.0, "upper": 30.0}, "flm goes no lower than -20.0 deg and no higher than 30.0 deg."),
    ("joint_stop", "flm", {"lower": -180.0, "upper": 12.56}, "flm goes no higher than 12.6 deg."),
    ("parallel_spring", "tail", {"stiffness": 0.2}, "tail is pulled back to neutral with 0.20 N m/rad, as if by a taut cable."),
    ("link_length", "flb_link", {"change": -0.004}, "flb_link is 4.0 mm shorter than in the model."),
    ("payload", "body_link", {"mass": 0.05, "position": (0.01, 0.0, -0.02)},
     "body_link carries an additional 50 g at (10, 0, -20) mm in its frame."),
    ("com_shift", "tail_link", {"offset": (0.005, 0.0, 0.0)},
     "The centre of mass of tail_link is displaced by (5.0, 0.0, 0.0) mm in the link's frame."),
    ("marker_frame", "FLtop", {"rotation": (1.0, 2.0, 3.0)}, "The marker frame of FLtop is rotated by (1.0, 2.0, 3.0) deg."),
])
def test_sentences(name, where, parameters, sentence):
    effect, spec = known_effects()[name], EffectSpec(name, (where,), parameters)
    si_values(effect, spec)  # valid
    assert effect.sentence(spec) == sentence


# Helpers that ask Drake


def parsed(text: str):
    from pydrake.geometry import SceneGraph
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    Parser(plant).AddModelsFromString(text, "sdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    return plant, scene_graph


def mass_matrix(text: str, q: np.ndarray) -> np.ndarray:
    plant, _ = parsed(text)
    context = plant.CreateDefaultContext()
    for joint, angle in zip("abc", q):
        plant.GetJointByName(joint).set_angle(context, angle)
    return plant.CalcMassMatrix(context)


def body_inertia(text: str, link: str) -> np.ndarray:
    """About the centre of mass, in the link's axes (3, 3)."""
    body = parsed(text)[0].GetBodyByName(link)
    M = body.default_spatial_inertia()
    return M.Shift(M.get_com()).CalcRotationalInertia().CopyToFullMatrix3()


def shape_positions(text: str, link: str) -> dict[str, np.ndarray]:
    """Positions of a link's shapes in its frame, as written."""
    from xml.etree import ElementTree

    element = next(e for e in ElementTree.fromstring(text).iter("link") if e.get("name") == link)
    return {s.get("name"): np.array([float(v) for v in (s.findtext("pose") or "0 0 0").split()[:3]])
            for s in element if s.tag in ("visual", "collision")}
