"""Servo logs explained by evidence: from recordings to a model with its names, their probabilities, and what speaks against
others."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.compare.session_takes import Progress
from workbench.identify.conclusions import Residuals, change, estimates, value_slopes
from workbench.identify.evidence.fit import Asks, Fitted, fitting, regressed
from workbench.identify.evidence.holdout import folds_of, vetoed
from workbench.identify.evidence.nested import told_from_nothing
from workbench.identify.evidence.nuisance import (
    UNITS,
    ZERO,
    Uncertain,
    as_mapping,
    nominal_value,
    turned_horn,
    uncertain_numbers,
)
from workbench.identify.evidence.options import NUMERICS, EvidenceOptions
from workbench.identify.evidence.plausible import at_their_end
from workbench.identify.evidence.posterior import RegionPosterior, posterior_of
from workbench.identify.evidence.region import Region, region_of
from workbench.identify.evidence.registers import within_registers
from workbench.identify.evidence.robot_search import RobotFound, search_robot
from workbench.identify.evidence.robot_wide import Whole
from workbench.identify.evidence.rollouts import Rollouts, step_errors
from workbench.identify.evidence.search import Found, gone_on, lockstep, standing, without_names
from workbench.identify.options import CONCLUSIONS
from workbench.identify.parameters import Candidate
from workbench.identify.problem import TakeEvidence
from workbench.identify.results.findings import Alternative, FamilyBelief, Finding, Recalibrated, Rejected
from workbench.identify.results.reasons import LessLikely, Reason, SpokenAgainst
from workbench.identify.results.ties import Tie
from workbench.identify.rollouts import RolloutEvaluator
from workbench.robot import RobotModel
from workbench.robot.model_file import Posterior, parameter_names

Array = NDArray[np.float64]
WORTH_SAYING = 0.01
"""Least probability of an alternative that is named."""


@dataclass(frozen=True)
class Explanation:
    """The likeliest model, and all that was believed beside it. regions, fits, posteriors: alike, one a region; robot: what acts
    in all of them; rejected: refuted by registers or by takes kept back; stopped: by the limit of work."""

    nominal: RobotModel
    rollouts: Rollouts
    found: tuple[Found, ...]
    posteriors: tuple[RegionPosterior, ...]
    robot: RobotFound
    rejected: tuple[Rejected, ...]
    options: EvidenceOptions
    stopped: bool = False

    @property
    def model(self) -> RobotModel:
        """The robot with its numbers recalibrated and its effects."""
        return self.rollouts.model([p.best.hypothesis for p in self.posteriors])

    @property
    def recalibrated(self) -> tuple[Recalibrated, ...]:
        """Numbers of the nominal law that are used otherwise."""
        return tuple(r for p in self.posteriors
                     for r in what_changed(self.nominal, as_mapping(p.best.hypothesis.numbers, p.best.hypothesis.z)))

    def findings(self, evidence: Sequence[TakeEvidence], before: Residuals, after: Residuals) -> tuple[Finding, ...]:
        """The likeliest model's effects, the surest first."""
        out = self._of_robot(evidence, before, after)
        for region, p in zip(self.rollouts.regions, self.posteriors):
            h, covariance = p.best.hypothesis, p.best.covariance(region, self.options)
            for (c, x), s in zip(h.sizes(), h.slices()):
                family, rival = c.effect.family, p.rival((c.name, c.where))
                others = [] if rival is None else [Alternative(*rival[0], rival[1])]
                share = 1.0
                if (of_all := self.robot.rivals.get(c.key)) is not None:
                    share = 1.0 / (1.0 + math.exp(min(of_all[1], 700.0)))
                    others.append(Alternative(of_all[0].name, of_all[0].where, 1.0 - share))
                others = sorted((o for o in others if o.confidence >= WORTH_SAYING), key=lambda o: -o.confidence)
                fit, validation = (change(evidence, c.where, before, after, use) for use in ("fit", "validate"))
                out.append(Finding(
                    c.name, c.where, share * p.named[c.name, c.where], estimates(c, x, covariance[s, s]), fit, validation,
                    tuple(others[:1]), c.effect.sentence(c.spec(x)),
                    family=None if family is None else FamilyBelief(family, share * p.families[family])))
        return tuple(sorted(out, key=lambda f: -f.confidence))

    def _of_robot(self, evidence: Sequence[TakeEvidence], before: Residuals, after: Residuals) -> list[Finding]:
        """What acts in all joints at once."""
        out, at, sure = [], self.robot.together, self.robot.sure
        nats = at.log_posterior
        for (c, x), s in zip(at.shared.sizes(), at.shared.slices()):
            others = tuple(Alternative(o.name, o.where, sure * math.exp(min(0.0, other - nats)))
                           for o, other in self.robot.instead if o is not None)
            fit, validation = (change(evidence, c.where, before, after, use) for use in ("fit", "validate"))
            out.append(Finding(
                c.name, c.where, sure, estimates(c, x, at.covariance[s, s]), fit, validation,
                tuple(o for o in others if o.confidence >= WORTH_SAYING)[:1], c.effect.sentence(c.spec(x)),
                family=None if c.effect.family is None else FamilyBelief(c.effect.family, sure)))
        return out

    def posterior(self) -> Posterior:
        """Of all numbers of the model's effects, in the units of docs/formats.md; a recalibrated zero is one of them."""
        model = self.model
        names = parameter_names(model.effects)
        blocks: dict[tuple[str, tuple[str, ...]], Array] = {}
        for region, p in zip(self.rollouts.regions, self.posteriors):
            h, covariance = p.best.hypothesis, p.best.covariance(region, self.options)
            for k, number in enumerate(h.numbers):
                degrees = np.degrees(number.sd)
                zero = turned_horn(number.joint, number.sd)
                blocks.setdefault((zero.effect, zero.where), np.array([[degrees**2 * covariance[k, k]]]))
            for (c, x), s in zip(h.sizes(), h.slices()):
                slopes = value_slopes(c, x)
                blocks[c.name, c.where] = slopes @ covariance[s, s] @ slopes.T
        robot = self.robot.together
        for (c, x), s in zip(robot.shared.sizes(), robot.shared.slices()):
            slopes = value_slopes(c, x)
            blocks[c.name, c.where] = slopes @ robot.covariance[s, s] @ slopes.T
        mean = np.concatenate([np.empty(0), *(np.ravel(v) for e in model.effects for v in e.parameters.values())])
        whole, at = np.zeros((len(mean), len(mean))), 0
        for e in model.effects:
            n = sum(np.size(v) for v in e.parameters.values())
            block = blocks.get((e.effect, e.where), np.zeros((n, n)))
            whole[at:at + n, at:at + n] = block if block.shape == (n, n) else np.zeros((n, n))
            at += n
        return Posterior(names, mean, whole)

    def losers(self) -> tuple[Rejected, ...]:
        """Effects that were fitted and are not in the likeliest model, with the nats by which the best model with them is
        behind."""
        out = list(self.rejected)
        said = {(r.effect, r.where) for r in out}
        for p, found in zip(self.posteriors, self.found):
            kept = {(c.name, c.where) for c in p.best.hypothesis.effects}
            for f in sorted(found.fits.values(), key=lambda f: -f.log_posterior):
                for c in f.hypothesis.effects:
                    if (c.name, c.where) in kept | said:
                        continue
                    said.add((c.name, c.where))
                    behind = p.best.log_posterior - f.log_posterior
                    out.append(Rejected(c.name, c.where, LessLikely(behind)))
        return tuple(out)

    def ties(self) -> tuple[Tie, ...]:
        """The likeliest model beside the likeliest one in which another effect stands in a finding's place."""
        out = []
        for k, p in enumerate(self.posteriors):
            for c in p.best.hypothesis.effects:
                rival = p.rival((c.name, c.where))
                other = next((f for f, _ in p.weights if rival and rival[0] in {(o.name, o.where) for o in f.hypothesis.effects}
                              and (c.name, c.where) not in {(o.name, o.where) for o in f.hypothesis.effects}), None)
                if rival is not None and other is not None and rival[1] > CONCLUSIONS.worth_an_experiment:
                    hypotheses = [q.best.hypothesis for q in self.posteriors]
                    hypotheses[k] = other.hypothesis
                    out.append(Tie(self.model, self.rollouts.model(hypotheses), rival[1]))
        return tuple(out)


