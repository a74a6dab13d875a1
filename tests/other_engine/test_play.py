"""The other engine's mechanics: the same robot as Drake's, closed forms of pendulum, servo and contact."""

import mujoco
import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from studies.other_engine import describe, play
from studies.other_engine.bench import NativePlayer, Race, fastest_within, joint_error, race
from studies.other_engine.firmware import commands_from_rows, read_rows
from studies.other_engine.mjcf import compile_model
from studies.other_engine.servo import ServoBank
from tests.other_engine_models import CROOKED, FRICTIONLESS, as_take, commands, joint, link, model_of, pendulum, sphere
from tests.shared_data import shared
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.recording import read_recording, register, take_from_recording
from workbench.robot import EffectSpec

AX12 = FRICTIONLESS.updated({"compliance_margin": 1, "punch": 32, "coulomb_friction": 0.06, "viscous_friction": 0.01,
                             "reflected_inertia": 0.0065})


@pytest.fixture
def crooked(tmp_path):
    return model_of(tmp_path / "crooked.sdf", CROOKED)


def test_masses_centres_and_inertias_are_drakes(crooked):
    description = describe(crooked.path)
    servos = ServoBank([crooked.servo(j) for j in description.joints])
    compiled = compile_model(description, servos, crooked.ground, "fixed", 1e-3)
    data = mujoco.MjData(compiled)
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(crooked.path)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    rng = np.random.default_rng(1)
    for _ in range(5):
        for name, angle in zip(description.joints, rng.uniform(-1, 1, 3)):
            data.joint(name).qpos[0] = angle
            plant.GetJointByName(name).set_angle(context, angle)
        mujoco.mj_forward(compiled, data)
        ours = np.empty((3, 3))
        mujoco.mj_fullM(compiled, data, ours)
        order = [compiled.joint(plant.get_joint(i).name()).dofadr[0] for i in plant.GetJointIndices()
                 if plant.get_joint(i).num_velocities()]
        drakes = plant.CalcMassMatrix(context) + 1e-4 * np.eye(3)  # Drake's plant has no reflected inertia here
        np.testing.assert_allclose(ours[np.ix_(order, order)], drakes, rtol=1e-8, atol=1e-12)
        base = plant.GetBodyByName("base")
        com = plant.CalcCenterOfMassPositionInWorld(context) - base.EvalPoseInWorld(context).translation()
        np.testing.assert_allclose(data.subtree_com[1] - data.xpos[1], com, atol=1e-9)
    assert compiled.body_subtreemass[1] == pytest.approx(plant.CalcTotalMass(context))


def test_pendulum_swings_with_its_period(tmp_path):
    mass, length = 0.2, 0.1
    model = model_of(tmp_path / "pendulum.sdf", pendulum(mass, length))
    run = play(model, commands([0.0, 0.5], [0.05, 0.0], 4, [True, False]), 4, base="fixed", settle=0.1)
    free = run.time > 0.6
    v, t = run.v[free, 0], run.time[free]
    crossings = t[:-1][(v[:-1] < 0) & (v[1:] >= 0)]
    inertia = mass * length**2 + 1e-7 + FRICTIONLESS.reflected_inertia
    expected = 2 * np.pi * np.sqrt(inertia / (mass * 9.81 * length))
    assert np.mean(np.diff(crossings)) == pytest.approx(expected, rel=2e-3)
    assert np.max(np.abs(run.q[-2000:])) > 0.9 * np.max(np.abs(run.q[free][:2000])), "nothing damps a servo that is off"


def test_coulomb_friction_holds_below_its_torque_and_slips_above(tmp_path):
    for mass, holds in ((0.05, True), (0.09, False)):  # 0.049 and 0.088 N m on 0.06 N m of friction
        model = model_of(tmp_path / f"held{mass}.sdf", pendulum(mass, -0.1, "0 1 0"), AX12)
        run = play(model, commands([0.0, 1.0], [np.pi / 2, 0.0], 3, [True, False]), 3, base="fixed", settle=0.1)
        after = run.q[run.time > 1.1, 0]
        moved = abs(after[-1] - after[0])
        assert moved < np.deg2rad(0.01) if holds else moved > 0.5


def test_servo_rests_where_duty_and_friction_balance_the_load(tmp_path):
    mass, length, goal = 0.3, 0.1, 1.0
    model = model_of(tmp_path / "loaded.sdf", pendulum(mass, length), AX12)
    run = play(model, commands([0.0], [goal], 3), 3, base="fixed", settle=0.1)
    q = run.q[-1, 0]
    bank = ServoBank([AX12])
    drive = bank.duty(np.array([goal - q]))[0] * bank.full_torque[0]
    assert abs(run.v[-1, 0]) < 1e-4
    assert abs(drive - mass * 9.81 * length * np.sin(q)) <= 0.06 + 1e-6
    assert drive > 0.1


def test_unloaded_servo_reaches_its_no_load_speed(tmp_path):
    model = model_of(tmp_path / "spinner.sdf", pendulum(0.05, 0.02, "0 0 1"))
    run = play(model, commands([0.0], [2.4], 0.5), 0.5, base="fixed", settle=0.1)
    assert np.max(run.v) == pytest.approx(6.18 * 11.1 / 12, rel=5e-3)


def test_moving_speed_is_kept(tmp_path):
    model = model_of(tmp_path / "slow.sdf", pendulum(0.05, 0.02, "0 0 1"))
    run = play(model, commands([0.0], [2.0], 1.0, speed=1.5), 1.0, base="fixed", settle=0.1)
    assert run.v[np.abs(run.time - 0.8) < 0.1, 0] == pytest.approx(1.5, rel=1e-2)


