"""Session in, findings out: where the recordings leave the model, which physics explains it, and what stays unexplained.

`diagnose_session` goes through the steps of docs/method.md, in their order.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.compare.channels import ACROSS
from workbench.compare.compare_session import provenance
from workbench.compare.logged import how_logged
from workbench.compare.metrics import rms
from workbench.compare.session import Base, Session
from workbench.compare.session_takes import LeftOut, Progress, ReadTake, no_progress, read_takes
from workbench.effects.registry import effect_named
from workbench.identify.conclusions import Residuals, change, finding, posterior, rejected, ties, unexplained, verdict_of
from workbench.identify.estimators.dropped_again import TakesAsPlayed, with_commands_of
from workbench.identify.estimators.dropped_commands import DroppedCommands
from workbench.identify.estimators.geometry import Geometry, Measured, geometry_of
from workbench.identify.estimators.registers import read_off_registers
from workbench.identify.estimators.stops_and_mounts import read_off_candidates
from workbench.identify.evidence.explain import explain, is_by_logs
from workbench.identify.evidence.leftover import left_over
from workbench.identify.evidence.step_errors import extrapolated
from workbench.identify.fitting.constancy import Drift, drifts
from workbench.identify.fitting.downward_force import downward_pulls
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.judge import EnginesPartError, judged
from workbench.identify.ledger import ledger
from workbench.identify.options import PROBLEM, READ_OFF
from workbench.identify.parameters import Candidate
from workbench.identify.preparation import Prepared, check_duration, prepared
from workbench.identify.problem import TakeEvidence, channel_gaps
from workbench.identify.proposals import candidates
from workbench.identify.results.findings import Diagnosis, Finding, GapEntry, Unexplained
from workbench.identify.results.take_report import TakeReport
from workbench.identify.results.ties import ObservationModel, Tie, observation_models
from workbench.identify.rollouts import RolloutEvaluator, RolloutRequest
from workbench.identify.selection.acceptance import idle, too_little_left
from workbench.identify.selection.calibration import calibrated
from workbench.identify.selection.forward import select
from workbench.identify.selection.model_comparison import NamePosterior, compare_models
from workbench.identify.selection.record import SelectionResult
from workbench.identify.subset import data_subset, floors_everywhere, rebalanced, subset_used
from workbench.recording.take import Take
from workbench.robot import Posterior, RobotModel
from workbench.simulation import SimulationConfig

BESIDE_DRAKE = "{} model apart from Drake [sigma]"


@dataclass(frozen=True)
class DiagnosisResult:
    """A diagnosis, the takes behind it, the ties that it leaves, and how the session's recordings saw the robot, by base: what
    the design of the next experiment asks."""

    diagnosis: Diagnosis
    takes: tuple[TakeReport, ...]
    ties: tuple[Tie, ...]
    observations: Mapping[Base, ObservationModel]


@dataclass(frozen=True)
class _Explained:
    """The fit at the end: how sure each effect is; numerical floors by take, over sigma; parameters that drift within a take."""

    chosen: SelectionResult
    search: Search
    fit: Fit
    posteriors: Sequence[NamePosterior]
    floors: Mapping[int, NDArray[np.float64]]
    drifts: Sequence[Drift]


@dataclass(frozen=True)
class _Settings:
    """How a session is diagnosed. began: time.monotonic of the start; the rest as in `diagnose_session`."""

    progress: Progress
    n_jobs: int
    memory: Path | None
    thorough: bool
    without: frozenset[str]
    began: float

    def searches(self, effect: str) -> bool:
        """Whether an effect of that name is looked for."""
        return effect not in self.without

    def provenance(self) -> dict[str, object]:
        """What the results say of them."""
        return {"without": sorted(self.without)} if self.without else {}


def diagnose_session(session: Session, progress: Progress = no_progress, n_jobs: int = 2, memory: Path | None = None,
                     thorough: bool = False, without: Sequence[str] = ()) -> DiagnosisResult:
    """Diagnoses a session. Damaged takes are left out and named; InputError where none remains. memory: folder that keeps every
    rollout's channels, so that a killed run resumes. thorough: searches to the end, however long it takes. without: names of
    effects that are known not to be there, and are not looked for; InputError where one is no effect. Rollouts are the compiled
    station's where it knows the physics, unless Drake says otherwise of the nominal or of the final model."""
    config = SimulationConfig(settle=0.6, contact_period=0, time_step=PROBLEM.time_step)
    absent = frozenset(effect_named(name).name for name in without)
    settings = _Settings(progress, n_jobs, memory, thorough, absent, time.monotonic())
    try:
        return _diagnosed(session, config, settings, {"rollouts by": "the compiled station"})
    except EnginesPartError as why:
        progress(f"{why}: again by Drake", None)
        by_drake = {"rollouts by": "Drake", "because": str(why)}
        return _diagnosed(session, replace(config, engine="drake"), settings, by_drake)


