from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.view_takes import capture, small_robot, swing
from workbench.robot import RobotModel
from workbench.view.playback import STAND_CLEARANCE, Playback, common_span, names_of, play


@pytest.fixture
def model(tmp_path: Path) -> RobotModel:
    return small_robot(tmp_path)


TIME = np.linspace(-0.2, 1.1, 40)


def lowest_foot(played: Playback) -> float:
    """The feet are spheres of 5 mm, 45 mm below the last link's origin."""
    feet = (played.in_world(link) for link in ("flb_link", "frb_link"))
    return min(float((p[:, 2] - 0.045 * R[:, 2, 2]).min()) - 0.005 for p, R in feet)


def test_links_are_where_kinematics_says(model: RobotModel) -> None:
    take = swing(model)
    played = play(take, model, TIME)
    q = np.column_stack([np.interp(TIME, take.time, c) for c in take.q.T])
    p_BL, R_BL = model.kinematics.forward(q)["flb_link"]
    R = Rotation.from_rotvec(np.outer(0.2 * np.clip(TIME, 0, None), [0, 0, 1])).as_matrix()
    p, R_WL = played.in_world("flb_link")
    np.testing.assert_allclose(p, played.base_p + np.einsum("fij,fj->fi", R, p_BL), atol=1e-6)
    np.testing.assert_allclose(R_WL, R @ R_BL, atol=1e-5)


def test_gaps_hold_what_was_last_seen(model: RobotModel) -> None:
    take = swing(model)
    seen = capture(take, noise=0.0)
    before = seen.since_start[59]  # the gap begins at frame 60
    played = play(seen, model, np.array([before, before + 0.05, before + 0.1]))
    np.testing.assert_allclose(played.q[1:], played.q[[0, 0]], atol=1e-12)
    np.testing.assert_allclose(played.base_p[1:], played.base_p[[0, 0]], atol=1e-12)
    assert np.abs(np.diff([np.interp(t, take.time, take.q[:, 0]) for t in (before, before + 0.1)])).max() > 0.05


def test_joints_nobody_measured_follow_the_simulation(model: RobotModel) -> None:
    take = swing(model)
    other = replace(take, q=take.q + 0.5)
    played = play(other, model, TIME)
    ghost = play(capture(take, joints=("flm",), gap=slice(0, 0)), model, TIME, like=(other, played))
    np.testing.assert_array_equal(ghost.q[:, 0], played.q[:, 0])  # flb
    assert np.abs(ghost.q[:, 1] - played.q[:, 1]).max() < 0.01  # zero at rest stands for 0.5, where the simulation rests


def test_a_recording_is_laid_over_the_simulation_at_rest(model: RobotModel) -> None:
    take = swing(model)
    turn, shift, tilt = Rotation.from_euler("z", 0.7), np.array([3.0, -2.0, 0.4]), Rotation.from_euler("y", 0.1)
    attitude = Rotation.from_quat(take.quat_WB, scalar_first=True)
    tilted = replace(take, quat_WB=(attitude * tilt).as_quat(scalar_first=True))
    played = play(tilted, model, TIME)
    # the same motion as a capture zeroes it: attitude from how it stood, in axes that are turned and moved
    moved = replace(capture(take, noise=0.0, gap=slice(0, 0)))
    quat = (turn * Rotation.from_quat(moved.quat_WB, scalar_first=True) * turn.inv()).as_quat(scalar_first=True)
    moved = replace(moved, p_WB=moved.p_WB @ turn.as_matrix().T + shift, quat_WB=quat)
    ghost = play(replace(moved, zeroed=True), model, TIME, like=(tilted, played))
    assert not np.allclose(ghost.base_p, moved.p_WB[0], atol=0.5)
    np.testing.assert_allclose(ghost.base_p[TIME < 0], played.base_p[TIME < 0], atol=1e-9)
    np.testing.assert_allclose(ghost.base_R[TIME < 0], played.base_R[TIME < 0], atol=1e-9)


def test_a_base_that_nobody_followed_stands_clear_of_the_floor(model: RobotModel) -> None:
    take = replace(swing(model), p_WB=None, quat_WB=None, base="fixed")
    played = play(take, model, TIME)
    assert lowest_foot(played) == pytest.approx(STAND_CLEARANCE)
    free = swing(model)
    ghost = play(take, model, TIME, like=(free, play(free, model, TIME)))
    np.testing.assert_allclose(ghost.base_p, np.tile(ghost.base_p[0], (len(TIME), 1)))
    np.testing.assert_allclose(ghost.base_p[0], [0, 0, 0.1], atol=1e-9)


def test_a_ghost_whose_body_was_not_recorded_goes_with_the_simulated_one(model: RobotModel) -> None:
    free = swing(model)
    walked = play(free, model, TIME)
    log = replace(swing(model), p_WB=None, quat_WB=None, source="log")
    np.testing.assert_array_equal(play(log, model, TIME, like=(free, walked)).base_p, walked.base_p)
    assert names_of(free, log) == ("simulated", "measured joints, body not recorded")
    assert names_of(free, replace(free, source="log")) == ("simulated", "measured")


def test_a_robot_on_a_stand_is_shown_just_above_the_floor(model: RobotModel) -> None:
    free = swing(model)
    hung = replace(free, base="fixed", p_WB=np.tile([0, 0, 1.3], (len(free), 1)))
    played = play(hung, model, TIME)
    assert lowest_foot(played) == pytest.approx(STAND_CLEARANCE)
    ghost = play(capture(hung, gap=slice(0, 0)), model, TIME, like=(hung, played))
    np.testing.assert_allclose(ghost.base_p, played.base_p, atol=1e-9)


def test_span_is_what_all_takes_cover(model: RobotModel) -> None:
    take = swing(model)
    first, last = common_span([take, capture(take)])
    assert first == pytest.approx(-0.25)
    assert last == pytest.approx(take.time[-1], abs=0.01)


def test_names_tell_two_simulations_apart(model: RobotModel) -> None:
    take = swing(model)
    assert names_of(take, capture(take)) == ("simulated", "measured")
    assert names_of(take, replace(take, name="hydroelastic")) == ("swing", "hydroelastic")
    assert len(set(names_of(take, take))) == 2
