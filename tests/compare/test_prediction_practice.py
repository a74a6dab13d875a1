"""The practice robots, made by another engine, foretold with what was hidden in them typed into a model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.shared_data import practice
from workbench.compare.prediction import predict_session
from workbench.compare.session import load_session
from workbench.recording import BodyTrack
from workbench.recording.formats.read import read_recording
from workbench.robot import EffectSpec

HIDDEN = {
    "p1_backlash": ("FLmid", "FLtop", EffectSpec("backlash", ("flm",), {"gap": 3.0})),
    "p6_stiff_gearbox": ("FRmid", "FRtop", EffectSpec("coulomb_friction", ("frm",), {"torque": 0.18})),
}


def _joint_error(predicted: Path, recorded: Path, child: str, parent: str) -> float:
    """RMS of the rotation between two neighbouring bodies [deg]."""
    a, b = (read_recording(p).rigid_bodies for p in (predicted, recorded))
    seen = np.isfinite(np.hstack([b[n].quat for n in (child, parent)])).all(axis=1)

    def between(bodies: Mapping[str, BodyTrack]) -> Rotation:
        turn = {n: Rotation.from_quat(bodies[n].quat[seen], scalar_first=True) for n in (child, parent)}
        return turn[parent].inv() * turn[child]

    return float(np.rad2deg(np.sqrt(np.mean((between(a).inv() * between(b)).magnitude() ** 2))))


@pytest.mark.parametrize("name", HIDDEN)
def test_the_hidden_robot_is_foretold_to_the_noise(name: str, tmp_path: Path) -> None:
    folder = practice(name)
    session = load_session(folder / "session.yaml")
    child, parent, effect = HIDDEN[name]
    predict_session(session, session.model.with_effect(effect), tmp_path, nominal=session.model)
    for take, floor in (("hidden_stand", 0.3), ("hidden_walk", 0.4)):
        fitted, nominal = (_joint_error(tmp_path / f"{take}{kind}.csv", folder / f"answer/{take}.csv", child, parent)
                           for kind in ("", ".nominal"))
        assert fitted < 1.2 * floor
        assert nominal > 2 * floor


def test_a_standing_robot_is_foretold_to_the_noise(tmp_path: Path) -> None:
    folder = practice("p0_nothing_hidden")
    session = load_session(folder / "session.yaml")
    stand = replace(session, predict=tuple(p for p in session.predict if p.base == "fixed"))
    (path,) = predict_session(stand, session.model, tmp_path).paths
    for child, parent in (("FLmid", "FLtop"), ("BRbtm", "BRmid"), ("tail", "body")):
        assert _joint_error(path, folder / "answer/hidden_stand.csv", child, parent) < 0.33  # two bodies, 0.12 deg on each axis
    body, seen = (read_recording(p).rigid_bodies["body"].p for p in (path, folder / "answer/hidden_stand.csv"))
    assert np.sqrt(np.nanmean(np.sum((body - seen) ** 2, axis=1))) < 3e-4
