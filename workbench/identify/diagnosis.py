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
from workbench.compare.metrics import rms
from workbench.compare.session import Base, Session
from workbench.compare.session_takes import LeftOut, Progress, ReadTake, no_progress, read_takes
from workbench.identify.conclusions import Residuals, change, finding, posterior, rejected, ties, unexplained, verdict_of
from workbench.identify.estimators.dropped_again import Played, played_as
from workbench.identify.estimators.dropped_commands import Missed, with_missed
from workbench.identify.estimators.geometry import Build, Measured, build_of
from workbench.identify.estimators.stops_and_mounts import special
from workbench.identify.evidence.explain import explain, is_by_logs
from workbench.identify.evidence.leftover import left_over
from workbench.identify.findings import Diagnosis, Finding, GapEntry
from workbench.identify.fitting.constancy import Drift, drifts
from workbench.identify.fitting.downward_force import hanging
from workbench.identify.fitting.fits import Fit, Search
from workbench.identify.ledger import channel_gaps, ledger
from workbench.identify.parameters import Candidate
from workbench.identify.preparation import Prepared, check_duration, prepared
from workbench.identify.problem import TakeEvidence
from workbench.identify.proposals import candidates
from workbench.identify.rollouts import FINE, Jury, Question
from workbench.identify.selection.acceptance import idle, too_little_left
from workbench.identify.selection.calibration import doubted
from workbench.identify.selection.forward import select
from workbench.identify.selection.model_comparison import Standing, contest
from workbench.identify.selection.record import Chosen
from workbench.identify.subset import floors_everywhere, judged_fairly, searched, share_of
from workbench.identify.take_report import TakeReport
from workbench.identify.ties import ObservationModel, Tie, observation_models
from workbench.recording.take import Take
from workbench.robot import Posterior, RobotModel
from workbench.simulation import SimulationConfig

STEP = 2e-3
"""Of the search's rollouts [s]; what this step is wrong by on the nominal robot, as finer ones tell, is taken off all of them."""
WORSE = 0.05
"""Share of all that is missing that may come with what was measured."""


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

    chosen: Chosen
    fit: Fit
    standings: Sequence[Standing]
    floors: Mapping[int, NDArray[np.float64]]
    drifts: Sequence[Drift]


def diagnose_session(session: Session, progress: Progress = no_progress, n_jobs: int = 2, memory: Path | None = None,
                     thorough: bool = False) -> DiagnosisResult:
    """Diagnoses a session. Damaged takes are left out and named; InputError where none remains. memory: folder that keeps every
    rollout's channels, so that a killed run resumes. thorough: searches to the end, however long it takes."""
    began = time.monotonic()
    config = SimulationConfig(settle=0.6, contact_period=0, time_step=STEP)

    # 1. What the recordings show, channel by channel, over what noise and numerics alone make of each
    progress("reading recordings", None)
    takes, unreadable = read_takes(session)
    seen = prepared(session, takes, config, n_jobs, progress)
    check_duration(session, seen.evidence)
    jury = Jury(seen.evidence, config, n_jobs, memory)
    nominal = Search(jury, session.model).evaluated([])

    # 2. The gap: where, when and in which layer they leave the nominal model
    gap = ledger(seen.evidence, nominal.residuals)

    # 3. What is read off without a search: the robot's geometry, commands that never arrived, stops, mounts, marker frames
    build = _believed(build_of(session.model, jury.evidence, nominal.residuals), jury, session.model, nominal) if gap else Build()
    known = session.with_model(build.added_to(session.model))
    sent = _again(jury, known, takes, progress) if build.measured else jury
    evidence = sent.evidence
    begun = Search(sent, known.model).evaluated([])
    jury, missed = with_missed(sent, known.model, begun.residuals)
    pool = build.asked(candidates(known.model, evidence)) + special(known.model, evidence, begun.residuals)

    if gap and is_by_logs(evidence):
        return _by_evidence(session, known.model, seen, jury, pool, nominal, build, missed, gap, unreadable, progress, began)

    # 4. Which effects explain it: searched for on a part of long sessions, compared with their rivals, numbers refined
    looked_at = searched(judged_fairly(jury.evidence, begun.residuals), begun.residuals)
    chosen = select(Search(jury.on(looked_at), known.model), pool, progress, thorough, Played(sent, missed))
    explained = _compared(chosen, progress)
    search, fit = chosen.search, explained.fit

    # 5. What that leaves, on whole takes
    jury = jury.on(played_as(jury.evidence, search.jury.evidence))
    fitted = fit.model(known.model)
    after, floors = _left_by(fitted, jury, looked_at, explained, progress)
    findings = _findings(evidence, build.measured, explained, nominal.residuals, after)
    left = (*unexplained(evidence, after, floors), *(d.left(evidence) for d in explained.drifts), *hanging(fit)) if gap else ()

    # 6. Conclusions
    # what no effect could be told from, and unseen stretches do not show, is in the ledger, but is no gap
    slight = not findings and not left and too_little_left(search, fit, search.fitted, (), everywhere=False)
    progress("rolling out the fitted model", None)
    diagnosis = Diagnosis(
        verdict=verdict_of(bool(gap) and not slight, findings, left),
        model=replace(fitted, effects=(*fitted.effects, *(m.spec for m in chosen.missed))), nominal=session.model,
        gap=gap, findings=findings, rejected=rejected(looked_at, fit, chosen.rounds, explained.standings, nominal.residuals),
        unexplained=left, posterior=posterior(fit, (*build.measured, *chosen.missed)),
        provenance=provenance(session.model, config, time.monotonic() - began)
        | {"seed": 0, "rollouts": search.jury.rollouts} | share_of(looked_at),
        stopped=chosen.stopped, left_out=unreadable + seen.left_out)
    reports = _reports(jury, seen.nominal, nominal.residuals, after, fitted if findings else None)
    return DiagnosisResult(diagnosis, reports, ties(session.model, fit, explained.standings), observation_models(evidence))


