"""Gravity over torque as one number, and the size of each effect that would explain it alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.identify.conclusions import estimates
from workbench.identify.evidence.fit import Asks, Fitted, fit_hypothesis, polish, with_better
from workbench.identify.evidence.hypothesis import FAR, Hypothesis, Uncertain
from workbench.identify.evidence.linearise import linearise, linearised_around
from workbench.identify.evidence.nuisance import mixing
from workbench.identify.evidence.options import EvidenceOptions, SinceThen
from workbench.identify.evidence.plausible import at_their_end
from workbench.identify.evidence.posterior import RegionPosterior
from workbench.identify.evidence.recalibration import as_stated
from workbench.identify.evidence.region import Region
from workbench.identify.evidence.tied import GRAVITY, TORQUES, all_torques, as_torque, competes
from workbench.identify.fitting.lockstep import side_by_side
from workbench.identify.options import CONCLUSIONS
from workbench.identify.results.findings import Alternative, Estimate, Finding
from workbench.identify.results.servo_law import GravityOverTorque, TiedName

SCALE = "torque_at_full_duty"


@dataclass(frozen=True)
class Ratio:
    """Logarithm of gravity over torque, in times the nominal one, with its standard deviation."""

    log: float
    sd: float

    def is_apart(self, options: EvidenceOptions) -> bool:
        """Whether it differs from one by more than its error and the variation of a servo's torque between days."""
        between_days = (options.drift or SinceThen()).torque
        return abs(self.log) > options.apart * math.hypot(self.sd, between_days)

    def estimate(self, options: EvidenceOptions) -> Estimate:
        """The ratio with its 90 % interval, as much wider than the fit claims as any number of a servo's law
        (`EvidenceOptions.formal`)."""
        half = CONCLUSIONS.z90 * options.formal * self.sd
        return Estimate(math.exp(self.log), math.exp(self.log - half), math.exp(self.log + half), "1")


def ratio_of(region: Region, options: EvidenceOptions, f: Fitted) -> Ratio | None:
    """The ratio of gravity to torque in a fit: the torque that it recalibrated, and its effects that act as torques do; None
    where no torque is uncertain."""
    h = f.hypothesis
    scale = [k for k, n in enumerate(h.numbers) if n.name == SCALE]
    if not scale:
        return None
    slope = np.zeros(len(h.theta))
    slope[:len(h.numbers)] = -mixing(h.numbers)[scale[0]]
    log = float(slope @ h.theta)
    for c, own in zip(h.effects, h.slices()):
        tie, x = as_torque(region, options, f, c), h.theta[own]
        if tie is not None:
            log -= tie.by
            slope[own] = -tie.by * x / float(x @ x)
    return Ratio(log, math.sqrt(max(0.0, float(slope @ f.covariance(region, options) @ slope))))


@dataclass(frozen=True)
class TieFits:
    """Fits that each explain a ratio of gravity to torque by one cause, to this region. torque: by the servo's torques alone;
    names: by one effect and nominal torques, the likeliest first."""

    region: Region
    torque: Fitted
    names: tuple[Fitted, ...]

    def behind(self, f: Fitted) -> float:
        """How much less likely a fit is than the likeliest [nats]."""
        return max(g.log_evidence for g in (self.torque, *self.names)) - f.log_evidence


def fits_of_tie(region: Region, options: EvidenceOptions, f: Fitted) -> Asks[TieFits | None]:
    """Fits of the servo's torques alone, and of each effect of the tie alone, with the servo's torques at their nominal values
    but for their variation between days. None where gravity over torque is nominal and the fit has no effect of the tie. A moved
    centre of mass, a tilt and a turned servo all turn gravity without changing its size."""
    ratio = ratio_of(region, options, f)
    members = tuple(c for c in region.candidates if competes(c))
    named = any(competes(c) for c in f.hypothesis.effects)
    if ratio is None or not members or not (named or ratio.is_apart(options)):
        return None
    published = replace(region, numbers=tuple(as_told(region.numbers, options)), candidates=members)
    rest = [(c, x) for c, x in f.hypothesis.sizes() if not competes(c)]
    torque = f
    if len(rest) < len(f.hypothesis.effects):
        alone = Hypothesis(region.numbers, tuple(c for c, _ in rest), np.concatenate([f.hypothesis.z, *(x for _, x in rest)]))
        torque = yield from fit_hypothesis(region, options, alone, f.discrepancy, options.iterations)
        torque = yield from polish(region, options, torque)
    sizes = np.concatenate([0.0 * f.hypothesis.z, *(x for _, x in rest)])
    without = Hypothesis(published.numbers, tuple(c for c, _ in rest), sizes)
    fits = yield from _each_alone(published, options, without, f)
    within = [g for g in fits if not at_their_end(g.hypothesis, members) and np.any(g.hypothesis.sizes()[-1][1])]
    return TieFits(region, torque, tuple(sorted(within, key=lambda g: -g.log_evidence)))