def _diagnosed(session: Session, config: SimulationConfig, settings: _Settings, engine: Mapping[str, str]) -> DiagnosisResult:
    """By one engine; EnginesPartError where that is not Drake and Drake says otherwise."""
    progress = settings.progress
    # 1. What the recordings show, channel by channel, over what noise and numerics alone make of each
    progress("reading recordings", None)
    takes, unreadable = read_takes(session)
    seen = prepared(session, takes, config, settings.n_jobs, progress)
    check_duration(session, seen.evidence)
    evaluator = RolloutEvaluator(seen.evidence, config, settings.n_jobs, settings.memory)
    nominal = Search(evaluator, session.model).evaluated([])
    progress("judging the engine", None)
    apart = {BESIDE_DRAKE.format("nominal"): judged(evaluator, session.model, "nominal")}

    # 2. The gap: where, when and in which layer they differ from the nominal model
    gap = ledger(seen.evidence, nominal.residuals)

    # 3. What is read off without a search: geometry, the servos' registers, commands that never arrived, stops, mounts, frames
    measured = geometry_of(session.model, evaluator.evidence, nominal.residuals) if gap else Geometry()
    build = _believed(measured, evaluator, session.model, nominal)
    read_off = (*build.measured, *read_off_registers(session))
    build = replace(build, measured=tuple(m for m in read_off if settings.searches(m.effect)))
    known = session.with_model(build.added_to(session.model))
    sent = _again(evaluator, known, takes, progress) if build.measured else evaluator
    evidence = sent.evidence
    begun = Search(sent, known.model).evaluated([])
    played = TakesAsPlayed(sent, without=settings.without)
    evaluator, missed = played.without_missed(known.model, begun.residuals)
    pool = build.asked(candidates(known.model, evidence)) + read_off_candidates(known.model, evidence, begun.residuals)
    pool = [c for c in pool if settings.searches(c.effect.name)]

    if gap and is_by_logs(evidence):
        return _by_evidence(session, known.model, seen, evaluator, pool, nominal, build, missed, gap, unreadable, settings,
                            {**engine, **apart})

    # 4. Which effects explain it: searched for on a part of long sessions, compared with their rivals, numbers refined
    looked_at = data_subset(rebalanced(evaluator.evidence, begun.residuals), begun.residuals)
    chosen = select(Search(evaluator.on(looked_at), known.model), pool, progress, settings.thorough,
                    replace(played, missed=missed))
    explained = _compared(chosen, progress)
    search, fit = explained.search, explained.fit

    # 5. What that leaves, on whole takes
    evaluator = evaluator.on(with_commands_of(evaluator.evidence, search.evaluator.evidence))
    fitted = fit.model(known.model)
    after, floors = _left_by(fitted, evaluator, looked_at, explained, progress)
    progress("judging the engine", None)
    apart[BESIDE_DRAKE.format("final")] = judged(evaluator, fitted, "final")
    findings = _findings(evidence, build.measured, explained, nominal.residuals, after)
    left = _left(evidence, after, floors, explained) if gap else ()

    # 6. Conclusions
    # what no effect could be told from, and unseen stretches do not show, is in the ledger, but is no gap
    slight = not findings and not left and too_little_left(search, fit, search.fitted, (), everywhere=False)
    progress("rolling out the fitted model", None)
    diagnosis = Diagnosis(
        verdict=verdict_of(bool(gap) and not slight, findings, left),
        model=fitted.with_effects((*fitted.effects, *(m.spec for m in chosen.missed))), nominal=session.model,
        gap=gap, findings=findings, rejected=rejected(looked_at, fit, chosen.rounds, explained.posteriors, nominal.residuals),
        unexplained=left, posterior=posterior(fit, (*build.measured, *chosen.missed)),
        provenance=provenance(session.model, config, time.monotonic() - settings.began) | settings.provenance()
        | {"seed": 0, "rollouts": search.evaluator.rollouts, "engine": {**engine, **apart}}
        | subset_used(looked_at),
        stopped=chosen.stopped, left_out=unreadable + seen.left_out)
    reports = _reports(evaluator, seen.nominal, nominal.residuals, after, fitted if findings else None)
    return DiagnosisResult(diagnosis, reports, ties(session.model, fit, explained.posteriors), observation_models(evidence))


