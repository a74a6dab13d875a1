"""Session in, findings out: where the recordings leave the model, which physics explains it, and what stays unexplained."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from workbench.gap.candidates import candidates
from workbench.gap.compare_session import provenance, roll_out, run_of
from workbench.gap.conclusions import Residuals, finding, posterior, rejected, unexplained, verdict_of
from workbench.gap.constancy import drifts
from workbench.gap.contest import Standing, contest
from workbench.gap.doubts import doubted
from workbench.gap.evidence import ACROSS, BLOCK, USES, TakeEvidence, gather
from workbench.gap.experiment import Experiment, Sight, design_experiment
from workbench.gap.findings import Diagnosis
from workbench.gap.jury import Jury, Question
from workbench.gap.ledger import channel_gaps, ledger
from workbench.gap.missed import with_missed
from workbench.gap.registered import Progress, no_progress, read_takes, register_takes
from workbench.gap.search import Fit, Search
from workbench.gap.selection import select, too_little_left
from workbench.gap.session import Base, Session
from workbench.gap.share import floors_everywhere, searched, share_of
from workbench.gap.special import special
from workbench.gap.story import TakeStory
from workbench.motion.motion import Motion
from workbench.recording.take import Take
from workbench.robot import InputError, RobotModel
from workbench.simulation import SimulationConfig

STEP = 2e-3
"""Of the search's rollouts [s]; what this step is wrong by on the nominal robot, as finer ones tell, is taken off all of them."""
MOTION = "next_experiment.csv"
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
    rollouts = roll_out([run_of(t) for t in takes], config, progress=progress, n_jobs=n_jobs)
    by_name = {t.spec.name: r for t, r in zip(takes, rollouts)}
    unfitted = {name: r.nominal for name, r in by_name.items()}
    registered, unregistered = register_takes(session, takes, unfitted, progress)
    evidence = gather(registered, by_name)
    _enough(session, evidence)
    jury = Jury(evidence, config, n_jobs, memory)
    nominal = Search(jury, session.model).evaluated([])
    gap = ledger(evidence, nominal.residuals)
    jury, missed = with_missed(jury, session.model, nominal.residuals)
    looked_at = searched(jury.evidence, nominal.residuals)
    search = Search(jury.on(looked_at), session.model)
    pool = candidates(session.model, evidence) + special(session.model, evidence, nominal.residuals)
    chosen = select(search, pool, progress, thorough)
    fit, standings = contest(search, chosen, progress)
    progress("numbers at a finer step", None)
    fit = search.refined(fit) if fit.effects else fit
    floors = search.floors(fit) if fit.effects else {}
    changing = drifts(search, fit)
    standings = doubted(search, fit, standings, floors, [d.effect for d in changing])
    fitted = fit.model(session.model)
    model = replace(fitted, effects=(*fitted.effects, *(m.spec for m in missed)))
    after, rough = fit.residuals, floors
    if any(np.isfinite(e.until) for e in looked_at):
        progress("rolling out whole takes", None)
        after = jury.residuals([Question(fitted, tuple(range(len(evidence))))])[0]
        rough = floors_everywhere(looked_at, floors)
    findings = tuple(m.finding() for m in missed) + tuple(
        finding(evidence, fit, i, standings[i], nominal.residuals, after) for i in range(len(fit.effects)))
    left = (*unexplained(evidence, after, rough), *(d.left(evidence) for d in changing)) if gap else ()
    # what no effect could be told from, and unseen stretches do not show, is in the ledger, but is no gap
    slight = not findings and not left and too_little_left(search, fit, search.fitted, ())
    verdict = verdict_of(bool(gap) and not slight, findings, left)
    experiment = _experiment(session, evidence, fit, standings, n_jobs, progress)
    progress("rolling out the fitted model", None)
    diagnosis = Diagnosis(
        verdict=verdict, model=model, nominal=session.model, gap=gap, findings=findings,
        rejected=rejected(looked_at, fit, chosen.rounds, standings, nominal.residuals), unexplained=left,
        posterior=posterior(fit, missed),
        next_experiment=None if experiment is None else experiment.entry(MOTION),
        provenance=provenance(session.model, config, time.monotonic() - began)
        | {"seed": 0, "rollouts": search.jury.rollouts} | share_of(looked_at),
        stopped=chosen.stopped, left_out=unreadable + unregistered)
    stories = _stories(jury, unfitted, nominal.residuals, after, fitted if findings else None)
    return Told(diagnosis, stories, None if experiment is None else experiment.motion)


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