def _each_alone(published: Region, options: EvidenceOptions, without: Hypothesis, f: Fitted) -> Asks[list[Fitted]]:
    """The likeliest fit of each candidate in addition to a hypothesis, from three starts: the law fitted without it, which is
    distorted for want of it (a zero goes as far as it may where gravity leans); the law as it stands; and that of the fit f,
    which is not distorted where it has another of the candidates."""
    bare = yield from fit_hypothesis(published, options, without, f.discrepancy, options.iterations)
    moves = list((yield from linearise(published, options, bare)))
    as_fitted = f.hypothesis.z * [n.sd / t.sd for n, t in zip(f.hypothesis.numbers, published.numbers)]
    for z in (without.z, np.clip(as_fitted, -FAR, FAR)):
        moves += (yield from linearised_around(published, options, without.at(np.concatenate([z, without.theta[len(z):]]))))[1]
    fits = yield from side_by_side([
        fit_hypothesis(published, options, m.hypothesis, f.discrepancy, options.iterations) for m in moves
        if all(competes(c) for c in m.added)])  # not another option of an effect that stays
    fits = yield from side_by_side([polish(published, options, g) for g in fits])
    return list(with_better({}, fits).values())


def shared_by_tie(f: Finding, tie: GravityOverTorque | None) -> Finding:
    """The finding; where other names of its tie are as likely, within the nats by which fits of one model differ, with its share
    of the tie's probability, which is divided equally among all of these."""
    if tie is None:
        return f
    near = tie.competitive
    others = [n for n in near if (n.effect, n.where) != (f.effect, f.where)]
    if not others or len(others) == len(near):
        return f
    each = min(f.confidence, tie.confidence / len(near))
    rival = Alternative(others[0].effect, others[0].where, each)
    return replace(f, confidence=each, of_tie=tie.confidence, alternatives=(rival,))


def as_told(numbers: Sequence[Uncertain], options: EvidenceOptions) -> list[Uncertain]:
    """The numbers with torques that may vary no more than between days, so that an effect has to explain the rest."""
    drift = options.drift or SinceThen()
    more = all_torques(numbers)
    if any(n.others for n in numbers) or not more.any():
        return list(numbers)  # an earlier diagnosis knew them together
    return [replace(n, sd=min(n.sd, drift.of(n.name))) if n.name in TORQUES else n for n in numbers]


def _is_same_model(a: Hypothesis, b: Hypothesis) -> bool:
    """Whether two hypotheses differ in their sizes alone, and end with the same effect."""
    return (a.key, a.numbers, a.effects[-1:]) == (b.key, b.numbers, b.effects[-1:])


def gravity_over_torque(region: Region, options: EvidenceOptions, p: RegionPosterior, fits: TieFits | None,
                        weighed: bool = False) -> GravityOverTorque | None:
    """The tie as it is reported; None where nothing of it has changed, or where an effect that could look like one of its effects
    (`Effect.resembles`) is distinguished from all of them. region: of the posterior, whose last fit may be to more of the
    takes than `fits`, which are of `fits_of_tie`; weighed: as the result has it."""
    ratio = ratio_of(region, options, p.best)
    if ratio is None or fits is None or not fits.names:
        return None
    near = [g.hypothesis.effects[-1] for g in fits.names if fits.behind(g) < options.occam]
    if not (ratio.is_apart(options) or any(c.effect.tied == GRAVITY for c in (*p.best.hypothesis.effects, *near))):
        return None
    names = []
    for g in fits.names:
        is_found = _is_same_model(p.best.hypothesis, g.hypothesis)  # then its finding's size
        shown, to = (p.best, region) if is_found else (g, fits.region)
        h, whole = as_stated(shown, to, options)
        (c, x), own = h.sizes()[-1], h.slices()[-1]
        formal, tie = whole[own, own], as_torque(to, options, shown, c)
        covariance = formal if tie is None else tie.covariance(formal, x)
        names.append(TiedName(c.name, c.where, estimates(c, x, covariance), c.effect.sentence(c.spec(x)),
                              fits.behind(g)))
    ties = [as_torque(region, options, p.best, c) for c in p.best.hypothesis.effects]
    share = min((t.share for t in ties if t is not None), default=1.0)
    there = sum(w for f, w in p.weights if any(competes(c) for c in f.hypothesis.effects))
    return GravityOverTorque(region.joints, ratio.estimate(options), min(1.0, CONCLUSIONS.surest * share * there),
                             tuple(names), options.drift is not None, options.occam, fits.behind(fits.torque), weighed)
