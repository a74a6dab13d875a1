"""The search on a robot that is linear in all its numbers: names, their probabilities, takes kept back, and quiet recordings."""

from dataclasses import replace

import numpy as np
import pytest

from tests.evidence.linear import FRAME, Linear, candidate, linear, region
from workbench.identify.evidence.checks import veto
from workbench.identify.evidence.fit import fit_hypothesis, regress
from workbench.identify.evidence.hypothesis import Uncertain, start
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.posterior import posterior_of
from workbench.identify.evidence.search import lockstep, search, without_names

NAMES = ("coulomb_friction", "viscous_friction", "load_friction", "backlash", "torque_saturation", "parallel_spring")
NUMBER = "number 0"
OPTIONS = EvidenceOptions()


def waves(seed: int, n: int, count: int) -> list[np.ndarray]:
    """Signals that have nothing to do with each other, smooth over some frames."""
    rng = np.random.default_rng(seed)
    kernel = np.exp(-0.5 * np.square(np.arange(-12, 13) / 4.0))
    return [np.convolve(rng.normal(size=n + 24), kernel, mode="valid") * 0.01 for _ in range(count)]


def robot(true: dict[str, float], noise: float = 2e-3, seed: int = 0, number: float = 0.0):
    of = region([candidate(n) for n in NAMES], noise=noise)
    n = len(of.likelihood.known)
    signals = waves(seed, n, len(NAMES) + 1)
    does = {NUMBER: 0.3 * signals[-1]}
    for name, signal in zip(NAMES, signals):
        for p in candidate(name).parameters:
            does[f"{name}.{p.name}"] = signal
    truth = number * does[NUMBER] + np.random.default_rng(seed + 1).normal(size=n) * noise
    for name, size in true.items():
        truth = truth + size * does[f"{name}.{candidate(name).parameters[0].name}"]
    return linear(of, truth, does)


def searched(rollouts, options: EvidenceOptions = OPTIONS):
    after, (found,) = search(rollouts, options, lambda what, share=None: None)
    return after, found, posterior_of(list(found.fits.values()), options)


def test_two_effects_are_named_with_their_sizes():
    _, found, p = searched(robot({"load_friction": 2.0, "backlash": 1.5}))
    sizes = {c.name: x[0] for c, x in p.best.hypothesis.sizes()}
    assert sizes == pytest.approx({"load_friction": 2.0, "backlash": 1.5}, rel=0.05)
    assert {name: prob > 0.9 for (name, _), prob in p.named.items()} == {n: n in sizes for n, _ in p.named}
    assert p.families["friction"] > 0.9
    assert np.sqrt(np.diag(p.best.covariance(found.region, OPTIONS)))[-1] < 0.1


class Held(Linear):
    """Dry friction holds the joint: more of it changes nothing, less does the opposite of what more would do."""

    def left(self, h):
        sizes = [-x * c.less if c.name == "coulomb_friction" else x for c, x in h.sizes()]
        return super().left(h.at(np.concatenate([h.z, *sizes])))


def test_a_nominal_friction_that_is_too_large_is_named_even_if_it_holds_the_joint():
    r = robot({"coulomb_friction": -3.5})
    both = replace(r.regions[0].candidates[0], lowest=(-0.15,)).one_way()
    assert [c.less for c in both] == [False, True]
    of = replace(r.regions[0], candidates=(*both, *r.regions[0].candidates[1:]))
    _, _, p = searched(Held(**{**vars(r), "regions": (of,)}))
    ((c, x),) = p.best.hypothesis.sizes()
    assert c.values(x) == pytest.approx([-3.5 * 0.03], rel=0.05)
    assert p.named["coulomb_friction", ("j",)] > 0.9


class Coarse(Linear):
    """At a coarse step dry friction does a third more than it does."""

    def left(self, h):
        r = super().left(h)
        for c, x in h.sizes():
            if c.name == "coulomb_friction" and self.step > 1.0:
                r = r - 0.3 * x[0] * self.does["coulomb_friction.torque"]
        return r


