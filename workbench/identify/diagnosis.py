"""Session in, findings out: where the recordings leave the model, which physics explains it, and what stays unexplained."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from workbench.compare.channels import ACROSS
from workbench.compare.compare_session import Rollouts, provenance, roll_out, run_of
from workbench.compare.session import Base, Session
from workbench.compare.session_takes import LeftOut, Progress, ReadTake, no_progress, read_takes, register_takes
from workbench.experiment.design import Experiment, Sight, design_experiment
from workbench.identify.conclusions import Residuals, change, finding, posterior, rejected, unexplained, verdict_of
from workbench.identify.estimators.dropped_again import Played, played_as
from workbench.identify.estimators.dropped_commands import with_missed
from workbench.identify.estimators.geometry import Build, build_of
from workbench.identify.estimators.stops_and_mounts import special
from workbench.identify.findings import Diagnosis
from workbench.identify.fitting.constancy import drifts
from workbench.identify.fitting.downward_force import hanging
from workbench.identify.fitting.fits import Fit, Search
from workbench.identify.ledger import channel_gaps, ledger
from workbench.identify.problem import BLOCK, USES, TakeEvidence, gather
from workbench.identify.proposals import candidates
from workbench.identify.registers import read_off_registers
from workbench.identify.rollouts import Jury, Question
from workbench.identify.selection.acceptance import idle, too_little_left
from workbench.identify.selection.calibration import doubted
from workbench.identify.selection.forward import select
from workbench.identify.selection.model_comparison import Standing, contest
from workbench.identify.shooting import base_states
from workbench.identify.subset import floors_everywhere, judged_fairly, searched, share_of
from workbench.identify.take_report import TakeStory
from workbench.motion.motion import Motion
from workbench.recording.take import Take
from workbench.robot import InputError, RobotModel
from workbench.simulation import SimulationConfig
from workbench.simulation.steady import BaseStates

STEP = 2e-3
"""Of the search's rollouts [s]; what this step is wrong by on the nominal robot, as finer ones tell, is taken off all of them."""
MOTION = "next_experiment.csv"
WORSE = 0.05
"""Share of all that is missing that may come with what was measured."""
TIED = 0.05
"""Probability from which on a rival is worth an experiment."""


@dataclass(frozen=True)
class Told:
    """A diagnosis, the takes behind it, and the motion of the next experiment."""

    diagnosis: Diagnosis
    stories: tuple[TakeStory, ...]
    motion: Motion | None = None


def diagnose_session(session: Session, progress: Progress = no_progress, n_jobs: int = 2, memory: Path | None = None,
                     thorough: bool = False) -> Told:
    """Diagnoses a session. Damaged takes are left out and named; InputError where none remains. memory: folder that keeps every
    rollout's channels, so that a killed run resumes. thorough: searches to the end, however long it takes."""
    began = time.monotonic()
    progress("reading recordings", None)
    takes, unreadable = read_takes(session)
    config = SimulationConfig(settle=0.6, contact_period=0, time_step=STEP)
    seen = _seen(session, takes, config, n_jobs, progress)
    evidence = seen.evidence
    _enough(session, evidence)
    jury = Jury(evidence, config, n_jobs, memory)
    nominal = begun = Search(jury, session.model).evaluated([])
    gap = ledger(evidence, nominal.residuals)
    build = _believed(build_of(session.model, evidence, nominal.residuals), jury, session.model, nominal) if gap else Build()
    build = replace(build, measured=(*build.measured, *read_off_registers(session)))
    known = session.with_model(build.added_to(session.model))
    if build.measured:  # what steps and contact models leave open is another robot's
        evidence = _seen(known, [replace(t, model=known.model_of(t.spec)) for t in takes], config, n_jobs, progress).evidence
        jury = Jury(evidence, config, n_jobs, memory)
        begun = Search(jury, known.model).evaluated([])
    sent = jury
    jury, missed = with_missed(sent, known.model, begun.residuals)
    looked_at = searched(judged_fairly(jury.evidence, begun.residuals), begun.residuals)
    search = Search(begun_with := jury.on(looked_at), known.model)
    pool = build.asked(candidates(known.model, evidence)) + special(known.model, evidence, begun.residuals)
    chosen = select(search, pool, progress, thorough, Played(sent, missed))
    missed = chosen.missed
    if search.jury is not begun_with:
        jury = jury.on(played_as(jury.evidence, search.jury.evidence))
    fit, standings = contest(search, chosen, progress)
    progress("numbers at a finer step", None)
    fit = search.refined(fit) if fit.effects else fit
    floors = search.floors(fit) if fit.effects else {}
    changing = drifts(search, fit)
    standings = doubted(search, fit, standings, floors, [d.effect for d in changing], idle(search, fit))
    fitted = fit.model(known.model)
    model = replace(fitted, effects=(*fitted.effects, *(m.spec for m in missed)))
    after, rough = fit.residuals, floors
    if any(np.isfinite(e.until) for e in looked_at):
        progress("rolling out whole takes", None)
        after = jury.residuals([Question(fitted, tuple(range(len(evidence))))])[0]
        rough = floors_everywhere(looked_at, floors)
    measured = tuple(m.finding(*(change(evidence, (m.where,), nominal.residuals, after, use) for use in ("fit", "validate")))
                     for m in build.measured)
    findings = measured + tuple(m.finding() for m in missed) + tuple(
        finding(evidence, fit, i, standings[i], nominal.residuals, after) for i in range(len(fit.effects)))
    left = (*unexplained(evidence, after, rough), *(d.left(evidence) for d in changing), *hanging(fit)) if gap else ()
    # what no effect could be told from, and unseen stretches do not show, is in the ledger, but is no gap
    slight = not findings and not left and too_little_left(search, fit, search.fitted, (), everywhere=False)
    verdict = verdict_of(bool(gap) and not slight, findings, left)
    experiment = _experiment(session, evidence, fit, standings, n_jobs, progress)
    progress("rolling out the fitted model", None)
    diagnosis = Diagnosis(
        verdict=verdict, model=model, nominal=session.model, gap=gap, findings=findings,
        rejected=rejected(looked_at, fit, chosen.rounds, standings, nominal.residuals), unexplained=left,
        posterior=posterior(fit, (*build.measured, *missed)),
        next_experiment=None if experiment is None else experiment.entry(MOTION),
        provenance=provenance(session.model, config, time.monotonic() - began)
        | {"seed": 0, "rollouts": search.jury.rollouts} | share_of(looked_at),
        stopped=chosen.stopped, left_out=unreadable + seen.left_out)
    stories = _stories(jury, seen.nominal, nominal.residuals, after, fitted if findings else None)
    return Told(diagnosis, stories, None if experiment is None else experiment.motion)