def is_by_logs(evidence: Sequence[TakeEvidence]) -> bool:
    """Whether all takes are servo logs of a held robot."""
    return all(e.take.spec.base == "fixed" and not e.take.recorded.zeroed for e in evidence)


def explain(evaluator: RolloutEvaluator, nominal: RobotModel, pool: Sequence[Candidate], progress: Progress,
            options: EvidenceOptions | None = None, thorough: bool = False) -> Explanation:
    """Searches each joint's effects by evidence. thorough: without a limit of work."""
    options = options or EvidenceOptions()
    whole = evaluator
    evaluator = whole.on(_begun(whole.evidence, options.seconds))
    evidence = evaluator.evidence
    joints = [j for j in nominal.joints if any(j in e.channels for e in evidence)]
    felt = [c for c in pool if c.where != (nominal.base,)]
    asked, refuted = within_registers(felt, [e.take for e in evidence], options)
    regions = tuple(_region(j, evidence, nominal, asked, options) for j in joints)
    shared = [c for c in asked if not c.where] if len(nominal.joints) > 1 else []
    most_work = math.inf if thorough else options.most_work
    robot, rejected = _searched(Rollouts.of(evaluator, nominal, regions, most_work), shared, felt, options, progress)
    rollouts, found, rejected = robot.rollouts, robot.found, [*refuted, *rejected]
    for _ in range(NUMERICS.rounds):
        said = [at_their_end(f.best.hypothesis, felt) for f in found]
        if not any(said):
            unlikely = lockstep(rollouts, {k: told_from_nothing(f.region, options, f.best) for k, f in enumerate(found)})
            said = [unlikely[k] for k in range(len(found))]
        if not any(said):
            progress("takes kept back", None)
            said = _kept_back(rollouts, evidence, found, options)
        if not any(said):
            break
        rejected += [Rejected(c.name, c.where, why) for gone in said for c, why in gone.items()]
        left = lockstep(rollouts, {k: without_names(f, options, gone) for k, (f, gone) in enumerate(zip(found, said)) if gone})
        found = tuple(left.get(k, f) for k, f in enumerate(found))
        rollouts, found = gone_on(rollouts, found, options, progress)
    stopped = rollouts.exhausted and any(f.goes_on(options) for f in found)
    progress("numbers at a finer step", None)
    entire = tuple(replace(_region(j, whole.evidence, nominal, (), options), candidates=f.region.candidates)
                   for j, f in zip(joints, found))
    finishing = {k: _finished(f, entire[k], options) for k, f in enumerate(found)}
    fine = replace(rollouts.around_here(NUMERICS.fine), evaluator=whole, regions=entire, errors=step_errors(whole, entire))
    last = lockstep(fine, finishing)
    found = tuple(last[k] for k in range(len(found)))
    fine = standing(fine, found)
    everywhere = Whole(fine, (), options)
    together = everywhere.fitted(everywhere.begun([f.best for f in found]))
    robot = replace(robot, together=replace(together, log_posterior=robot.together.log_posterior))
    believed = tuple(posterior_of(list(f.fits.values()), options) for f in found)
    return Explanation(nominal, replace(standing(rollouts, found), shared=together.shared), found, believed, robot,
                       tuple(rejected), options, stopped)


