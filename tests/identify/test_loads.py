"""What only a load shows is proposed where gravity loads the joint."""

import numpy as np
import pytest

from tests.evidence.rig_logs import record
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes
from workbench.identify.options import PROBLEM
from workbench.identify.preparation import prepare
from workbench.identify.proposals import HELD, NO_CAMERA, candidates, steady_loads, unloaded_joints, unobservable
from workbench.simulation import SimulationConfig
from workbench.view.report.words import hidden_effects

LOADED = {"backlash", "joint_compliance", "load_friction"}


@pytest.fixture(scope="module")
def logged(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rig")
    session = record(folder)
    config = SimulationConfig(settle=0.6, contact_period=0, time_step=PROBLEM.time_step)
    return folder, session.model, prepare(session, read_takes(session)[0][:1], config, 1, lambda *_: None).evidence


def test_an_arm_that_hangs_is_loaded_by_its_weight(logged):
    _, model, (e,) = logged
    most = 0.5 * 9.81 * 0.1 * np.abs(np.sin(e.take.recorded.q)).max()
    assert steady_loads(model, e) == pytest.approx([most], rel=0.05)  # of a sample of the poses
    assert unloaded_joints(model, [e]) == set()
    assert {c.name for c in candidates(model, [e])} >= LOADED


def test_what_a_held_log_cannot_show_is_listed_with_the_reason(logged):
    _, model, (e,) = logged
    hidden = unobservable(model, [e])
    assert hidden["ground_friction"] == HELD
    assert hidden["marker_frame"] == NO_CAMERA
    assert hidden[f"payload at {model.base}"] == HELD
    assert not {"coulomb_friction", "payload", "backlash"} & set(hidden)
    assert not set(hidden) & {c.name for c in candidates(model, [e])}
    said = " ".join(hidden_effects(hidden))
    assert f"because {HELD}: " in said
    assert "ground friction" in said


def test_on_an_axis_that_stands_upright_nothing_is_loaded(logged):
    folder, _, (e,) = logged
    rig = folder / "rig.sdf"
    rig.write_text(rig.read_text().replace("<xyz>0 1 0</xyz>", "<xyz>0 0 1</xyz>"))
    model = load_session(folder / "session.yaml").model
    unloaded = unloaded_joints(model, [e])
    assert unloaded == {"j"}
    names = {c.name for c in candidates(model, [e], unloaded)}
    assert not names & LOADED
    assert set(unobservable(model, [e], unloaded)) >= LOADED
    assert "coulomb_friction" in names