def _by_evidence(session: Session, known: RobotModel, seen: Prepared, jury: Jury, pool: Sequence[Candidate], nominal: Fit,
                 build: Build, missed: Sequence[Missed], gap: tuple[GapEntry, ...], unreadable: LeftOut, progress: Progress,
                 began: float) -> DiagnosisResult:
    """Steps 4 to 6 of servo logs, by evidence."""
    evidence, everywhere = jury.evidence, tuple(range(len(jury.evidence)))
    told = explain(jury, known, pool, progress)
    fitted = told.model
    progress("rolling out the fitted model", None)
    longer, after = (jury.residuals([Question(fitted, everywhere, step)])[0] for step in (2 * FINE, FINE))
    floors = {i: np.nan_to_num(rms((longer[i] - after[i])[evidence[i].moving])) for i in everywhere}
    findings = (*(m.finding(*(change(evidence, (m.where,), nominal.residuals, after, use) for use in ("fit", "validate")))
                  for m in build.measured), *(m.finding() for m in missed), *told.findings(evidence, nominal.residuals, after))
    left = left_over(evidence, after, floors)
    diagnosis = Diagnosis(
        verdict=verdict_of(bool(findings or left), findings, left),
        model=replace(fitted, effects=(*fitted.effects, *(m.spec for m in missed))), nominal=session.model, gap=gap,
        findings=findings, rejected=told.losers(), unexplained=left, posterior=told.posterior() if not missed else Posterior(),
        provenance=provenance(session.model, jury.config, time.monotonic() - began) | {"seed": 0, "rollouts": jury.rollouts},
        left_out=unreadable + seen.left_out, recalibrated=told.recalibrated)
    reports = _reports(jury, seen.nominal, nominal.residuals, after, fitted)
    return DiagnosisResult(diagnosis, reports, told.ties(), observation_models(evidence))


def _believed(build: Build, jury: Jury, model: RobotModel, nominal: Fit) -> Build:
    """What was measured of the robot's geometry, unless with that in the model the takes are told worse; not always better, as
    beside what else is missing the right leg may walk the wrong way."""
    if not build.measured:
        return build
    there = Search(jury, build.added_to(model)).evaluated([])
    worse = (there.cost["fit"] + there.cost["choose"]) / (nominal.cost["fit"] + nominal.cost["choose"]) - 1.0
    return build if worse < WORSE else replace(build, measured=())


def _again(jury: Jury, known: Session, takes: Sequence[ReadTake], progress: Progress) -> Jury:
    """Rollouts beside the robot with its measured geometry: what steps and contact models leave open is another robot's."""
    read = [replace(t, model=known.model_of(t.spec)) for t in takes]
    return Jury(prepared(known, read, jury.config, jury.n_jobs, progress).evidence, jury.config, jury.n_jobs, jury.memory)


def _compared(chosen: Chosen, progress: Progress) -> _Explained:
    """What was chosen beside its rivals, its numbers refined, and how sure each effect is."""
    search = chosen.search
    fit, standings = contest(search, chosen, progress)
    progress("numbers at a finer step", None)
    fit = search.refined(fit) if fit.effects else fit
    floors = search.floors(fit) if fit.effects else {}
    changing = drifts(search, fit)
    sure = doubted(search, fit, standings, floors, [d.effect for d in changing], idle(search, fit))
    return _Explained(chosen, fit, sure, floors, changing)


def _left_by(fitted: RobotModel, jury: Jury, looked_at: Sequence[TakeEvidence], explained: _Explained, progress: Progress
             ) -> tuple[Residuals, Residuals]:
    """Residuals and numerical floors of the fitted model on whole takes, those too that the search did not look at."""
    if not any(np.isfinite(e.until) for e in looked_at):
        return explained.fit.residuals, explained.floors
    progress("rolling out whole takes", None)
    after = jury.residuals([Question(fitted, tuple(range(len(jury.evidence))))])[0]
    return after, floors_everywhere(looked_at, explained.floors)


def _findings(evidence: Sequence[TakeEvidence], measured: Sequence[Measured], explained: _Explained, before: Residuals,
              after: Residuals) -> tuple[Finding, ...]:
    """What was measured, what commands were dropped, and what was fitted."""
    fit = explained.fit
    return (*(m.finding(*(change(evidence, (m.where,), before, after, use) for use in ("fit", "validate"))) for m in measured),
            *(m.finding() for m in explained.chosen.missed),
            *(finding(evidence, fit, i, explained.standings[i], before, after) for i in range(len(fit.effects))))


def _reports(jury: Jury, nominal: Mapping[str, Take], before: Residuals, after: Residuals, fitted: RobotModel | None
             ) -> tuple[TakeReport, ...]:
    """What each take was and is. fitted: the model with its effects; None: nothing was found."""
    was = [e.take.observed(nominal[e.name]) for e in jury.evidence]
    now = was if fitted is None else jury.observed(fitted, jury.config)
    out = []
    for i, e in enumerate(jury.evidence):
        ill = channel_gaps(e, before[i])
        shown = [k for k, c in enumerate(e.channels) if ACROSS not in c or c in ill]  # across the axes there is mostly nothing
        out.append(TakeReport(replace(e.take.recorded, name=e.name), was[i], now[i], tuple(e.channels[k] for k in shown),
                              e.sigma[shown], before[i][:, shown], after[i][:, shown], e.uses["validate"]))
    return tuple(out)