def _searched(rollouts: Rollouts, names: Sequence[Candidate], felt: Sequence[Candidate], options: EvidenceOptions,
              progress: Progress) -> tuple[RobotFound, list[Rejected]]:
    """Joints and robot searched; again where an effect of the whole robot went as far as is plausible."""
    rejected: list[Rejected] = []
    for _ in range(NUMERICS.rounds):
        robot = search_robot(rollouts, names, options, progress)
        gone = at_their_end(robot.together.shared, felt)
        if not gone:
            break
        rejected += [Rejected(c.name, c.where, why) for c, why in gone.items()]
        names = [c for c in names if c.key not in {g.key for g in gone}]
    return robot, rejected


def _kept_back(rollouts: Rollouts, evidence: Sequence[TakeEvidence], found: Sequence[Found], options: EvidenceOptions
               ) -> list[dict[Candidate, Reason]]:
    """By region, the effects that takes kept back speak against."""
    folds = [folds_of(evidence, [p.take for p in f.region.parts]) for f in found]
    said = lockstep(rollouts, {k: vetoed(f.region, options, f.best, fold) for k, (f, fold) in enumerate(zip(found, folds))
                               if f.best.hypothesis.effects and fold})
    return [{c: SpokenAgainst(-gain) for c, gain in said.get(k, {}).items()} for k in range(len(found))]


