"""Session in, findings out: where the recordings leave the model, which physics explains it, and what stays unexplained.

`diagnose_session` goes through the steps of docs/method.md, in their order.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from workbench.compare.channels import ACROSS
from workbench.compare.compare_session import provenance
from workbench.compare.logged import describe_logging, register_laws
from workbench.compare.session import Base, Session
from workbench.compare.session_takes import ReadTake, read_takes
from workbench.effects.registry import effect_named
from workbench.identify.conclusions import Residuals, change, verdict_of
from workbench.identify.estimators.dropped_commands import TakesAsPlayed
from workbench.identify.estimators.geometry import Geometry, geometry_of
from workbench.identify.estimators.registers import read_off_registers
from workbench.identify.estimators.stops_and_mounts import read_off_candidates
from workbench.identify.evidence.explain import explained_by_evidence, is_by_logs
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.judge import COMPILED, EnginesPartError, judge_by_drake
from workbench.identify.ledger import ledger
from workbench.identify.options import PROBLEM, READ_OFF
from workbench.identify.preparation import check_duration, prepare
from workbench.identify.problem import channel_gaps
from workbench.identify.proposals import candidates, unloaded_joints, unobservable
from workbench.identify.results.findings import Diagnosis
from workbench.identify.results.take_report import TakeReport
from workbench.identify.results.ties import ObservationModel, Tie, observation_models
from workbench.identify.rollouts.evaluator import RolloutEvaluator
from workbench.identify.search_result import Problem, SearchResult
from workbench.identify.selection.explanation import explained_by_selection
from workbench.identify.subset import subset_used
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig
from workbench.types import Progress, no_progress

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
class _Settings:
    """How a session is diagnosed. began: time.monotonic of the start; the rest as in `diagnose_session`."""

    progress: Progress
    n_jobs: int
    memory: Path | None
    thorough: bool
    without: frozenset[str]
    began: float
    previous: RobotModel | None = None

    def searches(self, effect: str) -> bool:
        """Whether an effect of that name is looked for."""
        return effect not in self.without

    @property
    def options(self) -> EvidenceOptions:
        """Options of the search of servo logs."""
        return EvidenceOptions() if self.previous is None else EvidenceOptions.since()

    def provenance(self) -> dict[str, object]:
        """These options, as the results record them."""
        since = {} if self.previous is None else {"model before": self.previous.sha256}
        return since | ({"without": sorted(self.without)} if self.without else {})


def diagnose_session(session: Session, progress: Progress = no_progress, n_jobs: int = 2, memory: Path | None = None,
                     thorough: bool = False, without: Sequence[str] = (), previous: RobotModel | None = None,
                     engine: str = "auto") -> DiagnosisResult:
    """Diagnoses a session. Damaged takes are left out and named; InputError where none remains. memory: folder that caches every
    rollout's channels, so that a killed run resumes. thorough: searches to the end, however long it takes. without: names of
    effects that are known to be absent, and are not searched for; InputError for an unknown effect. previous: the robot of an
    earlier diagnosis, whose servos and effects are taken as nominal, so that findings are the changes since; InputError where
    that is another robot. Rollouts are compiled where the compiled station supports the model, unless Drake disagrees on the
    nominal or on the final model, or `engine` is "drake"."""
    config = SimulationConfig(settle=0.6, contact_period=0, time_step=PROBLEM.time_step)
    absent = frozenset(effect_named(name).name for name in without)
    settings = _Settings(progress, n_jobs, memory, thorough, absent, time.monotonic(), previous)
    if previous is not None:
        session.with_model(previous)  # refuses another robot
        session = session.with_model(session.model.with_physics(previous.servos, previous.effects))
    if engine == "drake":
        return _diagnose(session, replace(config, engine="drake"), settings, {"rollouts by": "Drake"})
    try:
        return _diagnose(session, config, settings, {"rollouts by": COMPILED})
    except EnginesPartError as why:
        progress(f"{why}: again by Drake", None)
        by_drake = {"rollouts by": "Drake", "because": str(why)}
        return _diagnose(session, replace(config, engine="drake"), settings, by_drake)


def _diagnose(session: Session, config: SimulationConfig, settings: _Settings, engine: Mapping[str, str]) -> DiagnosisResult:
    """Diagnoses with one engine; EnginesPartError where that is not Drake and Drake says otherwise."""
    progress = settings.progress
    # 1. What the recordings show, channel by channel, over what noise and numerics alone make of each
    progress("reading recordings", None)
    takes, unreadable = read_takes(session)
    seen = prepare(session, takes, config, settings.n_jobs, progress)
    check_duration(session, seen.evidence)
    evaluator = RolloutEvaluator(seen.evidence, config, settings.n_jobs, settings.memory)
    nominal = Search(evaluator, session.model).evaluate([])
    progress("judging the engine", None)
    apart = {BESIDE_DRAKE.format("nominal"): judge_by_drake(evaluator, session.model, "nominal")}

    # 2. The gap: where, when and in which layer they differ from the nominal model
    gap = ledger(seen.evidence, nominal.residuals)

    # 3. What is read off without a search: geometry, the servos' registers, commands that never arrived, stops, mounts, frames
    measured = geometry_of(session.model, evaluator.evidence, nominal.residuals) if gap else Geometry()
    build = _check_geometry(measured, evaluator, session.model, nominal)
    laws = register_laws([e.take for e in evaluator.evidence])
    read_off = (*build.measured, *read_off_registers(session, laws))
    build = replace(build, measured=tuple(m for m in read_off if settings.searches(m.effect)))
    known = session.with_model(build.added_to(session.model))
    as_built = _again(evaluator, known, takes, progress) if build.measured else evaluator
    evidence = as_built.evidence
    start = Search(as_built, known.model).evaluate([])
    as_played = TakesAsPlayed(as_built, without=settings.without)
    evaluator, missed = as_played.without_missed(known.model, start.residuals)
    unloaded = unloaded_joints(known.model, evidence)
    pool = build.select_untried(candidates(known.model, evidence, unloaded))
    pool += read_off_candidates(known.model, evidence, start.residuals)
    pool = [c for c in pool if settings.searches(c.effect.name)]

    _give_back()

    # 4. Which effects explain it: servo logs by evidence, filmed takes by forward selection
    search: Callable[[Problem], SearchResult] = explained_by_evidence if is_by_logs(evidence) else explained_by_selection
    options = settings.options if gap else settings.options.without_names()
    found = search(Problem(evaluator, known.model, start.residuals, pool, replace(as_played, missed=missed), settings.thorough,
                           progress, options, laws))

    _give_back()

    # 5. What that leaves, on whole takes
    evaluator = found.takes_of(evaluator)
    fitted = found.model
    after, floors = found.left_by(evaluator, progress)
    progress("judging the engine", None)
    apart[BESIDE_DRAKE.format("final")] = judge_by_drake(evaluator, fitted, "final")
    findings = (*(m.finding(*(change(evidence, m.places, nominal.residuals, after, use) for use in ("fit", "validate")))
                  for m in build.measured), *(m.finding() for m in found.missed),
                *found.findings(evidence, nominal.residuals, after))
    unknown = found.unknown_torques(evidence, nominal.residuals, after)
    left = found.unexplained(evidence, after, floors) if gap else ()

    # 6. Conclusions
    # what no effect could be told from, and unseen stretches do not show, is in the ledger, but is no gap
    slight = not findings and not unknown and not left and found.is_slight()
    progress("rolling out the fitted model", None)
    model = found.calibrated.with_effects((*fitted.effects, *(m.spec for m in found.missed)))
    diagnosis = Diagnosis(
        verdict=verdict_of(bool(gap) and not slight, findings, (*left, *unknown)),
        model=model, nominal=session.model,
        gap=gap, findings=findings, rejected=found.rejected(nominal.residuals), unexplained=left,
        posterior=found.posterior((*build.measured, *found.missed)).in_order(model.effects),
        provenance=provenance(session.model, config, time.monotonic() - settings.began) | settings.provenance()
        | {"seed": 0, "rollouts": evaluator.memory.rollouts, "engine": {**engine, **apart}}
        | subset_used(found.looked_at) | describe_logging([e.take for e in evidence], laws)
        | {"cannot_show": unobservable(session.model, evidence, unloaded)},
        stopped=found.stopped, left_out=unreadable + seen.left_out, recalibrated=found.recalibrated,
        unknown_torques=unknown, tied=found.tied)
    changed = bool(findings or unknown or found.recalibrated)
    reports = _reports(evaluator, seen.nominal, nominal.residuals, after, fitted if changed else None)
    return DiagnosisResult(diagnosis, reports, found.ties(), observation_models(evidence))


def _check_geometry(build: Geometry, evaluator: RolloutEvaluator, model: RobotModel, nominal: Fit) -> Geometry:
    """The measured geometry of the robot, unless it makes the residuals larger; it need not make them smaller, since combined
    with other missing effects even the right leg length may walk the wrong way."""
    if not build.measured:
        return build
    there = Search(evaluator, build.added_to(model)).evaluate([])
    worse = (there.cost["fit"] + there.cost["choose"]) / (nominal.cost["fit"] + nominal.cost["choose"]) - 1.0
    return build if worse < READ_OFF.geometry_worse else replace(build, measured=())


def _again(evaluator: RolloutEvaluator, known: Session, takes: Sequence[ReadTake], progress: Progress) -> RolloutEvaluator:
    """Rollouts of the robot with its measured geometry, whose numerical floor and contact spread are its own."""
    read = [replace(t, model=known.model_of(t.spec)) for t in takes]
    return evaluator.on(prepare(known, read, evaluator.config, evaluator.n_jobs, progress).evidence)


def _reports(
    evaluator: RolloutEvaluator, nominal: Mapping[str, Take], before: Residuals, after: Residuals, fitted: RobotModel | None
) -> tuple[TakeReport, ...]:
    """A report of each take before and after the diagnosis. fitted: the model with its effects; None: nothing was found."""
    was = [e.take.observe(nominal[e.name]) for e in evaluator.evidence]
    now = was if fitted is None else evaluator.observe(fitted, evaluator.config)
    out = []
    for i, e in enumerate(evaluator.evidence):
        ill = channel_gaps(e, before[i])
        shown = [k for k, c in enumerate(e.channels) if ACROSS not in c or c in ill]  # across the axes there is mostly nothing
        out.append(TakeReport(replace(e.take.recorded, name=e.name), was[i], now[i], tuple(e.channels[k] for k in shown),
                              e.sigma[shown], before[i][:, shown], after[i][:, shown], e.uses["validate"]))
    return tuple(out)


def _give_back() -> None:
    """Gives freed memory back to the system, where the C library can (glibc): arrays of whole recordings leave holes between
    small objects, which stay with the process otherwise."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
