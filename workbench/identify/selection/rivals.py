"""Rivals of an effect: the close ones, each fitted as its replacement."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.fitting.responses import Part
from workbench.identify.parameters import Candidate, Key
from workbench.identify.selection.candidate_fit import CandidateFit
from workbench.identify.selection.odds import by_both, is_by_floating_base
from workbench.identify.selection.options import FORWARD, RIVAL
from workbench.identify.selection.record import SelectionStep
from workbench.types import Array

TakenIn = dict[Key, tuple[SelectionStep, CandidateFit]]
"""By effect, when it was taken and on what."""


def rivals_near(search: Search, taken_in: TakenIn, effects: Sequence[Candidate], c: Candidate, x: Array) -> list[CandidateFit]:
    """Rivals that came close to an effect when it was accepted, and are not in the model; its equivalent effect; the limiting
    case of its shape; where floating-base takes identify it, displaced centres of mass of other links, which tip the robot as
    much once they are fitted to the end."""
    r, trial = taken_in[c.key]
    taken = {e.key for e in effects}
    reach = max(RIVAL.near, (FORWARD.close if trial.joint is None else RIVAL.near_fixed) * trial.gain["choose"])
    there = [t for t in r.rivals(trial) if t.candidate.key not in taken]
    alike = {(name, c.where) for name in c.effect.equivalent_to if trial.joint is None}
    if _at_its_end(c, x):
        alike.add((c.effect.reduces_to, c.where))
    tips = is_by_floating_base(search, c, trial) and c.effect.layer == "inertia"
    always = [t for t in there if t.candidate.key in alike
              or (tips and not t.screened_out and t.candidate.effect.moves_center and t.candidate.where != c.where)]
    near = [t for t in there if not t.screened_out and t not in always and _behind(trial, t) < reach]
    return always + near[:FORWARD.most_rivals]


def _behind(trial: CandidateFit, t: CandidateFit) -> float:
    """Deficit of a rival; where all channels of a walk judge, a prediction counts as much as a fit."""
    behind = {use: trial.gain[use] - t.gain[use] for use in trial.gain}
    return min(behind["choose"], by_both(behind)) if trial.joint is None else behind["choose"]


def _at_its_end(c: Candidate, x: Array) -> bool:
    """Whether a number that only shapes an effect, if there is one, is as far as it may go."""
    low, high = c.bounds()
    return not c.shapes.any() or bool(np.any(c.shapes & ((x < low + RIVAL.shape_end) | (x > high - RIVAL.shape_end))))


def replace_effect(search: Search, fit: Fit, i: int, rival: CandidateFit) -> Part[Fit]:
    """The fit with a rival in place of effect i and its parameters fitted, together with those of others in its joint where
    fixed-base takes identify them; the same effect elsewhere starts from the size of the other, and a rival from the equivalent
    values, if that is better."""
    others = [s for j, s in enumerate(fit.sizes()) if j != i]
    own, size = fit.sizes()[i]
    alike = (rival.candidate.name, rival.candidate.size) == (own.name, own.size)
    starts = [rival.x, np.clip(size, *rival.candidate.bounds())] if alike else [rival.x]
    values = own.effect.as_other(rival.candidate.name, own.spec(size), search.nominal)
    if values and rival.candidate.where == own.where:
        starts.append(rival.candidate.sizes(values))
    there = min((yield from search.evaluating(*([*others, (rival.candidate, x)] for x in starts))), key=lambda f: f.cost["fit"])
    if there.cost["choose"] - fit.cost["choose"] > max(2 * RIVAL.near, 2 * FORWARD.close * rival.gain["choose"]):
        return there
    fixed = search.identified_on_fixed_base(own)
    takes = search.fixed_base if fixed else search.fitted
    beside = [j for j, (c, _) in enumerate(others) if fixed and c.joint == own.joint]
    return (yield from search.refitting(there, takes, RIVAL.steps, free=[*beside, len(others)]))
