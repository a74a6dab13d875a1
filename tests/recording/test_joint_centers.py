"""Axes of joints and the ways between them, from bodies whose paths are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from workbench.recording.mocap.joint_centers import LEAST_FRAMES, across, joint_center, spans
from workbench.recording.mocap.tracks import SeenJoint, Tracks

X, Y = np.eye(3)[0], np.eye(3)[1]
HIP, KNEE = np.array([0.02, 0.05, -0.01]), np.array([0.004, 0.006, -0.08])
PIVOTS = {"body": np.array([0.01, 0.0, 0.03]), "thigh": np.array([0.01, 0.02, -0.04]), "shank": np.array([-0.01, 0.0, -0.03])}


def leg(hip_axis=Y, rows=400, noise=0.0, turn=0.4, seed=0):
    """A body that goes somewhere, a thigh at HIP and a shank at KNEE of the thigh; frames as in neutral."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 6, rows)
    R = {"body": Rotation.from_rotvec(0.3 * np.column_stack([np.sin(t), np.cos(2 * t), t / 3]))}
    R["thigh"] = R["body"] * Rotation.from_rotvec(turn * np.sin(3 * t)[:, None] * hip_axis)
    R["shank"] = R["thigh"] * Rotation.from_rotvec(turn * np.cos(4 * t)[:, None] * Y)
    p = {"body": np.column_stack([t / 10, np.sin(t) / 20, 0.2 + 0 * t])}
    p["thigh"] = p["body"] + R["body"].apply(HIP)
    p["shank"] = p["thigh"] + R["thigh"].apply(KNEE)
    names = ("body", "thigh", "shank")
    seen_p = np.stack([p[n] + R[n].apply(PIVOTS[n]) for n in names]) + noise * 1e-4 * rng.standard_normal((3, rows, 3))
    turned = [Rotation.from_rotvec(noise * 2e-3 * rng.standard_normal((rows, 3))) * R[n] for n in names]
    seen_q = np.stack([r.as_quat(scalar_first=True) for r in turned])
    tracks = Tracks(t, 120.0, names, seen_p, seen_q, np.zeros((3, rows)), np.zeros(rows, dtype=bool))
    return tracks, [SeenJoint("hip", 0, 1, hip_axis), SeenJoint("knee", 1, 2, Y)]


def test_a_joint_is_where_both_bodies_carry_it_round_but_for_its_place_along_its_axis():
    tracks, joints = leg()
    hip = joint_center(tracks, joints[0])
    assert across(hip.in_parent + PIVOTS["body"] - HIP, Y, Y) == pytest.approx(np.zeros(3), abs=1e-9)
    assert across(hip.in_child + PIVOTS["thigh"], Y, Y) == pytest.approx(np.zeros(3), abs=1e-9)
    assert abs(hip.axis_in_child @ Y) == pytest.approx(1.0)


@pytest.mark.parametrize(("axis", "drawn"), [(Y, KNEE * [1, 0, 1]), (X, KNEE * [0, 0, 1])])
def test_how_far_apart_two_joints_are_shows_through_noise_to_a_tenth_of_a_millimetre(axis, drawn):
    exact = spans(*leg(axis))
    assert [(s.joint, s.following) for s in exact] == [("hip", "knee")]
    assert exact[0].way == pytest.approx(drawn, abs=1e-9)
    off, sigma = zip(*((np.linalg.norm(s.way) - np.linalg.norm(drawn), s.sigma)
                       for seed in range(20) for s in spans(*leg(axis, 2000, 1.0, seed=seed))))
    assert np.sqrt(np.mean(np.square(off))) < 1.2e-4
    assert np.sqrt(np.mean((np.array(off) / sigma) ** 2)) < 2.0


def test_what_hardly_turns_or_was_not_seen_says_nothing():
    assert spans(*leg(turn=0.01)) == []
    tracks, joints = leg()
    hidden = tracks.p.copy()
    hidden[1, LEAST_FRAMES - 1:] = np.nan
    assert spans(replace(tracks, p=hidden), joints) == []
    assert joint_center(tracks, replace(joints[0], parent=None)) is None
