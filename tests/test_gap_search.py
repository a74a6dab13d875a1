"""Evidence, screening and fitting on a small arm whose joint `three` is stiffer than its model says."""

import numpy as np
import pytest

from tests.gap_sessions import record_arm
from workbench.gap.candidates import Candidate, candidates
from workbench.gap.compare_session import roll_out, run_of
from workbench.gap.evidence import Jury, gather
from workbench.gap.registered import read_takes, register_takes
from workbench.gap.search import Search
from workbench.gap.session import load_session
from workbench.simulation import SimulationConfig

NOMINAL, HIDDEN = 0.06, 0.14


def gathered(folder, friction):
    record_arm(folder, friction=friction)
    session = load_session(folder / "session.yaml")
    takes, _ = read_takes(session)
    rollouts = roll_out([run_of(t) for t in takes], SimulationConfig(), n_jobs=1)
    registered, _ = register_takes(session, takes, {t.spec.name: r.nominal for t, r in zip(takes, rollouts)})
    return session, gather(registered, {t.spec.name: r for t, r in zip(takes, rollouts)})


@pytest.fixture(scope="module")
def worn(tmp_path_factory):
    session, evidence = gathered(tmp_path_factory.mktemp("worn"), HIDDEN)
    jury = Jury(evidence, SimulationConfig(settle=0.5), n_jobs=1)
    names = {"coulomb_friction", "viscous_friction", "servo_gain", "dead_band", "supply_voltage", "timing_drift"}
    search = Search(jury, session.model, [c for c in candidates(session.model, evidence) if c.effect.name in names])
    search.screen()
    return session, jury, search


def test_residuals_are_as_large_as_noise_where_nothing_is_hidden(tmp_path):
    session, evidence = gathered(tmp_path, NOMINAL)
    residual = Jury(evidence, SimulationConfig(settle=0.5), n_jobs=1).residuals([session.model])[0][0]
    assert np.sqrt(np.nanmean(np.square(residual), axis=0)) == pytest.approx(1.0, abs=0.3)


def test_stretches_for_fitting_choosing_and_validating_do_not_meet(worn):
    uses = worn[1].evidence[0].uses
    assert all(m.any() for m in uses.values())
    assert (sum(m.astype(int) for m in uses.values()) <= 1).all()


def test_the_worn_joint_stands_out_before_any_fit(worn):
    session, jury, _ = worn
    residual = jury.residuals([session.model])[0][0]
    rms = dict(zip(jury.evidence[0].channels, np.sqrt(np.nanmean(np.square(residual), axis=0))))
    assert max(rms, key=rms.get) == "three"
    assert rms["three"] > 2


def test_screening_shortlists_the_hidden_effect_and_fits_choose_it_with_its_size(worn):
    session, jury, search = worn
    before = jury.residuals([session.model])[0]
    shortlist = search.rank(before)[:3]
    assert {c.where for _, c, _ in shortlist} == {("three",)}
    fits = [search.fit([c], x) for _, c, x in shortlist]
    best = min(fits, key=lambda f: f.cost["choose"])
    assert str(best.effects[0]) == "coulomb_friction(three)"
    assert NOMINAL + best.effects[0].values(best.x)[0] == pytest.approx(HIDDEN, rel=0.05)
    assert best.cost["validate"] < 0.5 * np.sum(np.square(jury.vector(before, "validate")))


def test_sizes_are_zero_where_an_effect_vanishes_and_one_where_it_is_typical(worn):
    for c in candidates(worn[0].model, worn[1].evidence):
        if not c.neutral:
            continue
        neutral = c.values(np.zeros(len(c.neutral)))
        assert all(v == n or (n == np.inf and v == p.high) for v, n, p in zip(neutral, c.neutral, c.parameters)), str(c)
        ones = [2 * n if n == p.typical else p.typical for p, n in zip(c.parameters, c.neutral)]
        assert c.values(np.ones(len(c.neutral))) == pytest.approx(ones)
        low, high = c.bounds()
        assert (low <= 0).all()
        assert (high >= 1).all()
        assert isinstance(c, Candidate)
