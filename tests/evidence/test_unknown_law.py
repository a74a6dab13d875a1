"""A torque that nobody has named against the names, on a robot that is linear in all its numbers."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from tests.evidence.linear import Linear, candidate, region
from tests.evidence.test_search import NAMES, NUMBER, OPTIONS, searched, waves
from workbench.identify.evidence.fit import weights_covariance
from workbench.identify.evidence.hypothesis import start
from workbench.identify.evidence.posterior import posterior_of
from workbench.identify.evidence.search import lockstep
from workbench.identify.evidence.torque_law import Functions, TorqueLaw
from workbench.identify.evidence.unknown_law import carried_on, on_windows, with_unknown_law, without_zero_groups

AT = np.linspace(-90.0, 90.0, 19)
PEAKS = np.exp(-0.5 * np.square((AT[:, None] - np.array([-60.0, -30.0, 0.0, 30.0, 60.0])) / 30.0))


@dataclass(frozen=True)
class LinearLaw(Linear):
    """by_weight (n, M): how much a newton metre of each weight reduces the residuals."""

    by_weight: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))

    def left(self, h):
        r = super().left(h)
        return r if h.law is None else r - self.by_weight @ h.law.weights


def torque_law():
    functions = (Functions("angle", "angle", AT, PEAKS), Functions("speed", "speed", AT, PEAKS[:, :4]))
    return TorqueLaw("j", functions, np.zeros(9), tried=len(OPTIONS.law.shares))


def robot(true, weights=None, vocabulary=NAMES, overlap=0.0, noise=2e-3, seed=0):
    """overlap: share of the first unnamed function that the effect backlash contains."""
    of = region([candidate(n) for n in vocabulary], noise=noise)
    n = len(of.likelihood.known)
    signals = waves(seed, n, len(NAMES) + 10)
    by_weight = np.column_stack(signals[len(NAMES) + 1:]) / 0.03
    does = {NUMBER: 0.3 * signals[len(NAMES)]}
    truth = np.random.default_rng(seed + 1).normal(size=n) * noise
    truth = truth if weights is None else truth + by_weight @ weights
    for name, signal in zip(NAMES, signals):
        signal = signal + (overlap * by_weight[:, 0] * 0.03 if name == "backlash" else 0.0)
        does |= {f"{name}.{p.name}": signal for p in candidate(name).parameters}
        truth = truth + true.get(name, 0.0) * signal
    return LinearLaw(None, None, (of,), (start(of.numbers),), None, None, truth=truth, does=does, by_weight=by_weight)


def weighed(rollouts):
    """Before and after an unnamed torque is allowed."""
    after, found, before = searched(rollouts)
    done = lockstep(after, {0: with_unknown_law(found, OPTIONS, torque_law())})
    return before, done[0], posterior_of(list(done[0].fits.values()), OPTIONS)


WEIGHTS = 0.03 * np.array([1.5, -1.0, 1.2, -0.8, 1.0, 0.0, 0.0, 0.0, 0.0])


def test_a_law_without_a_name_takes_the_place_of_the_name_nearest_to_it():
    before, found, p = weighed(robot({}, WEIGHTS, overlap=1.5))
    assert before.named["backlash", ("j",)] > 0.9
    assert p.named.get(("backlash", ("j",)), 0.0) < 0.05
    assert p.unnamed > 0.95
    law = p.best.hypothesis.law
    assert set(law.scales) == {"angle"}
    np.testing.assert_allclose(law.weights[:5], WEIGHTS[:5], atol=0.25 * 0.03)
    sd = np.sqrt(np.diag(weights_covariance(p.best, found.region, OPTIONS)))
    assert np.all(np.abs(law.weights[:5] - WEIGHTS[:5]) < 4 * sd)


def test_a_true_name_keeps_its_probability():
    before, _, p = weighed(robot({"load_friction": 2.0}))
    assert p.named["load_friction", ("j",)] == pytest.approx(before.named["load_friction", ("j",)], abs=0.03)
    assert p.unnamed < 0.05


def test_a_name_and_a_law_beside_it_are_both_found():
    _, _, p = weighed(robot({"coulomb_friction": 2.0}, WEIGHTS))
    assert p.named["coulomb_friction", ("j",)] > 0.9
    assert p.unnamed > 0.9
    sizes = {c.name: x[0] for c, x in p.best.hypothesis.sizes()}
    assert sizes == pytest.approx({"coulomb_friction": 2.0}, rel=0.15)


def test_quiet_recordings_ask_for_no_law():
    _, _, p = weighed(robot({}))
    assert p.unnamed < 0.05


def test_a_name_that_the_law_could_stand_for_is_less_well_known():
    """The covariance of a name's size is over all weights."""
    _, found, p = weighed(robot({"backlash": 2.0}, WEIGHTS, overlap=0.7))
    best = next(f for f, _ in p.weights if f.hypothesis.law is not None and f.hypothesis.effects)
    alone = np.linalg.inv((best.J.T * found.region.likelihood.precision(best.r, best.discrepancy)) @ best.J
                          + np.eye(len(best.hypothesis.theta)))
    assert best.covariance(found.region, OPTIONS)[-1, -1] > alone[-1, -1]


def test_a_law_found_over_windows_is_fitted_to_whole_logs():
    after, found, _ = searched(robot({}, WEIGHTS))
    windows = lockstep(after, {0: on_windows(found, OPTIONS)})[0]
    assert len(windows.fits) == 1
    seen = lockstep(after, {0: with_unknown_law(windows, OPTIONS, torque_law())})[0]
    done = lockstep(after, {0: carried_on(found, seen, OPTIONS)})[0]
    assert {f.hypothesis.key for f in found.fits.values()} < {f.hypothesis.key for f in done.fits.values()}
    assert posterior_of(list(done.fits.values()), OPTIONS).unnamed > 0.95
    np.testing.assert_allclose(done.best.hypothesis.law.weights[:5], WEIGHTS[:5], atol=0.25 * 0.03)


def test_groups_whose_weights_are_all_zero_are_no_part_of_a_law():
    """A torque of 0 mN m RMS that depends on nothing was reported, with a confidence of 0.98."""
    _, found, _ = weighed(robot({}, WEIGHTS))
    f = found.best
    both = f.hypothesis.law.at(WEIGHTS, {"angle": 0.03, "speed": 0.03})
    law_slopes = np.arange(2.0 * both.active.sum()).reshape(2, -1)
    kept = without_zero_groups(replace(f, hypothesis=replace(f.hypothesis, law=both), law_slopes=law_slopes))
    assert dict(kept.hypothesis.law.scales) == {"angle": 0.03}
    np.testing.assert_array_equal(kept.law_slopes, law_slopes[:, :5])
    nothing = without_zero_groups(replace(f, hypothesis=replace(f.hypothesis, law=both.at(0.0 * WEIGHTS)), law_slopes=law_slopes))
    assert nothing.hypothesis.law is None
    assert nothing.law_slopes is None
    assert without_zero_groups(kept) is kept


def test_tables_hold_the_law():
    law = torque_law().at(WEIGHTS, {"angle": 0.03})
    (table,) = law.tables()
    assert table.depends_on == "angle"
    np.testing.assert_allclose(table.torque, PEAKS @ WEIGHTS[:5])
    assert law.at(WEIGHTS, {}).tables() == ()
