"""Result of a search of servo logs by evidence, with its probabilities, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from workbench.compare.metrics import rms
from workbench.identify.conclusions import ReadOff, Residuals, change, estimates, value_slopes, with_read_off
from workbench.identify.evidence.fit import weights_covariance
from workbench.identify.evidence.hypothesis import ZERO
from workbench.identify.evidence.leftover import list_leftover
from workbench.identify.evidence.motion_range import join_ranges, range_of, tell_faster
from workbench.identify.evidence.nuisance import mixing, turned_horn, widen, with_known, with_whole_zeros
from workbench.identify.evidence.recalibration import as_stated, list_changes
from workbench.identify.evidence.rollouts import Rollouts, extrapolate
from workbench.identify.evidence.tied import as_torque
from workbench.identify.evidence.tied_names import gravity_over_torque, shared_by_tie
from workbench.identify.options import CONCLUSIONS, PROBLEM
from workbench.identify.problem import TakeEvidence
from workbench.identify.results.findings import Alternative, FamilyBelief, Finding, Rejected, Unexplained
from workbench.identify.results.reasons import LessLikely
from workbench.identify.results.servo_law import GravityOverTorque, Recalibrated, UnknownTorque, list_arguments
from workbench.identify.results.ties import Tie
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.identify.search_result import SearchResult
from workbench.robot import Posterior, RobotModel
from workbench.robot.model_file import parameter_names
from workbench.types import Array, Progress

if TYPE_CHECKING:
    from workbench.identify.evidence.hypothesis import Hypothesis
    from workbench.identify.evidence.options import EvidenceOptions
    from workbench.identify.evidence.posterior import RegionPosterior
    from workbench.identify.evidence.region import Region
    from workbench.identify.evidence.robot_search import RobotFound
    from workbench.identify.evidence.search import Found
    from workbench.identify.evidence.tied_names import TieFits
    from workbench.identify.parameters import Candidate
    from workbench.robot.law_covariance import MotionRange

WORTH_SAYING = 0.01
"""Least probability of an alternative that is named."""


@dataclass(frozen=True)
class Explanation(SearchResult):
    """The most probable model, with all alternatives. found, posteriors: one for each region; robot: effects that act on all
    joints; refuted: effects rejected by registers or by held-out takes; of_tie: by region, fits of each single cause of its
    gravity over torque."""

    rollouts: Rollouts
    found: tuple[Found, ...]
    posteriors: tuple[RegionPosterior, ...]
    robot: RobotFound
    refuted: tuple[Rejected, ...]
    options: EvidenceOptions
    of_tie: tuple[TieFits | None, ...]

    @property
    def tied(self) -> tuple[GravityOverTorque, ...]:
        """Gravity over torque where it is not as told, with the effects that could be it."""
        weighed = len({repr(e.take.spec.load) for e in self.looked_at}) > 1
        ties = (gravity_over_torque(region, self.options, p, fits, weighed)
                for region, p, fits in zip(self.rollouts.regions, self.posteriors, self.of_tie))
        return tuple(s for s in ties if s is not None)

    @property
    def model(self) -> RobotModel:
        """The robot with its numbers recalibrated and its effects."""
        return with_whole_zeros(self.rollouts.model([p.best.hypothesis for p in self.posteriors]))

    def _stated(self) -> list[tuple[Region, RegionPosterior, Hypothesis, Array]]:
        """Each region's posterior, with the likeliest hypothesis and the covariance of its theta `as_stated`."""
        each = zip(self.rollouts.regions, self.posteriors)
        return [(region, p, *as_stated(p.best, region, self.options)) for region, p in each]

    @property
    def calibrated(self) -> RobotModel:
        """The same, with how well its servos' numbers are known now."""
        model = self.model
        for region, _, h, covariance in self._stated():
            numbers, n = h.numbers, len(h.numbers)
            observed = {joint: join_ranges(self._known_range(joint), self._range_now(joint)) for joint in region.joints}
            model = with_known(model, numbers, widen(covariance[:n, :n], self.options.formal), observed)
        return model

    def _known_range(self, joint: str) -> MotionRange | None:
        """The motion from which an earlier diagnosis knew a joint's servo."""
        known = self.nominal.servo(joint).covariance
        return None if known is None or self.options.drift is None else known.observed

    def _range_now(self, joint: str) -> MotionRange | None:
        return range_of(joint, self.looked_at, self.nominal, self.options.motion)

    @property
    def recalibrated(self) -> tuple[Recalibrated, ...]:
        """Numbers of the nominal law that are used otherwise."""
        return tuple(r for p in self.posteriors for r in list_changes(self.nominal, p.best.hypothesis))

    def findings(self, evidence: Sequence[TakeEvidence], before: Residuals, after: Residuals) -> tuple[Finding, ...]:
        """The likeliest model's effects, the surest first."""
        out, ties = self._of_robot(evidence, before, after), {t.where: t for t in self.tied}
        for region, p, h, covariance in self._stated():
            joint = region.joints[0]
            beyond = tell_faster(joint, self._known_range(joint), self._range_now(joint), self.options.faster)
            for (c, x), s in zip(h.sizes(), h.slices()):
                family, elsewhere = c.effect.family, p.elsewhere(c.key)
                rival = p.rival(c.key, elsewhere)
                others = [] if rival is None else [Alternative(*rival[0], CONCLUSIONS.surest * rival[1])]
                share = CONCLUSIONS.surest
                if (of_all := self.robot.rivals.get(c.key)) is not None:
                    share /= 1.0 + math.exp(min(of_all[1], 700.0))
                    others.append(Alternative(of_all[0].name, of_all[0].where, CONCLUSIONS.surest - share))
                tie = as_torque(region, self.options, p.best, c)
                share *= 1.0 if tie is None else tie.share
                unseen = beyond if c.effect.layer == "actuator" else ""
                share *= self.options.changed if unseen else 1.0
                others = sorted((o for o in others if o.confidence >= WORTH_SAYING), key=lambda o: -o.confidence)
                where = (*c.where, *(place for _, places in elsewhere for place in places))
                fit, validation = (change(evidence, where, before, after, use) for use in ("fit", "validate"))
                finding = Finding(
                    c.name, where, share * (p.named[c.name, c.where] + sum(elsewhere.values())),
                    estimates(c, x, covariance[s, s] if tie is None else tie.covariance(covariance[s, s], x)), fit, validation,
                    tuple(others[:1]),
                    c.effect.sentence(c.spec(x)) + ("" if tie is None else tie.sentence) + self._or_unnamed(p, c)
                    + unseen,
                    family=None if family is None else FamilyBelief(family, share * p.families[family]))
                out.append(shared_by_tie(finding, ties.get(region.joints)))
        return tuple(sorted(out, key=lambda f: -f.confidence))

    def _or_unnamed(self, p: RegionPosterior, c: Candidate) -> str:
        """Clause of a finding's sentence about an unnamed torque as an alternative."""
        depends_on, probability = p.unnamed_instead(c.key)
        if probability < CONCLUSIONS.worth_an_experiment:
            return ""
        return f" Or ({probability:.2f}) a torque that depends on {list_arguments(depends_on)}, which no known effect describes."

    def unknown_torques(self, evidence: Sequence[TakeEvidence], before: Residuals, after: Residuals) -> tuple[UnknownTorque, ...]:
        """Torques of the likeliest model that no effect describes, by joint."""
        out = []
        for region, p in zip(self.rollouts.regions, self.posteriors):
            law = p.best.hypothesis.law
            if law is None or p.best.law_slopes is None:
                continue
            spread = law.spread(CONCLUSIONS.wider**2 * weights_covariance(p.best, region, self.options))
            fit, validation = (change(evidence, (law.joint,), before, after, use) for use in ("fit", "validate"))
            out.append(UnknownTorque(law.joint, CONCLUSIONS.surest * p.unnamed, law.rms(evidence, self.nominal), law.tables(),
                                     spread, fit, validation))
        return tuple(sorted(out, key=lambda u: -u.confidence))

    def _of_robot(self, evidence: Sequence[TakeEvidence], before: Residuals, after: Residuals) -> list[Finding]:
        """Effects that act on every joint at once."""
        out, at, sure = [], self.robot.together, CONCLUSIONS.surest * self.robot.sure
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

    def posterior(self, read_off: Sequence[ReadOff]) -> Posterior:
        """Joint posterior of the model's effects, in the units of docs/formats.md; a recalibrated zero is one of them. read_off:
        effects that no search identified."""
        model = self.model
        names = parameter_names(model.effects)
        blocks: dict[tuple[str, tuple[str, ...]], Array] = {}
        for _, _, h, covariance in self._stated():
            moved = mixing(h.numbers)
            for k, number in enumerate(h.numbers):
                if number.name == ZERO:
                    zero, row = turned_horn(number.joint, number.sd), np.degrees(moved[k])
                    blocks[zero.effect, zero.where] = np.array([[row @ covariance[:len(row), :len(row)] @ row]])
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
        return with_read_off(Posterior(names, mean, CONCLUSIONS.wider**2 * whole), read_off)

    def left_by(self, evaluator: RolloutEvaluator, progress: Progress) -> tuple[Residuals, Residuals]:
        """Residuals on whole takes in the limit of a step of zero, and the difference of the last steps, over sigma."""
        progress("rolling out the fitted model", None)
        evidence, everywhere = evaluator.evidence, tuple(range(len(evaluator.evidence)))
        steps = (2 * PROBLEM.fine, PROBLEM.fine)
        longer, shorter = evaluator.residuals([RolloutRequest(self.model, everywhere, step) for step in steps])
        floors = {i: np.nan_to_num(rms((longer[i] - shorter[i])[evidence[i].moving])) for i in everywhere}
        return {i: extrapolate(longer[i], shorter[i]) for i in everywhere}, floors

    def unexplained(self, evidence: Sequence[TakeEvidence], after: Residuals, floors: Residuals) -> tuple[Unexplained, ...]:
        """Residuals beyond noise and numerical error, with their worst event, and parameters that drift within a take."""
        return (*list_leftover(evidence, after, floors), *(d.as_unexplained(evidence) for d in self.drifts))

    def is_slight(self) -> bool:
        """Whether what is left is too slight to be a gap: all frames were searched, so that only an unexplained residual is
        one."""
        return True

    def rejected(self, before: Residuals) -> tuple[Rejected, ...]:
        """Effects that were fitted and are not in the likeliest model, with the nats by which the best model with them is
        behind."""
        out = list(self.refuted)
        listed = {(r.effect, r.where) for r in out}
        for p, found in zip(self.posteriors, self.found):
            kept = {c.key for c in p.best.hypothesis.effects}
            for f in sorted(found.fits.values(), key=lambda f: -f.log_posterior):
                for c in f.hypothesis.effects:
                    if c.key in kept | listed:
                        continue
                    listed.add(c.key)
                    behind = p.best.log_posterior - f.log_posterior
                    out.append(Rejected(c.name, c.where, LessLikely(behind)))
        return tuple(out)

    def ties(self) -> tuple[Tie, ...]:
        """The most probable model, and the most probable one in which another effect replaces a finding."""
        out = []
        for k, p in enumerate(self.posteriors):
            for c in p.best.hypothesis.effects:
                rival = p.rival(c.key)
                other = next((f for f, _ in p.weights if rival and rival[0] in {o.key for o in f.hypothesis.effects}
                              and c.key not in {o.key for o in f.hypothesis.effects}), None)
                if rival is not None and other is not None and rival[1] > CONCLUSIONS.worth_an_experiment:
                    hypotheses = [q.best.hypothesis for q in self.posteriors]
                    hypotheses[k] = other.hypothesis
                    out.append(Tie(self.model, self.rollouts.model(hypotheses), rival[1]))
        return tuple(out)