def _by_evidence(session: Session, known: RobotModel, seen: Prepared, evaluator: RolloutEvaluator, pool: Sequence[Candidate],
                 nominal: Fit, build: Geometry, missed: Sequence[DroppedCommands], gap: tuple[GapEntry, ...],
                 unreadable: LeftOut, settings: _Settings, engine: Mapping[str, str | float]) -> DiagnosisResult:
    """Steps 4 to 6 of servo logs, by evidence. engine: whose rollouts these are, and how far it is from Drake."""
    progress = settings.progress
    evidence, everywhere = evaluator.evidence, tuple(range(len(evaluator.evidence)))
    explained = explain(evaluator, known, pool, progress, thorough=settings.thorough)
    fitted = explained.model
    progress("judging the engine", None)
    final = {BESIDE_DRAKE.format("final"): judged(evaluator, fitted, "final")}
    progress("rolling out the fitted model", None)
    steps = (2 * PROBLEM.fine, PROBLEM.fine)
    longer, after = evaluator.residuals([RolloutRequest(fitted, everywhere, step) for step in steps])
    floors = {i: np.nan_to_num(rms((longer[i] - after[i])[evidence[i].moving])) for i in everywhere}
    after = {i: extrapolated(longer[i], after[i]) for i in everywhere}
    findings = (*(m.finding(*(change(evidence, (m.where,), nominal.residuals, after, use) for use in ("fit", "validate")))
                  for m in build.measured), *(m.finding() for m in missed),
                *explained.findings(evidence, nominal.residuals, after))
    left = left_over(evidence, after, floors)
    diagnosis = Diagnosis(
        verdict=verdict_of(bool(findings or left), findings, left),
        model=fitted.with_effects((*fitted.effects, *(m.spec for m in missed))), nominal=session.model, gap=gap,
        findings=findings, rejected=explained.losers(), unexplained=left,
        posterior=Posterior() if missed else explained.posterior(),
        provenance=provenance(session.model, evaluator.config, time.monotonic() - settings.began) | settings.provenance()
        | {"seed": 0, "rollouts": evaluator.rollouts, "engine": {**engine, **final}} | how_logged([e.take for e in evidence]),
        stopped=explained.stopped, left_out=unreadable + seen.left_out, recalibrated=explained.recalibrated)
    reports = _reports(evaluator, seen.nominal, nominal.residuals, after, fitted)
    return DiagnosisResult(diagnosis, reports, explained.ties(), observation_models(evidence))


def _believed(build: Geometry, evaluator: RolloutEvaluator, model: RobotModel, nominal: Fit) -> Geometry:
    """What was measured of the robot's geometry, unless with that in the model the takes are told worse; not always better, as
    beside what else is missing the right leg may walk the wrong way."""
    if not build.measured:
        return build
    there = Search(evaluator, build.added_to(model)).evaluated([])
    worse = (there.cost["fit"] + there.cost["choose"]) / (nominal.cost["fit"] + nominal.cost["choose"]) - 1.0
    return build if worse < READ_OFF.geometry_worse else replace(build, measured=())


