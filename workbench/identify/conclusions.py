"""From fits to conclusions: parameters with intervals, residuals that remain, and the verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from workbench.compare.channels import BODY, joint_of
from workbench.identify.options import CONCLUSIONS, PROBLEM
from workbench.identify.parameters import Candidate
from workbench.identify.point_mass import PointMass
from workbench.identify.problem import TakeEvidence, in_file_units, joint_error, ratios
from workbench.identify.results.findings import Change, Estimate, Finding, Unexplained, Verdict
from workbench.identify.results.reasons import Dependence, Signal
from workbench.robot import EffectSpec
from workbench.robot.model_file import Posterior, parameter_names
from workbench.types import Array

Residuals = Mapping[int, Array]


class ReadOff(Protocol):
    """An effect of one number that was read off the recordings: its mean and variance, in the unit of docs/formats.md."""

    @property
    def spec(self) -> EffectSpec:
        """The estimate as an effect of the model."""
    @property
    def mean(self) -> float:
        """Mean of the tie's first parameter."""
    @property
    def variance(self) -> float:
        """Variance of that mean."""


def verdict_of(gap: bool, findings: Sequence[Finding], left: Sequence[object]) -> Verdict:
    """The verdict's word in docs/formats.md; a finding that is less probable than not explains nothing. left: unexplained
    residuals."""
    if not gap:
        return "no_gap"
    if not findings:
        return "unexplained"
    return "partly_explained" if left or not all(f.likely for f in findings) else "explained"


def estimates(c: Candidate, x: Array, covariance: Array) -> dict[str, Estimate]:
    """Values and 90 % bounds in the units of docs/formats.md, `CONCLUSIONS.wider` than the covariance alone says; numbers that
    were read off, not fitted, have no bounds."""
    covariance = CONCLUSIONS.wider**2 * covariance
    half = CONCLUSIONS.z90 * np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore"):
        ends = np.array([c.values(x - np.nan_to_num(half, posinf=1e9)), c.values(x + np.nan_to_num(half, posinf=1e9))])
    values = np.array(c.values(x))
    unknown = np.ones(len(values), dtype=bool)
    if isinstance(c, PointMass):  # where it is says a moment over a mass: both err, together
        slopes, known = value_slopes(c, x), np.isfinite(half)
        spread = CONCLUSIONS.z90 * np.sqrt(np.diag(slopes[:, known] @ covariance[np.ix_(known, known)] @ slopes[:, known].T))
        ends = np.array([values - spread, values + spread])
        unknown = np.any(slopes[:, ~known] != 0, axis=1) | ~np.any(slopes != 0, axis=1)
    else:
        unknown[[k for k, fixed in enumerate(c.fixed) if not fixed]] = np.isinf(half)
    low, high = np.min(ends, axis=0), np.max(ends, axis=0)
    if c.spread:
        low, high = values - CONCLUSIONS.z90 * np.array(c.spread), values + CONCLUSIONS.z90 * np.array(c.spread)
        unknown = np.array(c.spread) == 0
    neutral = np.array([n if np.isfinite(n) and not p.shapes else 0.0 for n, p in zip(c.neutral, c.parameters)])
    least = CONCLUSIONS.z90 * np.maximum(
        CONCLUSIONS.least_relative * np.abs(values - neutral), [p.resolution for p in c.parameters]
    )
    low, high = np.minimum(low, values - least), np.maximum(high, values + least)
    low[unknown], high[unknown] = -np.inf, np.inf
    out: dict[str, Estimate] = {}
    at = 0
    for p in c.given:
        if p.vector:
            three = [tuple(float(v) for v in column[at:at + 3]) for column in (values, low, high)]
            out[p.name] = Estimate(three[0], three[1], three[2], p.unit)  # type: ignore[arg-type]
        else:
            out[p.name] = Estimate(float(values[at]), float(low[at]), float(high[at]), p.unit)
        at += 3 if p.vector else 1
    return out


def change(evidence: Sequence[TakeEvidence], where: tuple[str, ...], before: Residuals, after: Residuals, use: str) -> Change:
    """RMS error [deg] of the joints concerned (all of them for a robot, foot or link), before and after."""
    all_joints = list(evidence[0].joints)
    joints = [c for c in all_joints if c in where] or all_joints
    return Change(joint_error(evidence, joints, before, use), joint_error(evidence, joints, after, use), "deg")


def list_unexplained(evidence: Sequence[TakeEvidence], residuals: Residuals, floors: Residuals) -> tuple[Unexplained, ...]:
    """Channels that exceed 1.3 times noise, floor and spread on unseen stretches, with the signal they correlate with.

    residuals: of takes that are judged. floors: by take, numerical floor (c,) over sigma of the fitted model, which may be
    larger than the nominal one's."""
    out = []
    for i in sorted(residuals):
        e = evidence[i]
        for c, r in ratios(e, residuals[i], "validate").items():
            column = e.channels.index(c)
            wider = float(np.hypot(1.0, floors[i][column])) if i in floors else 1.0
            if not r > PROBLEM.gap_ratio * wider:
                continue
            sigma, unit = in_file_units(float(e.sigma[column]), c)
            out.append(Unexplained(() if c in BODY else (joint_of(c),), r * sigma, wider * sigma, unit,
                                   _dependence(e, residuals[i][:, column], c)))
    return tuple(out)


def _dependence(e: TakeEvidence, residual: Array, channel: str) -> Dependence:
    """The signal with which a residual correlates most: its joint's angle, speed, direction, or time."""
    signals: dict[Signal, Array] = {"time": e.take.recorded.time}
    if channel not in BODY:
        q = e.take.recorded.q[:, e.take.recorded.column(joint_of(channel))]
        v = np.gradient(q, e.take.recorded.time)
        signals |= {"angle": q, "size of the angle": np.abs(q), "speed": v, "direction of motion": np.sign(v) * (np.abs(v) > 0.2)}
    found: dict[Signal, float] = {}
    for name, s in signals.items():
        good = np.isfinite(residual) & np.isfinite(s)
        if good.sum() > 20 and np.std(s[good]) > 0 and np.std(residual[good]) > 0:
            found[name] = abs(float(np.corrcoef(residual[good], s[good])[0, 1]))
    best = max(found, key=lambda k: found[k], default=None)
    if best is None or not found[best] > CONCLUSIONS.correlated:
        return Dependence(e.name, channel)
    return Dependence(e.name, channel, best, found[best])


def with_read_off(fitted: Posterior, read_off: Sequence[ReadOff]) -> Posterior:
    """The posterior with numbers that no fit identified: where the model has them already with their variance, else one more
    each."""
    names, mean, covariance = list(fitted.names), fitted.mean, fitted.covariance
    for r in read_off:
        (name,) = parameter_names([r.spec])
        if name not in names:
            names, mean = [*names, name], np.append(mean, r.mean)
            covariance = np.pad(covariance, ((0, 1), (0, 1)))
        k = names.index(name)
        covariance = covariance.copy()
        covariance[k, :] = covariance[:, k] = 0.0
        covariance[k, k] = r.variance
    return Posterior(tuple(names), mean, covariance)


def value_slopes(c: Candidate, x: Array) -> Array:
    """Derivatives of a candidate's values by its sizes."""
    steps = 1e-4 * np.eye(c.size)
    columns = [(np.array(c.values(x + h)) - np.array(c.values(x - h))) / 2e-4 for h in steps]
    return np.stack(columns, axis=1) if columns else np.zeros((len(c.neutral), 0))
