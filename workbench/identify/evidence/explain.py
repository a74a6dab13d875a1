"""Servo logs explained by evidence: from recordings to a model with its names, their probabilities, and the reasons against
others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from workbench.identify.estimators.registers import readings, within_registers
from workbench.identify.evidence.checks import checks, drifts, refute
from workbench.identify.evidence.explanation import Explanation
from workbench.identify.evidence.fit import Asks, Fitted, fit_hypothesis, regress
from workbench.identify.evidence.nuisance import uncertain_numbers, uncertain_since
from workbench.identify.evidence.options import NUMERICS, EvidenceOptions
from workbench.identify.evidence.plausible import at_their_end
from workbench.identify.evidence.posterior import posterior_of
from workbench.identify.evidence.region import Region, region_of
from workbench.identify.evidence.robot_search import RobotFound, search_robot
from workbench.identify.evidence.robot_wide import Whole
from workbench.identify.evidence.rollouts import Rollouts, step_errors
from workbench.identify.evidence.search import Found, continue_search, lockstep, with_best, with_fits, without_names
from workbench.identify.evidence.tied_names import TieFits, fits_of_tie
from workbench.identify.evidence.torque_law import torque_law
from workbench.identify.evidence.unknown_law import carried_on, on_windows, slopes_by_law, with_unknown_law
from workbench.identify.parameters import Candidate
from workbench.identify.problem import TakeEvidence
from workbench.identify.results.findings import Rejected
from workbench.identify.rollouts.servo_logs import is_log
from workbench.identify.search_result import Problem
from workbench.identify.subset import at_most, beginnings
from workbench.robot import RobotModel
from workbench.types import Progress


def is_by_logs(evidence: Sequence[TakeEvidence]) -> bool:
    """Whether all takes are servo logs of a held robot."""
    return all(is_log(e) for e in evidence)


def explained_by_evidence(problem: Problem) -> Explanation:
    """Searches each joint's effects by evidence."""
    options = problem.options
    whole, nominal, progress = problem.evaluator, problem.nominal, problem.progress
    evaluator = whole.on(beginnings(whole.evidence, options.seconds))
    last = whole.on(at_most(whole.evidence, options.finished))
    evidence = evaluator.evidence
    joints = [j for j in nominal.joints if any(j in e.channels for e in evidence)]
    felt = [way for c in problem.pool if c.where != (nominal.base,) for way in c.one_way()]
    asked, by_registers = within_registers(felt, [e.take for e in evidence], readings(nominal, problem.laws), options)
    regions = tuple(_region(j, evidence, nominal, asked, options) for j in joints)
    shared = [c for c in asked if not c.where] if len(nominal.joints) > 1 and options.most else []
    most_work = math.inf if problem.thorough else options.most_work
    robot, rejected = _search(Rollouts.of(evaluator, nominal, regions, most_work), shared, felt, options, progress)
    rollouts, found, rejected = robot.rollouts, robot.found, [*by_registers, *rejected]
    tried = checks(felt, evidence, options, progress)
    for _ in range(NUMERICS.rounds):
        objections = refute(tried, rollouts, found)
        if not objections:
            break
        rejected += [Rejected(c.name, c.where, why) for gone in objections for c, why in gone.items()]
        fits = {k: without_names(f, options, gone) for k, (f, gone) in enumerate(zip(found, objections)) if gone}
        left = lockstep(rollouts, fits)
        found = tuple(left.get(k, f) for k, f in enumerate(found))
        rollouts, found = continue_search(rollouts, found, options, progress)
    stopped = rollouts.exhausted and any(f.goes_on(options) for f in found)
    ties: dict[int, TieFits | None] = {}
    if options.most:
        progress("names that are tied", None)
        ties = lockstep(with_best(rollouts, found), {k: fits_of_tie(f.region, options, f.best) for k, f in enumerate(found)})
        found = tuple(f if (tie := ties[k]) is None else with_fits(f, tie.names, options) for k, f in enumerate(found))
        progress("an unnamed torque", None)
        rollouts, found = _add_unnamed(with_best(rollouts, found), found, options)
    progress("numbers at a finer step", None)
    entire = tuple(replace(_region(j, last.evidence, nominal, (), options), candidates=f.region.candidates)
                   for j, f in zip(joints, found))
    finishing = {k: _finish(f, entire[k], options) for k, f in enumerate(found)}
    fine = replace(rollouts.around_here(NUMERICS.fine), evaluator=last, regions=entire, errors=step_errors(last, entire))
    done = lockstep(fine, finishing)
    found = tuple(done[k] for k in range(len(found)))
    fine = with_best(fine, found)
    everywhere = Whole(fine, (), options)
    together = everywhere.fit(everywhere.start([f.best for f in found]))
    robot = replace(robot, together=replace(together, log_posterior=robot.together.log_posterior))
    believed = tuple(posterior_of(list(f.fits.values()), options) for f in found)
    drifting = tuple(d for f in found for d in drifts(f.region, f.best, last.evidence))
    return Explanation(
        nominal=nominal, looked_at=evidence, missed=problem.played.missed, drifts=drifting, stopped=stopped, found=found,
        rollouts=replace(with_best(rollouts, found), shared=together.shared), posteriors=believed, robot=robot,
        refuted=tuple(rejected), options=options, of_tie=tuple(ties.get(k) for k in range(len(found))))