def _again(evaluator: RolloutEvaluator, known: Session, takes: Sequence[ReadTake], progress: Progress) -> RolloutEvaluator:
    """Rollouts beside the robot with its measured geometry: what steps and contact models leave open is another robot's."""
    read = [replace(t, model=known.model_of(t.spec)) for t in takes]
    return evaluator.on(prepared(known, read, evaluator.config, evaluator.n_jobs, progress).evidence)


def _compared(chosen: SelectionResult, progress: Progress) -> _Explained:
    """What was chosen beside its rivals, its numbers refined, and how sure each effect is."""
    search, fit, posteriors = compare_models(chosen.search, chosen, progress)
    progress("numbers at a finer step", None)
    fit = search.refined(fit) if fit.effects else fit
    floors = search.floors(fit) if fit.effects else {}
    changing = drifts(search, fit)
    sure = calibrated(search, fit, posteriors, floors, [d.effect for d in changing], idle(search, fit))
    return _Explained(chosen, search, fit, sure, floors, changing)


def _left_by(
    fitted: RobotModel, evaluator: RolloutEvaluator, looked_at: Sequence[TakeEvidence], explained: _Explained, progress: Progress
) -> tuple[Residuals, Residuals]:
    """Residuals and numerical floors of the fitted model on whole takes, those too that the search did not look at."""
    if not any(np.isfinite(e.until) for e in looked_at):
        if all(e.rough is seen.rough for e, seen in zip(evaluator.evidence, explained.search.evaluator.evidence)):
            return explained.fit.residuals, explained.floors
        # what the search left to chance is left, nevertheless
        return evaluator.residuals([RolloutRequest(fitted, tuple(range(len(looked_at))), PROBLEM.fine)])[0], explained.floors
    progress("rolling out whole takes", None)
    after = evaluator.residuals([RolloutRequest(fitted, tuple(range(len(evaluator.evidence))))])[0]
    return after, floors_everywhere(looked_at, explained.floors)


def _findings(evidence: Sequence[TakeEvidence], measured: Sequence[Measured], explained: _Explained, before: Residuals,
              after: Residuals) -> tuple[Finding, ...]:
    """What was measured, what commands were dropped, and what was fitted."""
    fit = explained.fit
    return (*(m.finding(*(change(evidence, (m.where,), before, after, use) for use in ("fit", "validate"))) for m in measured),
            *(m.finding() for m in explained.chosen.missed),
            *(finding(evidence, fit, i, explained.posteriors[i], before, after) for i in range(len(fit.effects))))


def _left(evidence: Sequence[TakeEvidence], after: Residuals, floors: Residuals, explained: _Explained
          ) -> tuple[Unexplained, ...]:
    """What is still beyond noise and numerics, and what casts doubt on what was fitted."""
    drifting = (d.left(evidence) for d in explained.drifts)
    return (*unexplained(evidence, after, floors), *drifting, *downward_pulls(explained.fit))


def _reports(
    evaluator: RolloutEvaluator, nominal: Mapping[str, Take], before: Residuals, after: Residuals, fitted: RobotModel | None
) -> tuple[TakeReport, ...]:
    """What each take was and is. fitted: the model with its effects; None: nothing was found."""
    was = [e.take.observed(nominal[e.name]) for e in evaluator.evidence]
    now = was if fitted is None else evaluator.observed(fitted, evaluator.config)
    out = []
    for i, e in enumerate(evaluator.evidence):
        ill = channel_gaps(e, before[i])
        shown = [k for k, c in enumerate(e.channels) if ACROSS not in c or c in ill]  # across the axes there is mostly nothing
        out.append(TakeReport(replace(e.take.recorded, name=e.name), was[i], now[i], tuple(e.channels[k] for k in shown),
                              e.sigma[shown], before[i][:, shown], after[i][:, shown], e.uses["validate"]))
    return tuple(out)
