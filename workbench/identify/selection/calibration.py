"""Calibration of probabilities: conditions that make a finding less certain, independent of its rivals."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from workbench.compare.channels import joint_of
from workbench.identify.fitting.doubts import pulls_down
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.parameters import Candidate
from workbench.identify.problem import ratios
from workbench.identify.selection.model_comparison import NamePosterior
from workbench.identify.selection.options import CALIBRATION, COMPARISON, SCHEDULING
from workbench.types import Array, Mask


def calibrate(search: Search, fit: Fit, posteriors: Sequence[NamePosterior], floors: Mapping[int, Array],
            changing: Collection[Candidate] = (), idle: Collection[Candidate] = ()) -> list[NamePosterior]:
    """Lowers each probability by a factor for: large residuals at the effect's joint or link on the fixed-base takes that
    identified it, or parameters that these would change (for an effect on every joint, at joints without an effect of their own);
    ground friction close to the model's; a parameter at its bound or close to zero; a purely vertical pull, or an almost equally
    probable rival of that kind; an effect that is `idle` at a finer step. floors: of the fit, by take."""
    left = [(channel, r) for i in search.fixed_base if i in floors
            for channel, r in ratios(search.evaluator.evidence[i], fit.residuals[i] / np.hypot(1.0, floors[i]), "choose").items()]
    out, theirs = [], {c.joint for c in fit.effects}
    for (c, x), own_x, s in zip(fit.sizes(), fit.slices(), posteriors):
        worst = _left_at(c, left, theirs) if search.identified_on_fixed_base(c) else 0.0
        factor = next((factor for most, factor in CALIBRATION.left if worst <= most), COMPARISON.least)
        if c.read_off and c.effect.free_play:
            factor = max(factor, CALIBRATION.rattles)
        factor *= CALIBRATION.changing if c in changing else 1.0
        makes = ~c.shapes if _becomes(c, s) else c.makes
        slight = (_hardly_another_floor(c, x) or _at_its_limit(c, x)
                  or _may_be_nothing(c, x, fit.covariance[own_x, own_x], makes) or _may_hang(c, x, s))
        factor *= COMPARISON.least if c in idle else CALIBRATION.hardly if slight else 1.0
        out.append(NamePosterior(factor * s.probability, tuple(replace(r, probability=factor * r.probability) for r in s.rivals)))
    return out


def _left_at(c: Candidate, left: Sequence[tuple[str, float]], theirs: Collection[str | None]) -> float:
    """The most that is left, of ratios by channel, at an effect's place; of the whole robot one joint may err for itself."""
    by_joint: dict[str, float] = {}
    for channel, r in left:
        joint = joint_of(channel)
        if r == r and (joint == c.joint or (c.joint is None and joint not in theirs)):
            by_joint[joint] = max(r, by_joint.get(joint, 0.0))
    ranked = sorted(by_joint.values(), reverse=True)
    own = not c.where and len(ranked) > SCHEDULING.few
    return ranked[1] if own else max(ranked, default=0.0)


def _hardly_another_floor(c: Candidate, x: Array) -> bool:
    """Whether an effect only changes a friction of feet and floor, by less than engines differ there."""
    if c.effect.layer != "ground" or not c.parameters[0].replaces:
        return False
    return bool(abs(np.log(c.values(x)[0] / c.neutral[0])) < CALIBRATION.alike_floor)


def _may_be_nothing(c: Candidate, x: Array, covariance: Array, makes: Mask) -> bool:
    """Whether all parameters that scale an effect are within CALIBRATION.nothing of the values at which it vanishes."""
    half = CALIBRATION.nothing * np.sqrt(np.diag(covariance))
    makes = makes & np.isfinite(half)
    return not c.read_off and bool(makes.any()) and bool(np.all(np.abs(x) < half, where=makes))


def _may_hang(c: Candidate, x: Array, s: NamePosterior) -> bool:
    """Whether an effect, or a rival about as likely, pulls straight down."""
    return pulls_down(c, x) or any(
        pulls_down(r.candidate, r.x) for r in s.rivals if r.probability > CALIBRATION.about_as_likely * s.probability
    )


def _becomes(c: Candidate, s: NamePosterior) -> bool:
    """Whether the limiting case of an effect is another candidate: a load without mass, a displaced centre of mass."""
    return any(r.candidate.key == (c.effect.reduces_to, c.where) for r in s.rivals)


def _at_its_limit(c: Candidate, x: Array) -> bool:
    """Whether a parameter is at its bound, away from the value at which the effect vanishes."""
    return not c.read_off and any(np.any(np.isclose(x, end, rtol=1e-3) & (end != 0) & ~c.shapes) for end in c.bounds())