def _begun(evidence: Sequence[TakeEvidence], seconds: float) -> list[TakeEvidence]:
    """The beginnings of takes that are not for validation alone, of so many seconds together."""
    told = [e for e in evidence if e.uses["fit"].any() or e.uses["choose"].any()]
    lengths = sorted(float(e.since[-1]) for e in told)
    until, left = np.inf, seconds
    for k, length in enumerate(lengths):  # short takes are looked at to their end
        if length * (len(lengths) - k) > left:
            until = left / (len(lengths) - k)
            break
        left -= length
    return [replace(e, until=until) if any(e is t for t in told) else replace(e, until=0.0) for e in evidence]


def _region(joint: str, evidence: Sequence[TakeEvidence], nominal: RobotModel, pool: Sequence[Candidate], options: EvidenceOptions
            ) -> Region:
    return region_of([joint], evidence, uncertain_numbers(nominal, joint, zeroed=False), _acting(pool, joint, nominal), options)


def _finished(found: Found, entire: Region, options: EvidenceOptions) -> Asks[Found]:
    """The best fit with the last numbers, from whole takes; among the others it stays as likely as the search found it."""
    best = found.best
    (r,) = yield [best.hypothesis]
    region = entire.correlated(found.region.likelihood.tau)
    s = region.likelihood.discrepancy(r)
    fit: Fitted = yield from fitting(region, options, best.hypothesis, s, options.iterations, r)
    fit = yield from regressed(region, options, fit)
    fit = replace(fit, log_evidence=best.log_evidence, log_prior=best.log_prior)
    return replace(found, region=region, fits={**found.fits, best.hypothesis.key: fit})


def _acting(pool: Sequence[Candidate], joint: str, model: RobotModel) -> list[Candidate]:
    """Candidates that act in one joint: there, in the link that it carries, or, of a robot of one joint, anywhere."""
    if len(model.joints) == 1:  # where all joints are one, what all do is what it does
        own = {c.name for c in pool if c.where == (joint,)}
        return [c for c in pool if c.where or c.name not in own]
    link = model.kinematics.frames[joint].child
    return [c for c in pool if c.where in ((joint,), (link,))]


def what_changed(model: RobotModel, z: Mapping[Uncertain, float]) -> tuple[Recalibrated, ...]:
    """Nominal and recalibrated values, those that went furthest first."""
    out = []
    for number, by in z.items():
        nominal = 0.0 if number.name == ZERO else nominal_value(model.servo(number.joint), number.name)
        value = number.sd * by if number.name == ZERO else nominal * math.exp(number.sd * by)
        out.append(Recalibrated(number.name, (number.joint,), nominal, value, number.sd * (nominal or 1.0), UNITS[number.name]))
    return tuple(sorted(out, key=lambda r: -abs(r.sigmas)))
