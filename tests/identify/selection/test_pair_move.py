"""Two causes on the ground that one explains in part: that one and what came near it are given company."""

from dataclasses import replace

import numpy as np
import pytest

from tests.gap_linear import COUNT, LinearSearch, candidate
from workbench.identify.selection import pair_move
from workbench.identify.selection.record import CandidateFit, SelectionStep

FORWARD, LEFT, SLIPPERY, LIFTS, SOFT = np.random.default_rng(4).normal(size=(5, COUNT)) * 2.0
DOES = {"ground_tilt": [FORWARD, LEFT], "tether_force": [FORWARD, LEFT, 0.8 * SLIPPERY + 0.6 * LIFTS],
        "ground_friction": [SLIPPERY], "soft_ground": [SOFT], "backlash": [LIFTS], "payload": [LIFTS] * 4}
"""Response of a walk to each parameter at its typical size: an upward pull acts much like a slippery floor."""


def found(search, name, *rivals, closed=0.6):
    """A fit with one effect as it is best alone, the round in which it was taken, and who else was fitted there."""
    def alone(n):
        c = candidate(n)
        return search.run(search.refitting(search.evaluate([(c, np.ones(c.size))]), (0,), 1))

    nominal, fit = search.evaluate([]), alone(name)
    trials = [CandidateFit(f.effects[0], f.x, {use: nominal.cost[use] - f.cost[use] for use in f.cost}, None, closed=closed)
              for f in map(alone, (name, *rivals))]
    return fit, SelectionStep(nominal, tuple(trials), (trials[0],))


def silent(stage, share):
    """Progress that nobody reads."""


POOL = [candidate(n) for n in DOES]


@pytest.fixture(autouse=True)
def linear(monkeypatch):
    monkeypatch.setattr(pair_move, "with_effects", lambda nominal, sizes: list(sizes))
    monkeypatch.setattr(pair_move, "too_little_left", lambda search, current, takes, rounds: current.cost["choose"] < 1)
    monkeypatch.setattr(pair_move, "is_acceptable", lambda search, t, takes, rounds, current: t.gain["choose"] > 300)


def test_a_slope_and_a_slippery_floor_are_found_where_a_pull_that_lifts_was():
    search = LinearSearch(DOES, ground_tilt=(2.0, 1.0), ground_friction=(1.5,))
    fit, seat = found(search, "tether_force", "ground_friction")
    assert fit.cost["choose"] > 500
    now, rounds = pair_move.with_pair(search, POOL, fit, [seat], silent)
    names = {c.name for c in now.effects}
    assert "ground_friction" in names
    assert names - {"ground_friction"} <= {"ground_tilt", "tether_force"}
    assert now.cost["choose"] == pytest.approx(0.0, abs=1e-9)
    assert [len(r.accepted) for r in rounds] == [1, 1]
    assert {r.accepted[0].candidate.name for r in rounds} == names
    assert all(r is not seat for r in rounds)


def test_one_that_explains_nearly_all_is_left_alone_and_nothing_is_asked():
    search = LinearSearch(DOES, ground_tilt=(2.0, 1.0))
    fit, seat = found(search, "ground_tilt", closed=0.99)
    assert pair_move.with_pair(search, POOL, fit, [seat], silent) == (fit, [seat])
    assert search.asked == 0


def test_where_nothing_is_left_nothing_is_asked():
    search = LinearSearch(DOES, ground_tilt=(2.0, 1.0))
    fit, seat = found(search, "ground_tilt")
    assert pair_move.with_pair(search, POOL, fit, [seat], silent) == (fit, [seat])
    assert search.asked == 0


def test_two_that_bring_little_more_than_one_do_not_take_its_place():
    search = LinearSearch(DOES, ground_tilt=(2.0, 1.0), soft_ground=(0.1,))
    fit, seat = found(search, "tether_force")
    assert 0 < fit.cost["choose"] < 300
    assert pair_move.with_pair(search, POOL, fit, [seat], silent)[0] is fit
    assert search.asked > 0


def test_two_of_the_ground_take_the_place_of_a_joint_that_was_found_for_them():
    search = LinearSearch(DOES, ground_tilt=(2.0, 1.0), ground_friction=(1.5,))
    fit, seat = found(search, "backlash", "ground_friction", "tether_force")
    now, rounds = pair_move.with_pair(search, POOL, fit, [seat], silent)
    assert "backlash" not in {c.name for c in now.effects}
    assert now.cost["choose"] == pytest.approx(0.0, abs=1e-9)
    assert all("tether_force" in {t.candidate.name for t in r.trials} for r in rounds), "a pull's rivals stay, for its place"


def test_a_load_gets_no_company_and_what_was_only_predicted_gives_none():
    search = LinearSearch(DOES, ground_tilt=(2.0, 1.0), ground_friction=(1.5,))
    fit, seat = found(search, "payload")
    assert pair_move.with_pair(search, POOL, fit, [seat], silent) == (fit, [seat])
    fit, seat = found(search, "tether_force", "ground_friction")
    told = replace(seat, trials=(seat.trials[0], replace(seat.trials[1], screened_out=True)))
    pair_move.with_pair(search, POOL, fit, [seat], silent)
    both, search.asked = search.asked, 0
    pair_move.with_pair(search, POOL, fit, [told], silent)
    assert 0 < search.asked < both