def _search(rollouts: Rollouts, names: Sequence[Candidate], felt: Sequence[Candidate], options: EvidenceOptions,
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


def _add_unnamed(rollouts: Rollouts, found: Sequence[Found], options: EvidenceOptions) -> tuple[Rollouts, tuple[Found, ...]]:
    """The models of each joint, with those that have an unnamed torque there: found on windows, judged as the others are."""
    laws = {k: torque_law(f.region.joints[0], rollouts.evaluator.evidence, rollouts.nominal, options.law)
            for k, f in enumerate(found)}
    seen, known = rollouts, dict(enumerate(found))
    if rollouts.horizon > options.horizon:
        seen = rollouts.around_here(rollouts.step, options.horizon)
        known = lockstep(seen, {k: on_windows(f, options) for k, f in known.items() if laws[k] is not None})
    done = lockstep(seen, {k: with_unknown_law(f, options, law) for k, f in known.items()
                           if (law := laws[k]) is not None})
    if seen is not rollouts:
        done = lockstep(rollouts, {k: carried_on(found[k], f, options) for k, f in done.items()})
    found = tuple(done.get(k, f) for k, f in enumerate(found))
    return with_best(rollouts, found), found


def _region(joint: str, evidence: Sequence[TakeEvidence], nominal: RobotModel, pool: Sequence[Candidate], options: EvidenceOptions
            ) -> Region:
    numbers = (uncertain_numbers(nominal, joint, options.sheet) if options.drift is None
               else uncertain_since(nominal, joint, options.drift))
    return region_of([joint], evidence, numbers, _acting(pool, joint, nominal), options)


def _finish(found: Found, entire: Region, options: EvidenceOptions) -> Asks[Found]:
    """The best fit with the last numbers, from all that is used; among the others it stays as likely as the search found it."""
    best = found.best
    (r,) = yield [best.hypothesis]
    region = entire.with_correlation_time(found.region.likelihood.tau)
    s = region.likelihood.discrepancy(r)
    fit: Fitted = yield from fit_hypothesis(region, options, best.hypothesis, s, options.iterations, r)
    fit = yield from regress(region, options, fit)
    fit = replace(fit, law_slopes=(yield from slopes_by_law(options, fit)), log_evidence=best.log_evidence,
                  log_prior=best.log_prior)
    return replace(found, region=region, fits={**found.fits, best.hypothesis.key: fit})


def _acting(pool: Sequence[Candidate], joint: str, model: RobotModel) -> list[Candidate]:
    """Candidates that act in one joint: there, in the link that it carries, or, of a robot of one joint, anywhere."""
    if len(model.joints) == 1:  # where all joints are one, what all do is what it does
        own = {c.name for c in pool if c.where == (joint,)}
        return [c for c in pool if c.where or c.name not in own]
    link = model.kinematics.frames[joint].child
    return [c for c in pool if c.where in ((joint,), (link,))]