def test_what_a_coarse_step_fitted_wrongly_is_fitted_anew_before_it_is_judged():
    """Four rivals that do nearly the same: dry friction, which it is, is less like it than any of them with its size from the
    coarse step."""
    names = NAMES[:2] + NAMES[3:]
    of = region([candidate(n) for n in names], noise=2e-3, takes=1)
    n = len(of.likelihood.known)
    signal, number, *others = waves(0, n, len(names) + 1)
    does = {NUMBER: 0.3 * number, "coulomb_friction.torque": signal}
    for name, other in zip(names[1:], others):
        does[f"{name}.{candidate(name).parameters[0].name}"] = signal + 0.1 * other
    truth = 2.0 * signal + np.random.default_rng(0).normal(size=n) * 2e-3
    rollouts = Coarse(None, None, (of,), (start(of.numbers),), None, None, truth=truth, does=does)
    _, _, p = searched(rollouts)
    assert [c.name for c in p.best.hypothesis.effects] == ["coulomb_friction"]
    assert p.best.hypothesis.theta[-1] == pytest.approx(2.0, rel=0.05)


class Saturating(Linear):
    """A saturation of typical size or more does the opposite of a weaker one."""

    def left(self, h):
        sizes = [x if c.name != "torque_saturation" else np.minimum(x, 2.0 - 2.5 * x) for c, x in h.sizes()]
        return super().left(h.at(np.concatenate([h.z, *sizes])))


def test_an_effect_is_exchanged_for_one_of_its_kind_that_no_line_predicts():
    """Looked at from its typical size on, the saturation makes everything worse; the ceiling does nearly the same as it."""
    names = (*NAMES, "torque_ceiling")
    of = region([candidate(n) for n in names], noise=2e-3)
    n = len(of.likelihood.known)
    signals = waves(0, n, len(names) + 1)
    does = {f"{name}.{candidate(name).parameters[0].name}": signal for name, signal in zip(names, signals)}
    does["torque_saturation.torque"] = 3.0 * signals[-2] + 0.6 * signals[-1]
    does[NUMBER] = 0.3 * waves(1, n, 1)[0]
    truth = 0.5 * does["torque_saturation.torque"] + np.random.default_rng(1).normal(size=n) * 2e-3
    _, _, p = searched(Saturating(None, None, (of,), (start(of.numbers),), None, None, truth=truth, does=does))
    assert [c.name for c in p.best.hypothesis.effects] == ["torque_saturation"]
    assert p.best.hypothesis.theta[-1] == pytest.approx(0.5, rel=0.05)


def test_what_recalibration_explains_is_no_effect():
    _, _, p = searched(robot({}, number=1.5))
    assert not p.best.hypothesis.effects
    assert p.best.hypothesis.z == pytest.approx([1.5], abs=0.1)


@pytest.mark.parametrize("seed", range(6))
def test_quiet_recordings_name_nothing(seed):
    _, _, p = searched(robot({}, seed=10 * seed))
    assert max(p.named.values(), default=0.0) < 0.5


def test_effects_that_do_the_same_share_the_probability():
    rollouts = robot({"backlash": 1.5})
    does = dict(rollouts.does)
    does["parallel_spring.stiffness"] = does["backlash.gap"]
    _, _, p = searched(replace(rollouts, does=does))
    names = {("backlash", ("j",)), ("parallel_spring", ("j",))}
    either = sum(w for f, w in p.weights if {(c.name, c.where) for c in f.hypothesis.effects} & names)
    both = [p.named.get(name, 0.0) for name in sorted(names)]
    assert either == pytest.approx(1.0, abs=0.1)
    assert max(both) < 0.8
    kept = (p.best.hypothesis.effects[0].name, ("j",))
    assert p.rival(kept)[1] == pytest.approx(either - p.named[kept])


def test_takes_kept_back_speak_against_what_only_some_show():
    """An effect that two takes ask for, and that the others would be worse with, is none."""
    rollouts = robot({"load_friction": 2.0})
    (of,) = rollouts.regions
    odd = rollouts.does["backlash.gap"] * np.where(of.takes < 2, 1.2, -0.8)
    rollouts = replace(rollouts, truth=rollouts.truth + odd)
    after, found, _ = searched(rollouts)
    h = start(found.region.numbers)
    for name in ("load_friction", "backlash"):
        h = h.with_effect(candidate(name), np.ones(1))
    with_both = lockstep(after, {0: fit_hypothesis(found.region, OPTIONS, h, 0.01, OPTIONS.iterations)})[0]
    said = lockstep(after, {0: veto(found.region, OPTIONS, with_both, [(0,), (1,), (2,), (3,)])})[0]
    assert {c.name for c in said} == {"backlash"}


