"""From rigid bodies to joint angles: yaw, pivots, start, base path, and the errors that these must not absorb."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.recording_robot import capture, motion, write_robot
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.recording import BodyTrack, Measurement, Take, observe, register, session_yaw, take_from_recording
from workbench.robot import RobotModel


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> RobotModel:
    return write_robot(tmp_path_factory.mktemp("robot"))


def predicted(model: RobotModel, zeroed: bool = True) -> Take:
    t = np.arange(-0.3, 1.5, 1e-3)
    return Take("predicted", "simulation", t, model.joints, motion(t, len(model.joints)), starts_at=0.0, zeroed=zeroed)


@pytest.mark.parametrize("yaw", np.deg2rad([0.0, 30.0, 95.0, 179.5, -60.0, -135.0]))
def test_angles_path_and_pivots_come_back_whatever_the_yaw(model, yaw):
    made = capture(model, yaw=yaw)
    m = register(made.recording, model, None, predicted(model))
    assert np.angle(np.exp(1j * (m.yaw - yaw))) == pytest.approx(0, abs=1e-4)
    assert m.starts_at == pytest.approx(made.start, abs=2e-4)
    take = take_from_recording(made.recording, m, model)
    assert set(take.joints) == set(model.joints) - {"neck"}
    for j in take.joints:
        np.testing.assert_allclose(take.q[:, take.column(j)], made.q[:, made.joints.index(j)], atol=1e-4)
    np.testing.assert_allclose(take.off_axis, 0, atol=3e-4)
    for asset, pivot in made.pivots.items():
        np.testing.assert_allclose(m.pivots[asset], pivot, atol=3 * m.pivot_sigma[asset].max() + 1e-4)
    np.testing.assert_allclose(take.p_WB - made.p_WB, np.broadcast_to((take.p_WB - made.p_WB)[0], take.p_WB.shape), atol=1e-3)
    assert take.p_WB[0, :2] == pytest.approx([0, 0], abs=1e-6)


def test_noise_is_measured_and_uncertainties_cover_the_truth(model):
    noise = np.deg2rad(0.12)
    misses = []
    for seed in range(6):
        made = capture(model, noise=noise, seed=seed)
        m = register(made.recording, model, None, predicted(model))
        assert np.median(list(m.noise.values())) == pytest.approx(noise * np.sqrt(2), rel=0.2)
        assert m.position_noise == pytest.approx(1e-4, rel=0.2)
        assert m.yaw == pytest.approx(made.yaw, abs=5 * m.yaw_sigma)
        misses.append((m.starts_at - made.start) / m.starts_at_sigma)
        take = take_from_recording(made.recording, m, model)
        z = (take.q - made.q[:, [made.joints.index(j) for j in take.joints]]) / take.q_sigma
        assert np.std(z) == pytest.approx(1, abs=0.2)
    assert np.max(np.abs(misses)) < 4


def test_one_yaw_of_a_session_and_a_loose_mount_does_not_turn_it(model):
    made = [capture(model, noise=2e-3, seed=s) for s in range(2)]
    bodies = dict(made[1].recording.rigid_bodies)
    rattle = Rotation.from_rotvec(np.outer(0.2 * np.sign(np.sin(20 * made[1].time)), [0, 1, 0]))
    shaken = Rotation.from_quat(bodies["FLmid"].quat, scalar_first=True) * rattle
    bodies["FLmid"] = replace(bodies["FLmid"], quat=shaken.as_quat(scalar_first=True))
    loose = replace(made[1].recording, rigid_bodies=bodies)
    found = session_yaw([made[0].recording, loose], model)
    assert found.yaw == pytest.approx(made[0].yaw, abs=np.deg2rad(0.1))
    m = register(loose, model, None, predicted(model), yaw=found.yaw)
    take = take_from_recording(loose, m, model)
    size = np.sqrt(np.mean(np.square(take.off_axis), axis=0))
    assert take.joints[np.argmax(size.max(axis=1))] == "flm"
    assert size.max() == pytest.approx(0.2, rel=0.1)
    assert np.sort(size.max(axis=1))[-2] < 0.01


def test_a_late_joint_and_a_dead_one_hardly_move_the_start(model):
    time = np.arange(360) / 120
    q = motion(time - 0.4137, len(model.joints))
    late, dead = model.joints.index("flm"), model.joints.index("brt")
    q[:, late] = motion(time - 0.4137 - 0.030, len(model.joints))[:, late]
    q[:, dead] *= 0.1
    made = capture(model, noise=2e-3, q=q)
    m = register(made.recording, model, None, predicted(model))
    assert m.starts_at == pytest.approx(0.4137, abs=1e-3)
    assert m.joint_starts["flm"] - m.starts_at == pytest.approx(0.030, abs=2e-3)


def test_start_given_is_kept_and_without_commands_is_asked_for(model):
    made = capture(model)
    assert register(made.recording, model, None, starts_at=0.25).starts_at == 0.25
    with pytest.raises(InputError, match="start: expected commands or starts_at"):
        register(made.recording, model, None)
    still = capture(model, q=np.zeros((360, len(model.joints))))
    with pytest.raises(InputError, match="yaw: no tracked joint turns"):
        register(still.recording, model, None, predicted(model))


def test_start_from_commands_alone_is_near(model):
    n = len(model.joints)
    goals = np.tile(np.deg2rad([[25.0], [-20.0], [0.0]]), (1, n))
    commands = Commands(np.array([0.0, 0.5, 1.0]), model.joints, goals, np.full((3, n), 2.0), np.ones((3, n), dtype=bool), 1.5,
                        np.arange(3))
    time = np.arange(360) / 120
    made = capture(model, q=commands.reference(time - 0.5 - 0.04), noise=2e-3)
    assert register(made.recording, model, commands).starts_at == pytest.approx(0.5, abs=0.01)


def test_half_a_turn_is_settled_by_commands_where_the_layout_is_silent(model):
    made = capture(model, yaw=2.5)
    keep = {a: made.recording.rigid_bodies[a] for a in ("FLtop", "FLmid")}
    few = replace(made.recording, rigid_bodies=keep)
    n = len(model.joints)
    goals = np.tile(np.deg2rad([30.0]), (1, n))
    commands = Commands(np.zeros(1), model.joints, goals, np.zeros((1, n)), np.ones((1, n), dtype=bool), 1.0,
                        np.zeros(1, dtype=int))
    high = made.q[:, model.joints.index("flm")]
    sign = np.sign(high.max() + high.min())
    found = session_yaw([few], model, [replace(commands, goals=sign * goals)])
    assert np.angle(np.exp(1j * (found.yaw - 2.5))) == pytest.approx(0, abs=1e-3)


def test_a_base_that_stands_needs_no_body_of_its_own(model):
    made = capture(model)
    bodies = {k: v for k, v in made.recording.rigid_bodies.items() if k != "body"}
    recording = replace(made.recording, rigid_bodies=bodies)
    free = take_from_recording(recording, Measurement(0.4, yaw=made.yaw), model, base="free")
    assert "tail" not in free.joints
    assert free.p_WB is None
    assert "tail" in take_from_recording(recording, Measurement(0.4, yaw=made.yaw), model, base="fixed").joints


def test_unknown_asset_markers_only_and_nothing_solved_are_refused(model):
    made = capture(model)
    strange = replace(made.recording, rigid_bodies={**made.recording.rigid_bodies, "ball": made.recording.rigid_bodies["body"]})
    for recording, text in ((strange, "asset 'ball': no link"),
                            (replace(made.recording, rigid_bodies={}, markers={"a": np.zeros((360, 3))}), "found only 1 markers"),
                            (replace(made.recording, rigid_bodies={}), "found nothing solved")):
        with pytest.raises(InputError, match=text):
            take_from_recording(recording, Measurement(0.4), model)
        with pytest.raises(InputError, match=text):
            register(recording, model, None, predicted(model))
    lacking = replace(model, rigid_bodies={**model.rigid_bodies, "body": "torso"})
    with pytest.raises(InputError, match="link 'torso', which the model lacks"):
        take_from_recording(made.recording, Measurement(0.4), lacking)


def test_a_simulated_take_through_the_measurement_is_what_the_cameras_saw(model):
    """Observing a rollout, then registering and reading it, gives the same angles, path and pivots, droop and tilt included."""
    t = np.arange(-0.3, 2.4, 1e-3)
    n = len(model.joints)
    droop = np.deg2rad(np.linspace(-3, 3, n))
    tilt = Rotation.from_euler("XY", [0.04, 0.05])
    base = Rotation.from_rotvec(np.outer(0.2 * np.maximum(t, 0), [0, 0, 1])) * tilt
    simulated = Take("s", "simulation", t, model.joints, motion(t, n) + droop, starts_at=0.0,
                     p_WB=np.column_stack([0.1 * np.maximum(t, 0), 0 * t, 0 * t + 0.19]), quat_WB=base.as_quat(scalar_first=True))
    rng = np.random.default_rng(3)
    pivots = {a: model.kinematics.centers[link] + rng.normal(0, 0.01, 3) for a, link in model.rigid_bodies.items()}
    m = Measurement(starts_at=0.4137, yaw=-1.1, origin=np.array([0.5, 0.3, 0.25]), pivots=pivots)
    clock = np.arange(330) / 120
    seen, bodies = observe(simulated, m, model, clock)
    made = capture(model)
    recording = replace(made.recording, rigid_bodies=bodies, time=clock, frames=np.arange(len(clock)))
    again = register(recording, model, None, simulated)
    take = take_from_recording(recording, again, model)
    assert again.yaw == pytest.approx(-1.1, abs=2e-3)
    assert again.starts_at == pytest.approx(0.4137, abs=5e-4)
    leaning = 0.0
    for j in take.joints:
        np.testing.assert_allclose(take.q[:, take.column(j)], seen.q[:, seen.column(j)], atol=5e-4)
        across, again_across = seen.off_axis[:, seen.column(j)], take.off_axis[:, take.column(j)]
        np.testing.assert_allclose(again_across, across, atol=1e-3)
        leaning = max(leaning, float(np.nanmax(np.abs(across))))
    assert leaning > 0.01, "joints of a robot that leans at rest turn about leaning axes"
    np.testing.assert_allclose(take.p_WB, seen.p_WB, atol=2e-3)
    np.testing.assert_allclose(np.abs(np.sum(take.quat_WB * seen.quat_WB, axis=1)), 1, atol=1e-5)
    for asset in pivots:
        np.testing.assert_allclose(again.pivots[asset], pivots[asset], atol=3 * again.pivot_sigma[asset].max() + 2e-3)
    predicted_again, bodies_again = observe(simulated, again, model, clock)
    for asset in pivots:
        np.testing.assert_allclose(bodies_again[asset].p, bodies[asset].p, atol=1.5e-3)
    assert np.isnan(predicted_again.q[clock > 2.4 + 0.42]).all()


def test_a_held_robot_that_droops_turns_about_axes_that_droop(model):
    """`observe` gives the same off-axis rotations as reading the bodies, although only joints droop at rest."""
    t = np.arange(-0.3, 2.4, 1e-3)
    n = len(model.joints)
    simulated = Take("s", "simulation", t, model.joints, motion(t, n) + np.deg2rad(np.linspace(-3, 3, n)), starts_at=0.0,
                     base="fixed")
    pivots = {a: model.kinematics.centers[link] for a, link in model.rigid_bodies.items()}
    m = Measurement(starts_at=0.4137, yaw=-1.1, origin=np.array([0.5, 0.3, 0.25]), pivots=pivots)
    clock = np.arange(330) / 120
    seen, bodies = observe(simulated, m, model, clock)
    recording = replace(capture(model).recording, rigid_bodies=bodies, time=clock, frames=np.arange(len(clock)))
    take = take_from_recording(recording, m, model, base="fixed")
    assert seen.off_axis is not None
    assert take.off_axis is not None
    across = np.array([seen.off_axis[:, seen.column(j)] for j in take.joints])
    again = np.array([take.off_axis[:, take.column(j)] for j in take.joints])
    np.testing.assert_allclose(again, across, atol=1e-4)
    assert np.nanmax(np.abs(across)) > 0.01


def test_bodies_that_hide_a_link_are_told(model):
    made = capture(model)
    bodies = {k: v for k, v in made.recording.rigid_bodies.items() if k != "FLtop"}
    take = take_from_recording(replace(made.recording, rigid_bodies=bodies), Measurement(0.4, yaw=made.yaw), model)
    assert not {"flt", "flm"} & set(take.joints)
    assert any("flm and flt" in p for p in take.problems)
    assert isinstance(take.bodies["FLmid"], BodyTrack)


def test_a_take_resampled_keeps_what_servos_do_not_turn(model):
    made = capture(model, noise=2e-3)
    m = register(made.recording, model, None, predicted(model))
    take = take_from_recording(made.recording, m, model, name="walk")
    assert (take.name, take.source, take.base) == ("walk", "recording", "free")
    half = take.resampled(take.time[::2])
    np.testing.assert_allclose(half.off_axis, take.off_axis[::2], atol=1e-12)
    np.testing.assert_allclose(half.q, take.q[::2], atol=1e-12)


def test_the_pose_of_a_held_base_is_kept_once_and_resampled_like_any_other() -> None:
    time, pose, turn = np.arange(0.0, 1.01, 0.1), np.array([0.3, -0.2, 0.1]), np.array([0.8, 0.6, 0.0, 0.0])
    held = Take("held", "simulation", time, ("a",), np.sin(time)[:, None], base="fixed",
                p_WB=np.broadcast_to(pose, (11, 3)), quat_WB=np.broadcast_to(turn, (11, 4)))
    copied = replace(held, p_WB=np.tile(pose, (11, 1)), quat_WB=np.tile(turn, (11, 1)))
    for at in (np.linspace(0.0, 1.0, 1000), np.array([-0.1, 0.0, 0.55, 1.0, 1.2, np.nan])):
        seen, usual = held.resampled(at), copied.resampled(at)
        np.testing.assert_array_equal(seen.p_WB, usual.p_WB)
        np.testing.assert_array_equal(seen.quat_WB, usual.quat_WB)
        np.testing.assert_array_equal(seen.q, usual.q)
    assert held.resampled(np.linspace(0.0, 1.0, 1000)).p_WB.strides[0] == 0
