"""Session in, findings out: where the recordings leave the model, which physics explains it, and what stays unexplained."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.gap.candidates import Candidate, candidates
from workbench.gap.compare_session import provenance, roll_out, run_of
from workbench.gap.evidence import BODY, Jury, TakeEvidence, gather
from workbench.gap.findings import (
    Alternative,
    Change,
    Diagnosis,
    Estimate,
    Finding,
    GapEntry,
    Rejected,
    Unexplained,
    Verdict,
)
from workbench.gap.registered import Progress, no_progress, read_takes, register_takes
from workbench.gap.search import Fit, Search
from workbench.gap.selection import Round, select
from workbench.gap.session import Session
from workbench.gap.story import TakeStory
from workbench.robot.model_file import Posterior, parameter_names
from workbench.simulation import SimulationConfig

Array = NDArray[np.float64]
EXPLAINED = 1.3
"""Of what noise, numerics and contact models make (contract, section 6)."""
Z90 = 1.645


@dataclass(frozen=True)
class Told:
    """A diagnosis and the takes behind it."""

    diagnosis: Diagnosis
    stories: tuple[TakeStory, ...]


def diagnose_session(session: Session, progress: Progress = no_progress, n_jobs: int = 2) -> Told:
    """Diagnoses a session. Damaged takes are left out and named; InputError where none remains."""
    began = time.monotonic()
    progress("reading recordings", None)
    takes, unreadable = read_takes(session)
    config = SimulationConfig(settle=0.6, contact_period=0)
    rollouts = roll_out([run_of(t) for t in takes], config, progress=progress, n_jobs=n_jobs)
    registered, unregistered = register_takes(session, takes, {t.spec.name: r.nominal for t, r in zip(takes, rollouts)}, progress)
    evidence = gather(registered, {t.spec.name: r for t, r in zip(takes, rollouts)})
    jury = Jury(evidence, config, n_jobs)
    search = Search(jury, session.model, candidates(session.model, evidence))
    nominal = search.fit([], np.empty(0))
    gap = ledger(evidence, nominal.residuals)
    fit, rounds = nominal, list[Round]()
    if gap:
        search.screen(lambda what, share: progress(f"screening {what}", share))
        fit, rounds = select(search, progress)
    model = fit.model(session.model)
    findings = tuple(_finding(evidence, fit, i, nominal, rounds) for i in range(len(fit.effects)))
    left = _unexplained(evidence, fit.residuals)
    verdict: Verdict = "no_gap"
    if gap:
        verdict = "unexplained" if not findings else "partly_explained" if left else "explained"
    diagnosis = Diagnosis(
        verdict=verdict, model=model, nominal=session.model, gap=gap, findings=findings,
        rejected=_rejected(evidence, fit, rounds),
        unexplained=left, posterior=_posterior(fit, model.effects[len(session.model.effects):]),
        provenance=provenance(session.model, config, time.monotonic() - began) | {"seed": 0},
        left_out=unreadable + unregistered)
    return Told(diagnosis, _stories(jury, evidence, nominal, fit, session))


def ratios(e: TakeEvidence, residual: Array, use: str | None = None) -> dict[str, float]:
    """RMS of residual over sigma, by channel; on all frames after the first command, or those of one use."""
    rows = residual if use is None else residual[e.uses[use]]
    with np.errstate(invalid="ignore"):
        return {c: float(np.sqrt(np.nanmean(np.square(rows[:, i])))) for i, c in enumerate(e.channels)}


def ledger(evidence: Sequence[TakeEvidence], residuals: Sequence[Array]) -> tuple[GapEntry, ...]:
    """Where and when takes leave the model by more than noise, numerics and contact models explain, the largest first.

    Joints are booked as the actuator's; the body's path and tilt as the ground's, once no joint of the take explains them.
    """
    rows: list[tuple[float, GapEntry]] = []
    for e, residual in zip(evidence, residuals):
        beyond = {c: r for c, r in ratios(e, residual).items() if r > EXPLAINED}
        for c, r in beyond.items():
            i = e.channels.index(c)
            body = c in BODY
            if body and any(j not in BODY and s > r for j, s in beyond.items()):
                continue
            floor, unit = _in_file_units(float(e.sigma[i]), c)
            rows.append((r, GapEntry(
                layer="ground" if body else "actuator", where=() if body else (c,), take=e.name,
                when=_when(e, residual[:, i]), error=r * floor, floor=floor, unit=unit, phase=_phase(e, residual[:, i]))))
    return tuple(entry for _, entry in sorted(rows, key=lambda row: -row[0]))


def _in_file_units(value: float, channel: str) -> tuple[float, str]:
    return (value, "m") if channel in ("forward", "left", "height") else (float(np.rad2deg(value)), "deg")


def _when(e: TakeEvidence, residual: Array, span: float = 0.2, least: float = 2.0) -> tuple[tuple[float, float], ...]:
    """Stretches [s] of the recording's clock in which the residual is beyond twice sigma; the five longest, in order."""
    t = e.take.recorded.time
    n = max(1, round(span / float(np.median(np.diff(t)))))
    power = np.convolve(np.nan_to_num(np.square(residual)), np.ones(n) / n, mode="same")
    inside = np.concatenate([[False], power > least**2, [False]])
    edges = np.flatnonzero(np.diff(inside.astype(int)))
    stretches = [(float(t[a]), float(t[b - 1])) for a, b in zip(edges[::2], edges[1::2])]
    return tuple(sorted(sorted(stretches, key=lambda s: s[0] - s[1])[:5]))


