"""Channels of captured takes straight from the compiled station equal those of `observe`, which is the reference."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.captured import CONFIG, captured_take, rollout_of
from workbench.compare.channels import ACROSS, BODY
from workbench.identify.problem import TakeEvidence
from workbench.identify.rollouts import captured
from workbench.identify.rollouts.captured import seen_channels
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.robot import EffectSpec, RobotModel, puppy_model
from workbench.simulation.batch import run_job

LENGTH = 1.1
SAME = 1e-12
"""Radians and metres by which the two may differ."""


@pytest.fixture(scope="module", params=["fixed", "free"])
def take(request: pytest.FixtureRequest) -> TakeEvidence:
    return captured_take(request.param, LENGTH)


def both(e: TakeEvidence, model: RobotModel, until: float = np.inf) -> tuple[np.ndarray, np.ndarray | None]:
    """The reference's channels, and those of the compiled pass."""
    rollout = rollout_of(e, model, until)
    return e.observe(run_job(rollout.job), model), seen_channels(rollout)


EFFECTS = {
    "nothing": (),
    "friction": (EffectSpec("coulomb_friction", ("flm",), {"torque": 0.1}),),
    "payload": (EffectSpec("payload", ("body_link",), {"mass": 0.1, "position": (0.0, 0.01, 0.02)}),),
    "zero": (EffectSpec("zero_offset", ("brm",), {"angle": 4.0}),),
    "play and spring": (EffectSpec("backlash", ("flm",), {"gap": 3.0}),
                        EffectSpec("joint_compliance", ("frm",), {"stiffness": 5.0})),
    "loose mount": (EffectSpec("loose_mount", ("brt",), {"play": 2.0, "axis": (0.0, 0.0, 1.0)}),),
    "longer link": (EffectSpec("link_length", ("blb_link",), {"change": 0.003}),),
    "turned frames": (EffectSpec("marker_frame", ("BLmid",), {"rotation": (2.0, -3.0, 1.0)}),
                      EffectSpec("marker_frame", ("body",), {"rotation": (-1.0, 2.0, 4.0)})),
}


@pytest.mark.parametrize("effects", EFFECTS)
def test_the_compiled_pass_sees_what_observe_sees(take: TakeEvidence, effects: str) -> None:
    expected, found = both(take, puppy_model().with_effects(EFFECTS[effects]))
    assert found is not None
    assert np.array_equal(np.isnan(found), np.isnan(expected))
    assert np.nanmax(np.abs(found - expected)) < SAME
    moved = np.nanmax(expected, axis=0) - np.nanmin(expected, axis=0)
    assert (moved[[take.channels.index(j) for j in ("flm", "brm")]] > 0.1).all()
    assert any(ACROSS in c for c in take.channels)
    assert (BODY[0] in take.channels) == (take.take.spec.base == "free")


def test_frames_after_the_run_are_unknown_to_both(take: TakeEvidence) -> None:
    expected, found = both(take, puppy_model(), until=0.5)
    assert found is not None
    assert np.isnan(found[take.since > 0.6]).all()
    assert np.array_equal(np.isnan(found), np.isnan(expected))
    assert np.nanmax(np.abs(found - expected)) < SAME


def test_joints_between_bodies_that_nobody_tracks_keep_their_own_angle() -> None:
    e = captured_take("fixed", LENGTH, without=("FLmid", "tail"))
    expected, found = both(e, puppy_model())
    assert found is not None
    assert np.array_equal(np.isnan(found), np.isnan(expected))
    assert np.nanmax(np.abs(found - expected)) < SAME
    _, with_play = both(e, puppy_model().with_effects(EFFECTS["play and spring"]))
    assert with_play is None  # an angle that only the take tells


def test_threads_fill_in_for_what_is_drakes_alone(take: TakeEvidence, monkeypatch: pytest.MonkeyPatch) -> None:
    evaluator = RolloutEvaluator([take], CONFIG, n_jobs=2)
    models = [puppy_model().with_effects(EFFECTS[name]) for name in ("nothing", "friction", "payload")]
    whole = evaluator.residuals([RolloutRequest(m, (0,)) for m in models])
    covered = captured.compiled_for
    monkeypatch.setattr(captured, "compiled_for", lambda r, made: None if r.model is models[1] else covered(r, made))
    mixed = RolloutEvaluator([take], CONFIG, n_jobs=2).residuals([RolloutRequest(m, (0,)) for m in models])
    for one, other in zip(whole, mixed):
        assert np.allclose(one[0], other[0], atol=1e-6, equal_nan=True)
    assert np.nanmax(np.abs(whole[0][0] - whole[1][0])) > 1e-3
