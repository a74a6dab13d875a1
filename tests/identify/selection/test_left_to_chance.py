"""A loose link's channels once it is found."""

import numpy as np
import pytest

from tests.gap_worn import CONFIG, NOMINAL, gathered
from workbench.compare.channels import ACROSS
from workbench.effects.registry import known_effects
from workbench.identify.fitting.fits import Search
from workbench.identify.parameters import Candidate
from workbench.identify.rollouts.evaluator import RolloutEvaluator
from workbench.identify.selection.reconsider import left_to_chance

EMPTY = np.empty(0)


def test_across_its_axis_a_loose_link_may_lie_anywhere_in_its_play_and_nothing_else_changes(tmp_path):
    session, evidence = gathered(tmp_path, NOMINAL)
    search = Search(RolloutEvaluator(evidence, CONFIG, n_jobs=1), session.model)
    axis = (1.0, 0.0, 0.0)
    mount = Candidate.of(known_effects()["loose_mount"], ("two",), (0.0, *axis), (4.0, *axis), (True,) * 4)
    fit = search.evaluate([(mount, EMPTY)])
    assert left_to_chance(search, fit, {mount.key}) == (search, fit)  # it was known
    wider, there = left_to_chance(search, fit, ())
    (e,) = wider.evaluator.evidence
    across = np.array([c.startswith("two" + ACROSS) for c in e.channels])
    assert across.sum() == 2
    was, now = (np.sqrt(np.nanmean(np.square(f.residuals[0]), axis=0)) for f in (fit, there))
    assert now[~across] == pytest.approx(was[~across])
    chance = np.deg2rad(4.0) / np.sqrt(6.0)
    assert now[across] == pytest.approx(was[across] / np.sqrt(1 + (chance / e.sigma[across]) ** 2))
    assert there.cost["fit"] < fit.cost["fit"]
