"""Where and when takes leave the model, in which phase and which layer, before anything is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.compare.channels import ACROSS, BODY, joint_of
from workbench.compare.footfalls import foot_phases
from workbench.effects.base import Layer
from workbench.identify.options import PROBLEM
from workbench.identify.problem import TakeEvidence, channel_gaps, in_file_units, ratios, running_means
from workbench.identify.results.findings import GapEntry
from workbench.types import Array, Mask


def ledger(evidence: Sequence[TakeEvidence], residuals: Mapping[int, Array]) -> tuple[GapEntry, ...]:
    """The entries, the largest first.

    A joint is booked in the layer that its residual points to: timing where it correlates with a lag that grows, or that most
    joints share; structure where it lies across the servo's axis; ground where it has no gap on a fixed base; else actuator. The
    body is booked where no joint explains it: as inertia where it leans or sinks, as ground where it moves or turns another way.
    """
    ill = {i: channel_gaps(e, residuals[i]) for i, e in enumerate(evidence)}
    fixed = [i for i, e in enumerate(evidence) if e.take.spec.base == "fixed"]
    ill_when_fixed = {joint_of(c) for i in fixed for c in ill[i]}
    rows: list[tuple[float, GapEntry]] = []
    for i, e in enumerate(evidence):
        joints = {c: s for c, s in ill[i].items() if c not in BODY}
        worst = max(joints.values(), default=0.0)
        late = _late(e, residuals[i], [c for c in joints if ACROSS not in c])
        phases = _phases(e) if joints else _Phases(("", ""), {})
        for c, size in ill[i].items():
            if c in BODY and worst > size:
                continue
            only_on_the_ground = bool(fixed) and i not in fixed and joint_of(c) not in ill_when_fixed
            if c not in BODY and only_on_the_ground and size < PROBLEM.follows * worst:
                continue
            column = e.channels.index(c)
            floor, unit = in_file_units(float(e.sigma[column]), c)
            raw = ratios(e, residuals[i])[c]
            layer = layer_of(c, c in late, only_on_the_ground)
            rows.append((size, GapEntry(layer=layer, where=() if c in BODY else (joint_of(c),), take=e.name,
                                        when=_when(e, residuals[i][:, column]), error=raw * floor, floor=floor, unit=unit,
                                        phase=_phase(phases, residuals[i][:, column], joint_of(c)))))
    return tuple(entry for _, entry in sorted(rows, key=lambda row: -row[0]))


def layer_of(channel: str, late: bool, only_on_the_ground: bool) -> Layer:
    """The layer of a channel's gap. late: a lag that most joints share; only_on_the_ground: the joint is well while the base is
    fixed."""
    if channel in BODY:
        return "inertia" if channel in ("height", "roll", "pitch") else "ground"
    if ACROSS in channel:
        return "structure"
    if late:
        return "timing"
    return "ground" if only_on_the_ground else "actuator"


def _late(e: TakeEvidence, residual: Array, joints: Sequence[str]) -> set[str]:
    """Joints whose residual is mostly a lag, where most joints with a gap share it: commands sent late, not wrong motion."""
    time = e.take.recorded.since_start
    mostly = set()
    for c in joints:
        i = e.channels.index(c)
        slope = np.gradient(e.recorded[:, i], e.take.recorded.time) / e.sigma[i]
        good = np.isfinite(residual[:, i]) & np.isfinite(slope)
        r = residual[good, i]
        lag = np.column_stack([slope[good], slope[good] * time[good]])
        size = np.linalg.lstsq(lag, r, rcond=None)[0]
        if len(r) and float(np.sum((r - lag @ size) ** 2)) < 0.35 * float(r @ r):
            mostly.add(c)
    return mostly if len(mostly) > 0.6 * len(joints) else set()


def _when(e: TakeEvidence, residual: Array) -> tuple[tuple[float, float], ...]:
    """Stretches [s] of the recording's clock in which the residual's running mean is beyond three sigma; the five longest, in
    order."""
    t = e.take.recorded.time
    n = round(PROBLEM.smoothing / e.frame_time)
    mean = running_means(residual[:, None], n)[:, 0]
    power = np.convolve(np.nan_to_num(np.square(mean)), np.ones(3 * n) / (3 * n), mode="same")
    inside = np.concatenate([[False], power > 9.0, [False]])
    edges = np.flatnonzero(np.diff(inside.astype(int)))
    stretches = [(float(t[a]), float(t[b - 1])) for a, b in zip(edges[::2], edges[1::2])]
    return tuple(sorted(sorted(stretches, key=lambda s: s[0] - s[1])[:5]))


@dataclass(frozen=True)
class _Phases:
    """Two phases of a take. names: of both; of: by joint, frames in the first phase, and frames whose phase is known."""

    names: tuple[str, str]
    of: Mapping[str, tuple[Mask, Mask]]


def _phases(e: TakeEvidence) -> _Phases:
    """Stance or swing of each joint's leg on the ground, moving or holding on a fixed base."""
    if e.take.spec.base == "free":
        feet = {joint: _foot_of(e, joint) for joint in e.joints}
        seen = foot_phases(e.take.recorded, e.take.model) if any(feet.values()) else {}
        return _Phases(("stance", "swing"), {j: (seen[f].stance, seen[f].known) for j, f in feet.items() if f in seen})
    commands, names = e.take.commands, ("moving", "holding")
    if commands is None:
        return _Phases(names, {})
    steps = np.abs(np.diff(commands.reference(e.take.recorded.since_start), axis=0, prepend=0))
    moving = np.asarray(steps.max(axis=1) > 1e-6)
    return _Phases(names, dict.fromkeys(e.joints, (moving, np.ones(len(moving), dtype=bool))))


def _phase(phases: _Phases, residual: Array, joint: str) -> str:
    """The phase in which a joint's error is at least twice as large; empty where both are similar."""
    if joint not in phases.of:
        return ""
    first, known = phases.of[joint]
    good = np.isfinite(residual) & known
    power = [float(np.mean(np.square(residual[m & good]))) if (m & good).any() else 0.0 for m in (first, ~first)]
    return phases.names[0] if power[0] > 2 * power[1] else phases.names[1] if power[1] > 2 * power[0] else ""


def _foot_of(e: TakeEvidence, joint: str) -> str:
    """The one foot that a joint carries, by its knee's joint; empty for joints that carry none or several."""
    k = e.take.model.kinematics
    feet = [foot for foot, link in e.take.model.foot_links.items() if joint in k.chain(link)]
    return feet[0] if len(feet) == 1 else ""
