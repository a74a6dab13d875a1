"""The synthetic recording that ships: small, labelled, loadable, and made with the model as it is now."""

import hashlib

import numpy as np
import pytest

from studies.other_engine import synthetic_walk
from workbench.compare.session import load_session
from workbench.recording import read_recording
from workbench.robot import data_file, puppy_model

SHIPPED = data_file("synthetic_walk")


def test_shipped_recording_is_labelled_small_and_a_session():
    readme = (SHIPPED / "README.md").read_text()
    assert "not a recording of a robot" in readme
    assert f"Seed {synthetic_walk.SEED}" in readme
    assert (SHIPPED / "walk.csv").stat().st_size < 1.5e6
    session = load_session(SHIPPED / "session.yaml")
    puppy = puppy_model()
    assert session.model.path == puppy.path
    assert session.model.ground.friction == puppy.ground.friction
    assert all(session.model.servo(j) == puppy.servo(j) for j in puppy.joints)
    recording = read_recording(session.takes[0].recording)
    assert len(recording.rigid_bodies) == 14
    assert recording.time[-1] > 6


def test_shipped_recording_was_made_with_the_model_as_it_is():
    sdf = hashlib.sha256(puppy_model().path.read_bytes()).hexdigest()
    assert sdf in (SHIPPED / "README.md").read_text(), "run python -m studies.other_engine.synthetic_walk"


@pytest.mark.slow
def test_script_makes_the_shipped_recording_again(tmp_path):
    synthetic_walk.make(tmp_path)
    ours, shipped = (read_recording(folder / "walk.csv").rigid_bodies for folder in (tmp_path, SHIPPED))
    first_steps = slice(0, 120)  # walking amplifies what another processor rounds otherwise
    for asset, track in shipped.items():
        np.testing.assert_allclose(ours[asset].p[first_steps], track.p[first_steps], atol=2e-4, err_msg=asset)
        np.testing.assert_allclose(ours[asset].quat[first_steps], track.quat[first_steps], atol=1e-3, err_msg=asset)