@dataclass(frozen=True)
class _Seen:
    """Takes beside a model's rollouts: evidence, by take the rollout of a robot left to itself, takes left out and why."""

    evidence: list[TakeEvidence]
    nominal: dict[str, Take]
    left_out: LeftOut


def _seen(session: Session, takes: Sequence[ReadTake], config: SimulationConfig, n_jobs: int, progress: Progress) -> _Seen:
    def rolled(these: Sequence[ReadTake], steadied: Mapping[str, BaseStates | None], floors: bool = True) -> dict[str, Rollouts]:
        runs = [run_of(t, steadied.get(t.spec.name)) for t in these]
        return {r.name: of for r, of in zip(runs, roll_out(runs, config, progress=progress, n_jobs=n_jobs, floors=floors))}

    rollouts = (rolled([t for t in takes if t.spec.base != "free"], {})
                | rolled([t for t in takes if t.spec.base == "free"], {}, floors=False))
    nominal = {name: r.nominal for name, r in rollouts.items()}
    registered, left_out = register_takes(session, takes, nominal, progress)
    walking = [t for t in registered if t.spec.base == "free"]
    steadied = {t.spec.name: base_states(t.recorded) for t in walking}
    rollouts |= rolled(walking, steadied)  # held takes are judged by what they were registered with
    return _Seen(gather(registered, rollouts, steadied), nominal, left_out)


def _believed(build: Build, jury: Jury, model: RobotModel, nominal: Fit) -> Build:
    """What was measured, unless with that in the model the takes are told worse; not always better, as beside what else is
    missing the right leg may walk the wrong way."""
    if not build.measured:
        return build
    there = Search(jury, build.added_to(model)).evaluated([])
    worse = (there.cost["fit"] + there.cost["choose"]) / (nominal.cost["fit"] + nominal.cost["choose"]) - 1.0
    return build if worse < WORSE else replace(build, measured=())


def _enough(session: Session, evidence: Sequence[TakeEvidence]) -> None:
    """InputError where no conclusion could be drawn, whatever the recordings show."""
    least = BLOCK * len(USES)
    longest = max(float(np.ptp(e.take.recorded.time[e.moving])) if e.moving.any() else 0.0 for e in evidence)
    if longest < least and not any(e.take.spec.use for e in evidence):
        raise InputError(session.path, f"nothing can be concluded: no take shows more than {longest:.1f} s after its first "
                                       f"command, but fitting, choosing and validating take {least:.1f} s")


def _experiment(session: Session, evidence: Sequence[TakeEvidence], fit: Fit, standings: Sequence[Standing], n_jobs: int,
                progress: Progress) -> Experiment | None:
    """The motion that tells findings from rivals that these takes leave possible; None where there are none, or none does."""
    tied = [(fit.model(session.model), s.rivals[0].fit.model(session.model)) for s in standings
            if s.rivals and s.rivals[0].fit is not None and s.rivals[0].probability > TIED]
    if not tied:
        return None
    sights: dict[Base, Sight] = {}
    for e in evidence:
        sigma = {j: float(e.sigma[e.channels.index(j)]) for j in e.joints}
        sights[e.take.spec.base] = Sight(sigma, e.take.recorded.zeroed, 1.0 / e.frame_time)
    experiment = design_experiment(session.model, tied, sights, n_jobs, progress)
    return experiment if experiment.entry(MOTION) is not None else None


def _stories(jury: Jury, nominal: Mapping[str, Take], before: Residuals, after: Residuals, fitted: RobotModel | None
             ) -> tuple[TakeStory, ...]:
    """What each take was and is. fitted: the model with its effects; None: nothing was found."""
    was = [e.take.observed(nominal[e.name]) for e in jury.evidence]
    now = was if fitted is None else jury.observed(fitted, jury.config)
    out = []
    for i, e in enumerate(jury.evidence):
        ill = channel_gaps(e, before[i])
        shown = [k for k, c in enumerate(e.channels) if ACROSS not in c or c in ill]  # across the axes there is mostly nothing
        out.append(TakeStory(replace(e.take.recorded, name=e.name), was[i], now[i], tuple(e.channels[k] for k in shown),
                             e.sigma[shown], before[i][:, shown], after[i][:, shown], e.uses["validate"]))
    return tuple(out)
