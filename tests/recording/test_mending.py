"""Damage put into sound recordings is found, reported, and undone or marked."""

from dataclasses import replace

import numpy as np
import pytest

from tests.recording_robot import capture, write_robot
from workbench.recording import BodyTrack, Measurement, Recording, survey, take_from_recording
from workbench.robot import RobotModel


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> RobotModel:
    return write_robot(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def made(model):
    return capture(model, noise=2e-3, seed=5)


def damaged(recording: Recording, **bodies: BodyTrack) -> Recording:
    return replace(recording, rigid_bodies={**recording.rigid_bodies, **bodies})


def take_of(recording: Recording, made, model):
    return take_from_recording(recording, Measurement(made.start, yaw=made.yaw, pivots=made.pivots,
                                                      noise=dict.fromkeys(model.joints, 2.8e-3)), model)


def exchanged(recording: Recording, a: str, b: str, first: int, end: int) -> Recording:
    A, B = recording.rigid_bodies[a], recording.rigid_bodies[b]
    out = {a: BodyTrack(A.p.copy(), A.quat.copy()), b: BodyTrack(B.p.copy(), B.quat.copy())}
    span = slice(first, end)
    for x, y in ((a, B), (b, A)):
        out[x].p[span], out[x].quat[span] = y.p[span], y.quat[span]
    return damaged(recording, **out)


@pytest.mark.parametrize("seed", range(5))
def test_sign_flips_change_nothing_and_are_counted(made, model, seed):
    rng = np.random.default_rng(seed)
    bodies = {a: BodyTrack(b.p, b.quat * rng.choice([-1.0, 1.0], size=(len(b.p), 1)))
              for a, b in made.recording.rigid_bodies.items()}
    flipped = replace(made.recording, rigid_bodies=bodies)
    take, sound = take_of(flipped, made, model), take_of(made.recording, made, model)
    np.testing.assert_allclose(take.q, sound.q, atol=1e-12)
    np.testing.assert_allclose(take.off_axis, sound.off_axis, atol=1e-12)
    assert sum("quaternion changed its sign" in p for p in take.problems) == len(bodies)
    assert not any("sign" in p for p in sound.problems)
    for body in take.bodies.values():
        assert (np.sum(body.quat[1:] * body.quat[:-1], axis=1) > 0).all()


def test_short_gaps_are_mended_with_their_uncertainty_long_ones_marked(made, model):
    body = made.recording.rigid_bodies["FLmid"]
    p, quat = body.p.copy(), body.quat.copy()
    for first, end in ((100, 104), (200, 230), (355, 360)):  # short, long, at the end
        p[first:end], quat[first:end] = np.nan, np.nan
    take = take_of(damaged(made.recording, FLmid=BodyTrack(p, quat)), made, model)
    sound = take_of(made.recording, made, model)
    c = take.column("flm")
    assert np.isfinite(take.q[100:104, c]).all()
    error = np.abs(take.q[100:104, c] - sound.q[100:104, c])
    assert (error < 3 * take.q_sigma[100:104, c] + 0.01).all()
    assert take.q_sigma[102, c] > 1.05 * take.q_sigma[90, c]
    assert np.isnan(take.q[200:230, c]).all()
    assert np.isnan(take.q[355:360, c]).all()
    assert np.isnan(take.q_sigma[200:230, c]).all()
    assert np.flatnonzero(take.mended).tolist() == [100, 101, 102, 103]
    assert ("FLmid: 39 of 360 frames unseen in 3 gap(s); 1 filled, up to 4 frames; "
            "2 left open, the longest 30 frames from 1.667 s") in take.problems
    others = [i for i, j in enumerate(take.joints) if j != "flm"]
    np.testing.assert_allclose(take.q[:, others], sound.q[:, others])


@pytest.mark.parametrize("pair", [("FLmid", "FRmid"), ("FLtop", "BLmid"), ("body", "tail"), ("FLtop", "FLmid")])
@pytest.mark.parametrize(("first", "end"), [(120, 124), (90, 260)])
def test_exchanged_labels_are_put_back(made, model, pair, first, end):
    take = take_of(exchanged(made.recording, *pair, first, end), made, model)
    sound = take_of(made.recording, made, model)
    np.testing.assert_allclose(take.q, sound.q, atol=1e-9)
    assert any(f"{pair[0]} and {pair[1]}: labels exchanged" in p or f"{pair[1]} and {pair[0]}: labels exchanged" in p
               for p in take.problems)
    assert take.mended[first:end].all()


@pytest.mark.parametrize(("first", "end"), [(0, 150), (150, 360)])
def test_the_tree_tells_which_side_of_a_single_change_is_wrong(made, model, first, end):
    take = take_of(exchanged(made.recording, "FLmid", "FRmid", first, end), made, model)
    np.testing.assert_allclose(take.q, take_of(made.recording, made, model).q, atol=1e-9)


def test_two_exchanges_that_follow_each_other(made, model):
    wrong = exchanged(exchanged(made.recording, "FLmid", "FRmid", 80, 90), "BLmid", "FRmid", 150, 170)
    np.testing.assert_allclose(take_of(wrong, made, model).q, take_of(made.recording, made, model).q, atol=1e-9)


def test_three_labels_that_go_round(made, model):
    wrong = exchanged(exchanged(made.recording, "FLmid", "FRmid", 80, 360), "BLmid", "FRmid", 150, 360)
    take = take_of(wrong, made, model)
    np.testing.assert_allclose(take.q, take_of(made.recording, made, model).q, atol=1e-9)
    assert any("FLmid and FRmid and BLmid: labels exchanged" in p and "to the end; put back" in p for p in take.problems)


@pytest.mark.parametrize("pair", [("FLmid", "FRmid"), ("FLtop", "FLmid"), ("BLtop", "FRmid")])
def test_labels_that_were_wrong_throughout_are_told_by_the_tree(made, model, pair):
    take = take_of(exchanged(made.recording, *pair, 0, 360), made, model)
    np.testing.assert_allclose(take.q, take_of(made.recording, made, model).q, atol=1e-9)
    assert any("360 frame(s) to the end; put back" in p for p in take.problems)


def test_a_body_that_is_on_no_such_link_is_told(made, model):
    astray = made.recording.rigid_bodies["FLmid"]
    p = astray.p + 0.2 * np.column_stack([np.sin(made.time), np.cos(2 * made.time), np.sin(3 * made.time)])
    take = take_of(damaged(made.recording, FLmid=BodyTrack(p, astray.quat)), made, model)
    assert any("FLtop and FLmid: their motion does not fit any joint" in text for text in take.problems)


@pytest.mark.parametrize("seed", range(8))
def test_exchanges_flips_and_gaps_together(made, model, seed):
    rng = np.random.default_rng(seed)
    a, b = rng.choice(list(made.recording.rigid_bodies), 2, replace=False)
    first = int(rng.integers(60, 250))
    wrong = exchanged(made.recording, a, b, first, first + int(rng.integers(2, 60)))
    bodies = {}
    for name, body in wrong.rigid_bodies.items():
        p, quat = body.p.copy(), body.quat * rng.choice([-1.0, 1.0], size=(len(body.p), 1))
        hole = int(rng.integers(20, 320))
        p[hole:hole + 3], quat[hole:hole + 3] = np.nan, np.nan
        bodies[name] = BodyTrack(p, quat)
    take = take_of(replace(wrong, rigid_bodies=bodies), made, model)
    sound = take_of(made.recording, made, model)
    assert np.isfinite(take.q).all()
    np.testing.assert_allclose(take.q[~take.mended], sound.q[~take.mended], atol=1e-9)
    assert np.abs(take.q - sound.q).max() < 0.05


def test_lone_leaps_are_cut_out(made, model):
    body = made.recording.rigid_bodies["BRmid"]
    p = body.p.copy()
    p[140:142] += 0.3
    take = take_of(damaged(made.recording, BRmid=BodyTrack(p, body.quat)), made, model)
    assert any("BRmid: 2 frame(s) leap away and back" in t for t in take.problems)
    np.testing.assert_allclose(take.bodies["BRmid"].p, take_of(made.recording, made, model).bodies["BRmid"].p, atol=3e-3)


def test_sound_fast_motion_is_left_alone(made, model):
    assert take_of(made.recording, made, model).problems == ()
    assert not take_of(made.recording, made, model).mended.any()


def test_missing_frames_become_gaps_on_an_even_clock(made, model):
    keep = np.ones(360, dtype=bool)
    keep[[50, 51, 52]] = False
    keep[200:240] = False
    bodies = {a: BodyTrack(b.p[keep], b.quat[keep]) for a, b in made.recording.rigid_bodies.items()}
    holed = replace(made.recording, rigid_bodies=bodies, frames=np.flatnonzero(keep) + 72210, time=made.recording.time[keep])
    take = take_of(holed, made, model)
    np.testing.assert_allclose(take.time, made.recording.time)
    assert np.isfinite(take.q[50:53]).all()
    assert np.isnan(take.q[200:240]).all()


def test_no_quaternion_at_all_is_a_gap(made, model):
    body = made.recording.rigid_bodies["FRmid"]
    quat = body.quat.copy()
    quat[100:150] = 0.0
    take = take_of(damaged(made.recording, FRmid=BodyTrack(body.p, quat)), made, model)
    assert np.isnan(take.q[100:150, take.column("frm")]).all()


def test_a_survey_needs_no_model(made):
    wrong = exchanged(made.recording, "FLmid", "FRmid", 100, 130)
    assert any("labels exchanged from 0.833 s, 30 frame(s)" in p for p in survey(wrong))
    p = np.zeros((360, 3))
    p[5:9] = np.nan
    assert survey(replace(made.recording, rigid_bodies={}, markers={"m": p})) == ("m: 4 of 360 frames unseen",)