def test_correlation_that_is_left_makes_frames_count_less():
    """Missing physics may act slowly; then a minute of data determines little."""
    rollouts = robot({"backlash": 1.5})
    slow = np.convolve(np.random.default_rng(5).normal(size=len(rollouts.truth) + 199), np.ones(200) / 40, mode="valid") * 0.01
    _, quick, _ = searched(rollouts)
    _, found, _ = searched(replace(rollouts, truth=rollouts.truth + slow))
    assert quick.region.likelihood.tau < 2 * FRAME
    assert found.region.likelihood.tau > 20 * FRAME


def test_two_numbers_that_do_the_same_are_not_told_apart_by_sticking():
    """Residuals that jump at each small move: finite differences would separate the two, simultaneous moves do not."""
    rollouts = robot({"coulomb_friction": 2.0})
    does = dict(rollouts.does)
    does[NUMBER] = 0.5 * does["coulomb_friction.torque"]
    rollouts = replace(rollouts, does=does, sticks=1e-3)
    (of,) = rollouts.regions
    of = of.with_correlation_time(0.2)
    h = start(of.numbers).with_effect(candidate("coulomb_friction"), np.array([2.0]))
    fit = lockstep(rollouts, {0: fit_hypothesis(of, OPTIONS, h, 0.002, OPTIONS.iterations)})[0]
    again = lockstep(rollouts, {0: regress(of, OPTIONS, fit)})[0]
    by_differences, by_moves = (np.sqrt(np.diag(f.covariance(of, OPTIONS)))[1] for f in (fit, again))
    assert by_moves == pytest.approx(0.5, rel=0.2)  # what is believed of the number, as the effect does twice as much
    assert by_differences < 0.5 * by_moves


def test_an_effect_that_is_a_number_of_the_law_is_not_told_from_it_by_how_far_each_was_moved():
    """Their sum alone is seen; slopes of a curve differ between long and short moves, which would tell them apart."""
    rollouts = robot({"coulomb_friction": 2.0})
    (of,) = rollouts.regions
    does = rollouts.does["coulomb_friction.torque"]
    bent = does + 0.2 * np.abs(does)
    friction = Uncertain(of.joints[0], "coulomb_friction", 0.5)
    rollouts = replace(rollouts, does={**rollouts.does, "coulomb_friction": 0.5 * bent})
    of = replace(of, numbers=(friction,)).with_correlation_time(FRAME)
    h = start(of.numbers).with_effect(candidate("coulomb_friction"), np.array([2.0]))
    fit = lockstep(rollouts, {0: fit_hypothesis(of, OPTIONS, h, 0.002, OPTIONS.iterations)})[0]
    again = lockstep(rollouts, {0: regress(of, OPTIONS, fit)})[0]
    known = [np.sqrt(np.diag(f.covariance(of, OPTIONS)))[1] for f in (fit, again)]
    assert known[1] == pytest.approx(0.5, rel=0.2)  # what is believed of the number, as the effect does twice as much
    assert known[0] < 0.5 * known[1]


def test_slopes_by_moves_are_those_by_differences_where_nothing_sticks():
    rollouts = robot({"backlash": 1.5})
    (of,) = rollouts.regions
    h = start(of.numbers).with_effect(candidate("backlash"), np.array([1.5]))
    fit = lockstep(rollouts, {0: fit_hypothesis(of, OPTIONS, h, 0.002, OPTIONS.iterations)})[0]
    again = lockstep(rollouts, {0: regress(of, OPTIONS, fit)})[0]
    slopes = np.column_stack([-rollouts.does[NUMBER], -rollouts.does["backlash.gap"]])
    np.testing.assert_allclose(again.J, slopes, atol=1e-9)
    np.testing.assert_allclose(again.covariance(of, OPTIONS), replace(fit, J=slopes).covariance(of, OPTIONS), rtol=1e-6)


def test_taking_the_names_of_all_fits_out_leaves_the_best_one_without_them():
    """As after an effect that every likely model has was refuted."""
    rollouts, found, _ = searched(robot({"load_friction": 2.0, "backlash": 1.5}))
    gone = [c for c, _ in found.best.hypothesis.sizes() if c.name == "load_friction"]
    with_it = {key: f for key, f in found.fits.items() if any(name == "load_friction" for name, *_ in key)}
    left = lockstep(rollouts, {0: without_names(replace(found, fits=with_it), OPTIONS, gone)})[0]
    assert {c.name: x[0] for c, x in left.best.hypothesis.sizes()} == pytest.approx({"backlash": 1.5}, rel=0.1)
    assert "load_friction" not in {c.name for c in left.region.candidates}
