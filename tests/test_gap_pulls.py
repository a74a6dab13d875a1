"""Two causes on the ground that one explains in part: that one and what came near it are given company."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from workbench.effects.registry import known_effects
from workbench.gap import pulls
from workbench.gap.candidate import Candidate
from workbench.gap.race import Trial
from workbench.gap.rounds import Round
from workbench.gap.search import Fit
from workbench.robot import puppy_model

FORWARD, LEFT, SLIPPERY, LIFTS, SOFT = np.random.default_rng(4).normal(size=(5, 900)) * 2.0
DOES = {"ground_tilt": [FORWARD, LEFT], "tether_force": [FORWARD, LEFT, 0.8 * SLIPPERY + 0.6 * LIFTS],
        "ground_friction": [SLIPPERY], "soft_ground": [SOFT], "backlash": [LIFTS], "payload": [LIFTS] * 4}
"""What each number of an effect does to a walk at its typical size: a pull upwards is much like a slippery floor."""


def candidate(name):
    effect, model = known_effects()[name], puppy_model()
    where = {"joint": ("flm",), "link": (model.base,), "robot": ()}[effect.places[0]]
    return Candidate.of(effect, where, effect.neutral(model))


def silent(stage, share):
    """Progress that nobody reads."""


class LinearSearch:
    """A walk that answers in lines, fitted to its end at once."""

    fitted, nominal = (0,), None

    def __init__(self, **sizes):
        self.recorded = self.sum([(candidate(name), np.array(x)) for name, x in sizes.items()])
        self.asked = 0
        self.jury = SimpleNamespace(
            residuals=self.answers, vector=lambda left, use: left[0][:, 0],
            by_channel=lambda left, use: (np.array([np.sum(left[0] ** 2)]), np.array([900.0])))

    def sum(self, sizes):
        return sum((v * d for c, x in sizes for v, d in zip(x, DOES[c.name])), np.zeros(900))

    def answers(self, questions):
        self.asked += len(questions)
        return [{0: (self.recorded - self.sum(q.model))[:, None]} for q in questions]

    def evaluated(self, sizes):
        left = (self.recorded - self.sum(sizes))[:, None]
        cost = float(np.sum(left**2))
        x = np.concatenate([np.empty(0), *(x for _, x in sizes)])
        return Fit(tuple(c for c, _ in sizes), x, np.eye(len(x)), {"fit": 2 * cost, "choose": cost}, {0: left})

    def evaluating(self, *lists):
        yield []
        return [self.evaluated(sizes) for sizes in lists]

    def refitting(self, fit, takes, steps):
        yield []
        A = np.column_stack([d for c in fit.effects for d in DOES[c.name]])
        return self.evaluated(fit.sizes(np.linalg.lstsq(A, self.recorded, rcond=None)[0]))

    def side_by_side(self, parts):
        return [self.run(p) for p in parts]

    def run(self, part):
        try:
            next(part)
            while True:
                part.send([])
        except StopIteration as end:
            return end.value

    def is_settled(self, c):
        return False

    def telling(self, effects, takes):
        return takes


def found(search, name, *rivals, closed=0.6):
    """A fit with one effect as it is best alone, the round in which it was taken, and who else was fitted there."""
    def alone(n):
        c = candidate(n)
        return search.run(search.refitting(search.evaluated([(c, np.ones(c.size))]), (0,), 1))

    nominal, fit = search.evaluated([]), alone(name)
    trials = [Trial(f.effects[0], f.x, {use: nominal.cost[use] - f.cost[use] for use in f.cost}, None, closed=closed)
              for f in map(alone, (name, *rivals))]
    return fit, Round(nominal, tuple(trials), (trials[0],))


POOL = [candidate(n) for n in DOES]


@pytest.fixture(autouse=True)
def linear(monkeypatch):
    monkeypatch.setattr(pulls, "with_effects", lambda nominal, sizes: list(sizes))
    monkeypatch.setattr(pulls, "worthwhile", lambda search, t, takes, rounds, current: t.gain["choose"] > 300)


def test_a_slope_and_a_slippery_floor_are_found_where_a_pull_that_lifts_was():
    search = LinearSearch(ground_tilt=(2.0, 1.0), ground_friction=(1.5,))
    fit, seat = found(search, "tether_force", "ground_friction")
    assert fit.cost["choose"] > 500
    now, rounds = pulls.in_two(search, POOL, fit, [seat], silent)
    names = {c.name for c in now.effects}
    assert "ground_friction" in names
    assert names - {"ground_friction"} <= {"ground_tilt", "tether_force"}
    assert now.cost["choose"] == pytest.approx(0.0, abs=1e-9)
    assert [len(r.accepted) for r in rounds] == [1, 1]
    assert {r.accepted[0].candidate.name for r in rounds} == names
    assert all(r is not seat for r in rounds)


def test_one_that_explains_nearly_all_is_left_alone_and_nothing_is_asked():
    search = LinearSearch(ground_tilt=(2.0, 1.0))
    fit, seat = found(search, "ground_tilt", closed=0.99)
    assert pulls.in_two(search, POOL, fit, [seat], silent) == (fit, [seat])
    assert search.asked == 0


def test_two_that_bring_little_more_than_one_do_not_take_its_place():
    search = LinearSearch(ground_tilt=(2.0, 1.0), soft_ground=(0.1,))
    fit, seat = found(search, "tether_force")
    assert 0 < fit.cost["choose"] < 300
    assert pulls.in_two(search, POOL, fit, [seat], silent)[0] is fit
    assert search.asked > 0


def test_two_of_the_ground_take_the_place_of_a_joint_that_was_found_for_them():
    search = LinearSearch(ground_tilt=(2.0, 1.0), ground_friction=(1.5,))
    fit, seat = found(search, "backlash", "ground_friction", "tether_force")
    now, rounds = pulls.in_two(search, POOL, fit, [seat], silent)
    assert "backlash" not in {c.name for c in now.effects}
    assert now.cost["choose"] == pytest.approx(0.0, abs=1e-9)
    assert all("tether_force" in {t.candidate.name for t in r.trials} for r in rounds), "a pull's rivals stay, for its place"


def test_joints_loads_and_what_was_only_foretold_get_no_company():
    search = LinearSearch(ground_tilt=(2.0, 1.0), ground_friction=(1.5,))
    for name in ("backlash", "payload"):
        fit, seat = found(search, name)
        assert pulls.in_two(search, POOL, fit, [seat], silent) == (fit, [seat])
    fit, seat = found(search, "tether_force", "ground_friction")
    told = replace(seat, trials=(seat.trials[0], replace(seat.trials[1], foretold=True)))
    pulls.in_two(search, POOL, fit, [seat], silent)
    both, search.asked = search.asked, 0
    pulls.in_two(search, POOL, fit, [told], silent)
    assert 0 < search.asked < both
