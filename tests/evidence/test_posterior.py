"""Probabilities over models within Occam's window, and sizes that end where the robot ends, in closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.evidence.linear import candidate
from workbench.effects.registry import effect_named
from workbench.identify.evidence.fit import Fitted
from workbench.identify.evidence.hypothesis import start
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.plausible import at_their_end
from workbench.identify.evidence.posterior import posterior_of
from workbench.identify.parameters import Candidate

OPTIONS = EvidenceOptions(occam=5.0)
DRY, WET, LOADED, PLAY, SPRING = (candidate(n) for n in ("coulomb_friction", "viscous_friction", "load_friction", "backlash",
                                                         "parallel_spring"))


def name(c):
    return c.name, c.where


def elsewhere(c):
    return replace(c, where=("another",))


def model(log_posterior, *effects, law=None):
    h = start(())
    for c in effects:
        h = h.with_effect(c, np.full(c.size, 0.1))
    return Fitted(replace(h, law=law), np.zeros(0), np.zeros((0, 0)), 0.0, log_posterior - 1.0, 1.0)


def test_models_are_weighted_by_their_posterior_within_the_window():
    p = posterior_of([model(-4.9, WET), model(0.0, DRY), model(-5.0, PLAY), model(math.log(0.5), DRY, PLAY)], OPTIONS)
    total = 1.5 + math.exp(-4.9)
    assert [w for _, w in p.weights] == pytest.approx([1 / total, 0.5 / total, math.exp(-4.9) / total])
    assert p.best.hypothesis.effects == (DRY,)
    assert p.named == pytest.approx({name(DRY): 1.5 / total, name(PLAY): 0.5 / total, name(WET): math.exp(-4.9) / total})
    assert p.families[DRY.effect.family] == pytest.approx(1.0)
    assert p.families[DRY.effect.family] <= 1.0
    assert p.unnamed == 0.0
    assert p.unnamed_instead(name(DRY)) == ((), 0.0)


def test_a_family_counts_once_in_each_model():
    p = posterior_of([model(0.0, DRY, WET), model(0.0)], OPTIONS)
    assert p.families == pytest.approx({DRY.effect.family: 0.5})


def test_the_rival_is_the_alternative_with_most_probability_where_the_effect_is_not():
    fits = [model(0.0, DRY), model(math.log(0.4), PLAY), model(math.log(0.3), WET), model(math.log(0.2), DRY, SPRING)]
    p = posterior_of(fits, OPTIONS)
    rival, probability = p.rival(name(DRY))
    assert rival == name(WET), "of its family, so counted in full; another one's half"
    assert probability == pytest.approx(0.3 / 1.9)
    assert p.rival(name(DRY), besides=[name(WET)]) == (name(PLAY), pytest.approx(0.4 / 1.9))
    assert p.rival(name(DRY), besides=[name(WET), name(PLAY)]) is None


def test_the_rivals_probability_is_summed_over_models_that_lack_the_effect():
    fits = [model(0.0, DRY), model(math.log(0.3), WET), model(math.log(0.2), WET, PLAY), model(math.log(0.9), DRY, WET)]
    rival, probability = posterior_of(fits, OPTIONS).rival(name(DRY))
    assert (rival, probability) == (name(WET), pytest.approx(0.5 / 2.4))


def test_the_probabilities_of_an_alternative_add_up_before_it_is_compared_with_others():
    fits = [model(0.0, DRY), model(math.log(0.25), LOADED), *[model(math.log(0.2), WET, e) for e in (PLAY, SPRING)]]
    assert posterior_of(fits, OPTIONS).rival(name(DRY)) == (name(WET), pytest.approx(0.4 / 1.65))
    assert posterior_of([*fits[:2], model(math.log(0.2), WET)], OPTIONS).rival(name(DRY))[0] == name(LOADED)


def test_an_effect_of_the_best_model_is_no_rival_of_another():
    p = posterior_of([model(0.0, DRY, PLAY), model(math.log(0.5), PLAY), model(math.log(0.1), PLAY, LOADED)], OPTIONS)
    assert p.rival(name(DRY)) == (name(LOADED), pytest.approx(0.1 / 1.6))
    assert posterior_of([model(0.0, DRY)], OPTIONS).rival(name(DRY)) is None


@pytest.mark.parametrize(("weight", "named"), [(0.2, True), (0.05, False)])
def test_the_same_effect_at_another_place_is_listed_from_a_tenth_of_its_probability_on(weight, named):
    other, half = elsewhere(DRY), math.log(weight / 2)
    p = posterior_of([model(0.0, DRY), model(half, other), model(half, other, PLAY), model(math.log(0.5), PLAY),
                      model(math.log(0.5), DRY, other)], OPTIONS)
    total = 2.0 + weight
    expected = {name(other): pytest.approx(weight / total)} if named and weight >= 0.1 * 1.5 else {}
    assert p.elsewhere(name(DRY)) == expected


class Law:
    """An unnamed torque."""

    def __init__(self, *scales):
        self.scales = dict.fromkeys(scales, 1.0)


def test_an_unnamed_torque_has_the_probability_of_all_models_that_have_one():
    fits = [model(0.0, DRY), model(math.log(0.6), law=Law("angle")), model(math.log(0.3), law=Law("angle", "speed")),
            model(math.log(0.1), DRY, law=Law("duty"))]
    p = posterior_of(fits, OPTIONS)
    assert p.unnamed == pytest.approx(1.0 / 2.0)
    assert p.unnamed_instead(name(DRY)) == (("angle",), pytest.approx(0.9 / 2.0))


@pytest.mark.parametrize(("share", "ends"), [(0.995, True), (0.9901, True), (0.9899, False)])
def test_a_number_at_the_end_of_its_reach_refutes_the_effect(share, ends):
    pool = replace(SPRING, reach=4.0)
    there = [0.0] * SPRING.size
    there[0] = share * 4.0 / SPRING.typical[0]
    said = at_their_end(start(()).with_effect(SPRING, there), [pool, PLAY])
    assert (SPRING in said) is ends
    if ends:
        assert said[SPRING].unit == SPRING.parameters[0].unit
        assert (said[SPRING].parameter, said[SPRING].value) == (SPRING.parameters[0].name, pytest.approx(share * 4.0))


def test_effects_without_a_reach_or_outside_the_pool_go_as_far_as_they_like():
    h = start(()).with_effect(SPRING, [1e9] + [0.0] * (SPRING.size - 1))
    assert at_their_end(h, [SPRING]) == {}
    assert at_their_end(h, []) == {}


@pytest.mark.parametrize(("effect", "places", "neutral", "values", "reach", "parameter", "value"), [
    ("ground_tilt", (), (0.0, 0.0), (1.0, -3.0), 3.0, "left", -3.0),
    ("friction_asymmetry", ("j",), (1.0,), (0.5,), math.log(2.0), "ratio", 0.5),
    ("friction_asymmetry", ("j",), (1.0,), (0.5,), math.log(2.0) + 0.02, None, None),
    ("payload", ("link",), (0.0,) * 4, (0.02, 0.03, 0.0, 0.04), 0.05, "position", 0.05),
    ("payload", ("link",), (0.0,) * 4, (0.05, 0.01, 0.0, 0.0), 0.05, "mass", 0.05),
    ("com_shift", ("link",), (0.01, 0.0, 0.0), (0.05, 0.0, 0.0), 0.04, "offset", 0.05),
    ("com_shift", ("link",), (0.01, 0.0, 0.0), (0.05, 0.0, 0.0), 0.05, None, None)])
def test_each_kind_of_number_has_its_own_distance_from_neutral(effect, places, neutral, values, reach, parameter, value):
    """The sign of a number, the logarithm of a ratio, the length of a vector; all parameters of an effect are looked at."""
    c = Candidate.of(effect_named(effect), places, neutral)
    x = least_squares(lambda x: np.subtract(c.values(x), values), np.full(c.size, 0.5), x_scale="jac").x
    assert c.values(x) == pytest.approx(values, abs=1e-6)
    said = at_their_end(start(()).with_effect(c, x), [replace(c, reach=reach)])
    assert [(r.parameter, pytest.approx(r.value, abs=1e-6)) for r in said.values()] == ([(parameter, value)] if parameter else [])


def test_of_a_vector_the_length_is_compared():
    shift = Candidate.of(effect_named("com_shift"), ("link",), (0.0, 0.0, 0.0))
    h = start(()).with_effect(shift, np.array([0.03, 0.0, 0.04]) / shift.typical)
    said = at_their_end(h, [replace(shift, reach=0.05)])
    assert said[shift].value == pytest.approx(0.05)
    assert at_their_end(h, [replace(shift, reach=0.06)]) == {}
