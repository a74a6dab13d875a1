"""Numbers that a take wants to change: friction that fades while the robot works is no friction that stays."""

from dataclasses import replace

import numpy as np
import pytest

from tests.gap_worn import CONFIG
from workbench.effects.registry import known_effects
from workbench.identify.fitting.doubts import drifts
from workbench.identify.fitting.fits import Search
from workbench.identify.parameters import Candidate, with_effects
from workbench.simulation.batch import run_job


@pytest.fixture
def friction(worn):
    effect = known_effects()["coulomb_friction"]
    return Candidate.of(effect, ("three",), effect.neutral(worn[0].model))


def fitted(search, friction):
    return search.refit(search.evaluate([(friction, np.ones(friction.size))]), search.fixed_base, 4)


def test_friction_that_stays_shows_no_drift(worn, friction):
    search = worn[1]
    assert drifts(search, fitted(search, friction)) == []


def test_friction_that_fades_within_a_take_is_told_and_how_far(worn, friction):
    session, search, _ = worn
    e = search.evaluator.evidence[0]

    def played(torque):
        unit = friction.values(np.ones(1))[0] - friction.neutral[0]
        model = with_effects(session.model, [(friction, np.array([(torque - friction.neutral[0]) / unit]))])
        return e.observe(run_job(search.evaluator.job(model, 0, CONFIG)), model)

    late = np.clip(e.since / e.since[-1], 0.0, 1.0)[:, None]
    noise = np.random.default_rng(1).normal(size=e.recorded.shape) * e.sigma
    fading = replace(e, recorded=np.where(np.isfinite(e.recorded), (1 - late) * played(0.3) + late * played(0.1) + noise, np.nan))
    search = Search(search.evaluator.on([fading]), session.model)
    (drift,) = drifts(search, fitted(search, friction))
    assert drift.effect == friction
    assert drift.first == pytest.approx(0.3, abs=0.05)
    assert drift.last == pytest.approx(0.1, abs=0.05)
    left = drift.as_unexplained([fading])
    assert left.where == ("three",)
    assert left.unit == "deg"
    assert left.error > 5 * left.floor > 0.0
    assert "coulomb_friction(three)" in str(left.description)
