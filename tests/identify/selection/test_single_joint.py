"""In a robot of one joint, effects that do nearly the same share the work where no other set leaves what a right model does."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.gap_linear import COUNT, LinearSearch, candidate
from workbench.identify.selection import single_joint
from workbench.identify.selection.candidate_fit import CandidateFit
from workbench.identify.selection.record import SelectionStep

RNG = np.random.default_rng(5)
SLOW, HEAVY = RNG.normal(size=(2, COUNT))
DOES = {"supply_voltage": [SLOW], "viscous_friction": [SLOW + 0.3 * RNG.normal(size=COUNT)], "parallel_spring": [HEAVY]}


class Search(LinearSearch):
    def __init__(self, **sizes):
        super().__init__(DOES, **sizes)
        self.nominal = SimpleNamespace(joints=("swing",))
        by_all = self.evaluator.by_channel
        self.evaluator.by_channel = lambda left, use, joint: by_all(left, use)


def found(search, **sizes):
    """A fit, and the round of each of its effects, with friction as the supply's rival."""
    fit = search.evaluated([(candidate(name), np.array(x)) for name, x in sizes.items()])
    rounds = []
    for c, x in fit.sizes():
        trials = [CandidateFit(c, x, {"fit": 2e5, "choose": 1e5}, None)]
        if c.name == "supply_voltage":
            trials += [CandidateFit(candidate(name), np.array([size]), {"fit": 2 * gain, "choose": gain}, None)
                       for name, size, gain in (("viscous_friction", 3.0, 9e4), ("dead_band", 6.0, 4e4))]
        rounds.append(SelectionStep(fit, tuple(trials), (trials[0],)))
    return fit, rounds


def fitted(search, current, chosen, *a):
    """Sets at their end at once."""
    return [(search.run(search.refitting(search.evaluated([(t.candidate, t.x) for t in s]), (0,), 1)), s) for s in chosen]


@pytest.mark.parametrize(("hidden", "named"), [
    ({"supply_voltage": [20.0], "viscous_friction": [20.0], "parallel_spring": [5.0]}, True),
    ({"supply_voltage": [40.0], "parallel_spring": [5.0]}, False)])
def test_effects_that_share_the_work_are_named_where_one_alone_leaves_more_than_noise(monkeypatch, hidden, named):
    search = Search(**hidden)
    search.recorded = search.recorded + RNG.normal(size=COUNT)
    monkeypatch.setattr(single_joint, "_looked_at", lambda *a: [])
    monkeypatch.setattr(single_joint, "exchanges", lambda *a, **k: [])
    begun = []
    monkeypatch.setattr(single_joint, "_fitted", lambda of, fit, chosen, *a: begun.extend(chosen) or fitted(of, fit, chosen))
    fit, rounds = found(search, supply_voltage=[40.0], parallel_spring=[5.0])
    after, seats = single_joint.set_right(search, [], fit, rounds, (0,), lambda share: None)
    assert {c.name for c in after.effects} == set(hidden)
    assert len(seats) == (3 if named else 0)
    assert [{t.candidate.name: float(t.x[0]) for t in s} for s in begun] == (
        [{"supply_voltage": 20.0, "parallel_spring": 5.0, "viscous_friction": 1.5}] if named else [])


@pytest.mark.parametrize(("found_so_far", "replaced"), [([38.0], False), ([10.0], True)])
def test_a_set_that_is_not_right_replaces_what_leaves_twenty_times_more(monkeypatch, found_so_far, replaced):
    search = Search(supply_voltage=[40.0], parallel_spring=[5.0])
    search.recorded = search.recorded + 1.3 * RNG.normal(size=COUNT)
    monkeypatch.setattr(single_joint, "_looked_at", lambda *a: [])
    other = [CandidateFit(candidate(name), np.array([1.0]), {}, None) for name in ("supply_voltage", "parallel_spring")]
    monkeypatch.setattr(single_joint, "exchanges", lambda *a, **k: [other])
    monkeypatch.setattr(single_joint, "_shared", lambda *a: [])
    monkeypatch.setattr(single_joint, "_fitted", fitted)
    fit, rounds = found(search, supply_voltage=found_so_far, parallel_spring=[5.0])
    after, _ = single_joint.set_right(search, [], fit, rounds, (0,), lambda share: None)
    assert (after is not fit) is replaced


def test_a_set_that_is_not_right_either_does_not_replace_what_was_found(monkeypatch):
    search = Search(supply_voltage=[40.0], parallel_spring=[5.0])
    search.recorded = search.recorded + 3.0 * RNG.normal(size=COUNT)
    monkeypatch.setattr(single_joint, "_looked_at", lambda *a: [])
    monkeypatch.setattr(single_joint, "exchanges", lambda *a, **k: [])
    monkeypatch.setattr(single_joint, "_fitted", fitted)
    fit, rounds = found(search, supply_voltage=[40.0], parallel_spring=[5.0])
    assert single_joint.set_right(search, [], fit, rounds, (0,), lambda share: None) == (fit, [])


def test_a_shape_that_came_to_its_end_begins_in_the_middle():
    c = next(c for c in (candidate("stribeck_friction"),) if c.shapes.any())
    _, high = c.bounds()
    assert single_joint._free(c, high)[c.shapes] == 0
    inside = np.where(c.shapes, high / 2, 1.0)
    np.testing.assert_array_equal(single_joint._free(replace(c), inside), inside)