def _phase(e: TakeEvidence, residual: Array) -> str:
    """Whether a joint errs more while commands move it or while it holds; empty where both alike."""
    commands = e.take.commands
    if commands is None:
        return ""
    t = e.take.recorded.time - e.take.measurement.starts_at
    moving = (np.abs(np.diff(commands.reference(t), axis=0, prepend=0)) > 1e-6).any(axis=1)
    known = np.isfinite(residual)
    power = [float(np.mean(np.square(residual[m & known]))) if (m & known).any() else 0.0 for m in (moving, ~moving)]
    return "moving" if power[0] > 2 * power[1] else "holding" if power[1] > 2 * power[0] else ""


def _change(evidence: Sequence[TakeEvidence], where: tuple[str, ...], before: Fit, after: Fit, use: str) -> Change:
    """RMS error [deg] of the joints concerned (all of them for a robot, foot or link), before and after."""
    joints = [c for c in evidence[0].channels if c in where] or [c for c in evidence[0].channels if c not in BODY]

    def rms(fit: Fit) -> float:
        parts = [np.square((r * e.sigma)[e.uses[use]][:, [e.channels.index(j) for j in joints if j in e.channels]])
                 for e, r in zip(evidence, fit.residuals)]
        return float(np.rad2deg(np.sqrt(np.nanmean(np.concatenate([p.ravel() for p in parts])))))

    return Change(rms(before), rms(after), "deg")


def _finding(evidence: Sequence[TakeEvidence], fit: Fit, i: int, nominal: Fit, rounds: Sequence[Round]) -> Finding:
    c, x = fit.effects[i], fit.x[fit.slices()[i]]
    where, confidence = c.where, 0.99
    alternatives: tuple[Alternative, ...] = ()
    for r in rounds:
        if r.accepted and (r.added(r.trials[0]).effect.name, r.added(r.trials[0]).where) == (c.effect.name, c.where):
            p = r.probabilities()
            confidence = min(p[0], 0.99)
            if len(p) > 1 and p[1] > 0.02:
                rival = r.added(r.trials[1])
                alternatives = (Alternative(rival.effect.name, rival.where, p[1]),)
    return Finding(
        effect=c.effect.name, where=where, confidence=confidence, parameters=_estimates(c, x, fit, i), alternatives=alternatives,
        fit=_change(evidence, where, nominal, fit, "fit"), validation=_change(evidence, where, nominal, fit, "validate"),
        evidence=c.effect.sentence(c.spec(x)))


def _estimates(c: Candidate, x: Array, fit: Fit, i: int) -> dict[str, Estimate]:
    """Values and 90 % bounds in the contract's units."""
    half = Z90 * np.sqrt(np.diag(fit.covariance)[fit.slices()[i]])
    ends = np.array([c.values(x - np.nan_to_num(half, posinf=1e9)), c.values(x + np.nan_to_num(half, posinf=1e9))])
    low, high = np.min(ends, axis=0), np.max(ends, axis=0)
    low[np.isinf(half)], high[np.isinf(half)] = -np.inf, np.inf
    out: dict[str, Estimate] = {}
    at = 0
    values = c.values(x)
    for p in c.effect.parameters:
        if p.vector:
            three = [tuple(float(v) for v in column[at:at + 3]) for column in (values, low, high)]
            out[p.name] = Estimate(three[0], three[1], three[2], p.unit)  # type: ignore[arg-type]
        else:
            out[p.name] = Estimate(values[at], float(low[at]), float(high[at]), p.unit)
        at += 3 if p.vector else 1
    return out