def block(mass: float) -> str:
    feet = "".join(sphere(x, y, -0.02) for x in (-0.03, 0.03) for y in (-0.02, 0.02))
    return (link("base", "0 0 0.1 0 0 0", mass, "0 0 0 0 0 0", "1e-3 1e-3 1e-3 0 0 0", feet)
            + link("bob", "0 0 0.1 0 0 0", 0.01, "0 0 0 0 0 0") + joint("swing", "base", "bob", "0 0 1"))


def test_ground_carries_the_weight_at_the_stated_stiffness(tmp_path):
    model = model_of(tmp_path / "block.sdf", block(1.0))
    run = play(model, commands([0.0], [0.0], 0.1), 0.1)
    weight = 1.01 * 9.81
    np.testing.assert_allclose(run.contact["base"][-1], [0, 0, weight], atol=1e-3 * weight)
    sunk = 0.02 + 0.005 - run.poses(run.time[-1:], ("base",))["base"][0][0, 2]
    assert weight / 4 / sunk == pytest.approx(5e4, rel=0.25), "foot and ground of 1e5 N/m in series"


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_feet_slide_when_gravity_leans_beyond_the_friction_cone(tmp_path, share):
    model = model_of(tmp_path / "slope.sdf", block(1.0))
    description = describe(model.path)
    compiled = compile_model(description, ServoBank([FRICTIONLESS]), model.ground, "free", 5e-4)
    slope = np.arctan(0.6 * share)
    compiled.opt.gravity[:] = 9.81 * np.array([np.sin(slope), 0, -np.cos(slope)])
    data = mujoco.MjData(compiled)
    mujoco.mj_step(compiled, data, 2000)
    slid = data.xpos[1, 0]
    assert slid < 2e-3 if share < 1 else slid > 0.2


def test_play_refuses_unknown_effects_and_bases_and_robots_that_cannot_float(tmp_path, crooked):
    effect = EffectSpec("gremlins", ("hip",), {"number": 3.0})
    some = commands([0.0], [0.0], 0.1)
    with pytest.raises(ValueError, match="gremlins"):
        play(crooked.with_effect(effect), some, 0.1)
    with pytest.raises(ValueError, match="free or fixed"):
        play(crooked, some, 0.1, base="hung")
    weld = '<joint name="weld" type="fixed"><parent>world</parent><child>base</child></joint>'
    with pytest.raises(InputError, match="cannot float"):
        play(model_of(tmp_path / "bolted.sdf", CROOKED + weld), some, 0.1)


@pytest.mark.parametrize(("name", "allowed"), [("stand", 1.15), ("walk", 1.5)])
def test_practice_session_with_nothing_hidden_is_reproduced(name, allowed):
    session = load_session(shared("practice/p0_nothing_hidden/session.yaml"))
    folder = session.path.parent
    spec = next(t for t in session.takes if t.name == name)
    rows = read_rows(folder / f"motions/{name}.csv")
    poses = commands_from_rows(*rows, cycles=spec.cycles)
    run = play(session.model, poses, poses.end + 0.5, base=spec.base)
    recording = read_recording(folder / f"takes/{name}.csv")
    seen = register(recording, session.model, poses, as_take(run), base=spec.base)
    take = take_from_recording(recording, seen, session.model, base=spec.base)
    for seen_joint in take.joints:
        ours = run.q[:, run.joints.index(seen_joint)]
        error = take.q[:, take.column(seen_joint)] - np.interp(take.since_start, run.time, ours - ours[0])
        rms = np.sqrt(np.nanmean(error[take.since_start > 0] ** 2))
        assert rms < allowed * np.sqrt(2) * np.deg2rad(0.12), f"{seen_joint}: {np.rad2deg(rms):.3f} deg"
    walked = np.linalg.norm((take.p_WB[-5] - take.p_WB[5])[:2])
    assert np.linalg.norm(np.ptp(run.qpos[[0, -1]][:, :2], axis=0)) * (name == "walk") == pytest.approx(walked, abs=0.02)


@pytest.fixture
def swinging(tmp_path):
    model = model_of(tmp_path / "bench.sdf", pendulum(0.2, 0.1), AX12)
    rows = np.array([0.0, 0.2, 0.4, 0.65]), np.array([[0.0], [30.0], [-20.0], [0.0]])
    return model, commands_from_rows(("swing",), *rows)


def test_servo_law_of_mujocos_own_actuators_is_the_same(swinging):
    model, poses = swinging
    native = NativePlayer(model, poses, 0.65, "fixed", 5e-4)
    run = play(model, poses, 0.65, 0.0, "fixed")
    assert joint_error(native.time, native.run(), run.time, run.q) < np.deg2rad(0.005)
    np.testing.assert_array_equal(native.run(), native.run())


def test_race_errors_shrink_with_the_step_and_the_fastest_that_is_good_enough_wins(swinging):
    model, poses = swinging
    races = race(model, poses, 0.65, "fixed", timesteps=(1e-3, 4e-3), repeats=1)
    assert races[0].error < 0.5 * races[1].error
    assert all(r.steps_per_second > 100 for r in races)
    picked = fastest_within([Race(1e-3, 1.0, 1e4), Race(2e-3, 2.0, 1e4), Race(4e-3, 4.0, 1e4)], 2.5)
    assert picked.timestep == 2e-3
    assert picked.real_time_factor == pytest.approx(20)
    with pytest.raises(ValueError, match="finer"):
        fastest_within(races, races[0].error / 2)
