"""Channels of captured takes straight from the compiled station equal those of `observe`, which is the reference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from workbench.compare.channels import ACROSS, BODY, channel_names, channels_of
from workbench.compare.session import TakeSpec
from workbench.compare.session_takes import RegisteredTake
from workbench.identify.problem import TakeEvidence
from workbench.identify.rollouts import RolloutEvaluator, RolloutRequest, captured
from workbench.identify.rollouts.captured import Rollout, seen_channels
from workbench.identify.shooting import base_states
from workbench.motion import load_motion
from workbench.recording import Measurement, observe
from workbench.recording.recording import Recording
from workbench.recording.take import Take
from workbench.robot import EffectSpec, RobotModel, data_file, puppy_model
from workbench.simulation import SimulationConfig
from workbench.simulation.batch import Job, run_job

CONFIG = SimulationConfig(settle=0.2, contact_period=0, time_step=2e-3)
STARTS_AT, LENGTH = 0.4137, 1.1
SAME = 1e-12
"""Radians and metres by which the two may differ."""


def of_joints(take: Take, joints: tuple[str, ...]) -> Take:
    columns = [take.column(j) for j in joints]
    assert take.off_axis is not None
    assert take.v is not None
    return replace(take, joints=joints, q=take.q[:, columns], v=take.v[:, columns], off_axis=take.off_axis[:, columns])


def evidence_of(base: str, without: tuple[str, ...] = ()) -> TakeEvidence:
    """A take of the puppy's walk as its own simulation shows it to cameras that stand askew; `without` some bodies, with joints
    that cameras cannot tell."""
    model = puppy_model()
    walk = load_motion(data_file("robotis_walk.csv"), model).commands(1)
    rng = np.random.default_rng(3)
    assets = [a for a in model.rigid_bodies if a not in without]
    measurement = Measurement(STARTS_AT, yaw=0.3, origin=np.array([0.5, -0.2, 0.1]),
                              pivots={a: rng.normal(0.0, 0.02, 3) for a in assets})
    take = run_job(Job(model, replace(CONFIG, base=base), walk, LENGTH, 0.3))
    recorded = replace(observe(take, measurement, model, np.arange(0.0, STARTS_AT + LENGTH - 0.05, 1 / 120))[0], commands=walk)
    if not without:
        recorded = of_joints(recorded, tuple(j for j in model.joints if j not in ("head", "neck")))
    unused = Recording("walk", "motive", "", recorded.time, np.arange(len(recorded)), 120.0, sensing="mocap")
    spec = TakeSpec("walk", recording=data_file("robotis_walk.csv"), base=base)
    registered = RegisteredTake(spec, model, unused, walk, measurement, recorded)
    names = channel_names(registered)
    nothing, one = np.zeros((len(recorded), len(names))), np.ones(len(names))
    assert base == "fixed" or base_states(recorded) is not None
    return TakeEvidence(registered, names, channels_of(recorded, names), one, nothing,
                        dict.fromkeys(("fit", "choose", "validate"), recorded.time > STARTS_AT), one, True, nothing,
                        steadied=base_states(recorded))


@pytest.fixture(scope="module", params=["fixed", "free"])
def take(request: pytest.FixtureRequest) -> TakeEvidence:
    return evidence_of(request.param)


def both(e: TakeEvidence, model: RobotModel, until: float = np.inf) -> tuple[np.ndarray, np.ndarray | None]:
    """The reference's channels, and those of the compiled pass."""
    job = RolloutEvaluator([e], CONFIG, n_jobs=1).job(model, 0, replace(CONFIG, base=e.take.spec.base), until)
    return e.simulated(run_job(job), model), seen_channels(Rollout(e, model, job))


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
    e = evidence_of("fixed", without=("FLmid", "tail"))
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
    monkeypatch.setattr(captured, "compiled_for", lambda r: None if r.model is models[1] else covered(r))
    mixed = RolloutEvaluator([take], CONFIG, n_jobs=2).residuals([RolloutRequest(m, (0,)) for m in models])
    for one, other in zip(whole, mixed):
        assert np.allclose(one[0], other[0], atol=1e-6, equal_nan=True)
    assert np.nanmax(np.abs(whole[0][0] - whole[1][0])) > 1e-3