def _rejected(evidence: Sequence[TakeEvidence], fit: Fit, rounds: Sequence[Round]) -> tuple[Rejected, ...]:
    """Rivals that were simulated and lost, with what they left where nothing had been fitted."""
    kept = {(c.effect.name, c.where) for c in fit.effects}
    out: dict[tuple[str, tuple[str, ...]], Rejected] = {}
    for r in rounds:
        for trial in r.trials:
            c = r.added(trial)
            if (c.effect.name, c.where) in kept or (c.effect.name, c.where) in out:
                continue
            best = r.trials[0]
            reason = (f"{r.added(best)} leaves {best.cost['choose']:.0f} of chi squared on the choosing stretches, this "
                      f"{trial.cost['choose']:.0f}") if trial is not best else "what it takes away is no more than chance could"
            out[c.effect.name, c.where] = Rejected(c.effect.name, c.where, reason,
                                                   _change(evidence, c.where, r.before, trial, "validate"))
    return tuple(out.values())


def _unexplained(evidence: Sequence[TakeEvidence], residuals: Sequence[Array]) -> tuple[Unexplained, ...]:
    """Channels that stay beyond 1.3 times noise, floor and spread on stretches that nothing saw, with what they depend on."""
    out = []
    for e, residual in zip(evidence, residuals):
        for c, r in ratios(e, residual, "validate").items():
            if not r > EXPLAINED:
                continue
            i = e.channels.index(c)
            floor, unit = _in_file_units(float(e.sigma[i]), c)
            out.append(Unexplained(() if c in BODY else (c,), r * floor, floor, unit,
                                   f"{e.name}: {_depends(e, residual[:, i], c)}"))
    return tuple(out)


def _depends(e: TakeEvidence, residual: Array, channel: str) -> str:
    """What a residual goes with: its joint's angle, speed or direction, or time."""
    what = f"{channel}, " if channel in BODY else ""
    signals = {"time": e.take.recorded.time}
    if channel not in BODY:
        q = e.take.recorded.q[:, e.take.recorded.column(channel)]
        v = np.gradient(q, e.take.recorded.time)
        signals |= {"angle": q, "speed": v, "direction of motion": np.sign(v) * (np.abs(v) > 0.2)}
    found = {}
    for name, s in signals.items():
        good = np.isfinite(residual) & np.isfinite(s)
        if good.sum() > 20 and np.std(s[good]) > 0:
            found[name] = abs(float(np.corrcoef(residual[good], s[good])[0, 1]))
    best = max(found, key=lambda k: found[k]) if found else ""
    told = best and found[best] > 0.3
    return what + (f"goes with {best} (correlation {found[best]:.2f})" if told else "goes with nothing tried")


def _posterior(fit: Fit, specs: Sequence[object]) -> Posterior:
    """Of all numbers in the contract's units; variances by the local slope between a size and its value."""
    if not fit.effects:
        return Posterior()
    mean = np.concatenate([c.values(fit.x[s]) for c, s in zip(fit.effects, fit.slices())])
    slope = np.concatenate([(np.array(c.values(fit.x[s] + 1e-4)) - np.array(c.values(fit.x[s] - 1e-4))) / 2e-4
                            for c, s in zip(fit.effects, fit.slices())])
    with np.errstate(invalid="ignore"):
        covariance = np.nan_to_num(fit.covariance * np.outer(slope, slope), nan=np.inf, posinf=np.inf)
    return Posterior(parameter_names(specs), mean, covariance)  # type: ignore[arg-type]


def _stories(jury: Jury, evidence: Sequence[TakeEvidence], nominal: Fit, fit: Fit, session: Session) -> tuple[TakeStory, ...]:
    out = []
    for i, e in enumerate(evidence):
        takes = jury.observed([session.model, fit.model(session.model)], i)
        out.append(TakeStory(replace(e.take.recorded, name=e.name), takes[0], takes[1], e.channels, nominal.residuals[i],
                             fit.residuals[i], e.uses["validate"]))
    return tuple(out)
