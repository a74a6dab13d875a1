"""Lengths and zeros that the bodies' ways tell, of the puppy moved by hand and seen by cameras that stand anywhere."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from workbench.effects.registry import known_effects
from workbench.effects.sdf import SdfRobot
from workbench.identify.estimators import geometry as built
from workbench.identify.options import CONCLUSIONS
from workbench.identify.parameters import Candidate
from workbench.identify.results.findings import Change
from workbench.recording.body_track import BodyTrack
from workbench.recording.mocap.tracks import capture_axes
from workbench.recording.recording import Measurement, Recording
from workbench.robot import EffectSpec, Kinematics, puppy_model

YAW, DROOP, ROWS = 0.3, np.deg2rad(2.0), 400
"""Of the cameras [rad]; of the hips at rest [rad]; frames."""


def filmed(kinematics, zeros=None, seed=0):
    """A recording of the robot held in the air, all its joints moving, with noise; frames zeroed where it hangs."""
    rng = np.random.default_rng(seed)
    model, k = puppy_model(), kinematics
    hips = np.array([DROOP if j in ("flm", "frm") else 0.0 for j in k.joints])
    turned = np.array([np.deg2rad((zeros or {}).get(j, 0.0)) for j in k.joints])
    t = np.arange(ROWS) / 120.0
    moves = np.column_stack([0.4 * np.sin(2 * np.pi * rng.uniform(0.5, 2) * t + rng.uniform(0, 6)) for _ in k.joints])
    poses, rest = k.forward(moves + hips + turned), k.forward((hips + turned)[None])
    cameras = Rotation.from_rotvec([0, 0, YAW])
    bodies = {}
    for asset, link in model.rigid_bodies.items():
        (p, R), (_, R0) = poses[link], rest[link]
        pivot = rng.uniform(-0.02, 0.02, 3)
        p = cameras.apply(p + R @ pivot) + 1e-4 * rng.standard_normal((ROWS, 3))
        noise = Rotation.from_rotvec(2e-3 * rng.standard_normal((ROWS, 3)))
        q = (noise * cameras * Rotation.from_matrix(R @ R0[0].T) * cameras.inv()).as_quat(scalar_first=True)
        bodies[asset] = BodyTrack(capture_axes(p), np.column_stack([q[:, 0], capture_axes(q[:, 1:])]))
    recording = Recording("hand.csv", "motive", "1.23", t, np.arange(ROWS), 120.0, rigid_bodies=bodies, sensing="mocap")
    measurement = Measurement(0.0, yaw=YAW, rest_pose={"flm": DROOP, "frm": DROOP})
    return SimpleNamespace(take=SimpleNamespace(recording=recording, measurement=measurement, spec=SimpleNamespace(base="fixed")))


def pool():
    known = known_effects()
    links, joints = ("flm_link", "frm_link", "flb_link"), ("flm", "frm", "flb")
    return [*(Candidate.of(known["link_length"], (link,), (0.0,)) for link in links),
            *(Candidate.of(known["zero_offset"], (joint,), (0.0,)) for joint in joints),
            Candidate.of(known["backlash"], ("flm",), (0.0,))]


def seen(evidence, monkeypatch, ill=(), model=None):
    monkeypatch.setattr(built, "channel_gaps", lambda e, r: dict.fromkeys(ill, 9.0))
    return built.geometry_of(model or puppy_model(), [evidence], {0: None})


def test_what_is_as_drawn_is_not_asked_about_and_what_cameras_do_not_see_is(monkeypatch):
    build = seen(filmed(puppy_model().kinematics), monkeypatch)
    left = {c.key for c in build.select_untried(pool())}
    assert left == {("link_length", ("flb_link",)), ("zero_offset", ("flb",)), ("backlash", ("flm",))}
    assert build.measured == ()
    assert build.added_to(puppy_model()) == puppy_model()


def test_a_longer_thigh_and_a_turned_hip_are_measured(monkeypatch):
    sdf = SdfRobot(puppy_model().path)
    sdf.lengthen("flm_link", 0.004)
    build = seen(filmed(Kinematics.from_text(sdf.text(), sdf.path), {"frm": -5.0}), monkeypatch)
    length, zero = build.measured
    assert (length.effect, length.where, zero.effect, zero.where) == ("link_length", "flm_link", "zero_offset", "frm")
    assert length.mean == pytest.approx(0.004, abs=3 * length.sigma)
    assert length.sigma < 4e-4
    assert zero.mean == pytest.approx(-5.0, abs=3 * zero.sigma)
    assert {c.where for c in build.select_untried(pool()) if c.name != "backlash"} == {("flb_link",), ("flb",)}
    with_them = build.added_to(puppy_model())
    assert [(e.effect, e.where) for e in with_them.effects] == [("link_length", ("flm_link",)), ("zero_offset", ("frm",))]
    error = Change(2.0, 1.0, "deg")
    finding = zero.finding(error, error)
    angle = finding.parameters["angle"]
    assert angle.low < zero.mean < angle.high
    assert (finding.where, finding.confidence, angle.unit) == (("frm",), CONCLUSIONS.surest, "deg")
    assert "cameras" in finding.evidence


def test_a_zero_is_fitted_where_droop_may_not_be_the_models(monkeypatch):
    build = seen(filmed(puppy_model().kinematics, {"frm": -5.0}), monkeypatch, ill=("frt",))
    assert build.measured == ()
    (zero,) = [c for c in build.select_untried(pool()) if c.where == ("frm",)]
    assert zero.size == 1
    assert zero.values([1.0])[0] == pytest.approx(-5.0, abs=0.5)


def test_a_model_that_has_lengths_or_zeros_of_its_own_is_left_alone(monkeypatch):
    mended = puppy_model().with_effect(EffectSpec("zero_offset", ("flm",), {"angle": 4.0}))
    build = seen(filmed(mended.kinematics), monkeypatch, model=mended)
    assert build.select_untried(pool()) == pool()
