"""Residuals of the most probable model, described so that a person can act: the signal they depend on, and the worst event."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from workbench.identify.conclusions import Residuals, list_unexplained
from workbench.identify.problem import TakeEvidence, in_file_units
from workbench.identify.results.findings import Unexplained
from workbench.identify.results.reasons import Dependence
from workbench.types import Array

EVENT = 0.5
"""Length of a stretch that is reported as one event [s]."""
STANDS = 0.1
"""Speed below which a joint stands [rad/s], some counts in a frame."""
FULL = 0.9
"""Duty from which on a servo does all that it can."""


class _Event(NamedTuple):
    """An event: its first instant on the take's clock [s], RMS error there [rad], median angle, speed and error of position [rad,
    rad/s], and duty, NaN where it was not logged."""

    begin: float
    error: float
    angle: float
    speed: float
    simulated: float
    duty: float


def list_leftover(evidence: Sequence[TakeEvidence], residuals: Residuals, floors: Residuals) -> tuple[Unexplained, ...]:
    """Channels beyond noise, numerics and spread, each with its worst event, the largest first. residuals, floors: over sigma."""
    out = []
    for u in list_unexplained(evidence, residuals, floors):
        if not isinstance(u.description, Dependence):
            out.append(u)
            continue
        name = u.description.take
        i = next(k for k, e in enumerate(evidence) if e.name == name)
        joint = u.where[0] if u.where else ""
        event = _worst(evidence[i], residuals[i], joint) if joint in evidence[i].joints else None
        out.append(u if event is None else replace(u, description=replace(u.description, worst=_describe(event))))
    return tuple(sorted(out, key=lambda u: -u.error))


def _worst(e: TakeEvidence, residual: Array, joint: str) -> _Event | None:
    """The event with the largest error: a stretch as long as EVENT."""
    k = e.channels.index(joint)
    r = residual[:, k] * e.sigma[k]
    n = max(1, round(EVENT / e.frame_time))
    power = np.convolve(np.nan_to_num(np.square(r)), np.ones(n) / n, mode="valid")
    if not len(power):
        return None
    at = slice(int(np.argmax(power)), int(np.argmax(power)) + n)
    time, q = e.take.recorded.time, e.recorded[:, k]
    speed, modelled = np.gradient(q, time), np.gradient(q - r, time)
    register = e.take.recording.channels.get(f"duty.{joint}")
    duty = np.full(len(time), np.nan) if register is None else np.interp(time, e.take.recording.time, register)
    middle = [_middle(x[at]) for x in (q, np.abs(speed), np.abs(modelled), duty)]
    return _Event(float(time[at][0]), float(np.sqrt(np.mean(np.square(np.nan_to_num(r[at]))))), *middle)


def _middle(x: Array) -> float:
    """Median of the values that were seen, NaN where there are none."""
    seen = x[np.isfinite(x)]
    return float(np.median(seen)) if len(seen) else float("nan")


def _describe(event: _Event) -> str:
    """For a person."""
    error, _ = in_file_units(event.error, "")
    angle, _ = in_file_units(event.angle, "")
    duty = f" at duty {event.duty:.2f}" if np.isfinite(event.duty) else ""
    if np.isfinite(event.duty) and abs(event.duty) > FULL:
        duty = " under full duty"
    if event.speed < STANDS <= event.simulated:
        what = f"sticks at {angle:.0f} deg{duty}, where the model moves on"
    elif event.simulated < STANDS <= event.speed:
        what = f"moves through {angle:.0f} deg{duty}, where the model sticks"
    elif event.speed < STANDS:
        what = f"rests elsewhere, at {angle:.0f} deg{duty}"
    else:
        what = f"moves otherwise about {angle:.0f} deg{duty}"
    return f"worst from {event.begin:.1f} s, {error:.1f} deg: {what}"
