"""Compares two takes: how far they differ, and how much of that is noise, numerics or the contact model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.compare import metrics
from workbench.compare.footfalls import foot_phases, force_phases
from workbench.compare.results import NAN, Channel, Comparison, Pair, TakeComparison
from workbench.files import InputError
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.types import Array, Mask

__all__ = ["Channel", "Comparison", "Noise", "Pair", "TakeComparison", "align", "compare_takes", "noise_of"]


def compare_takes(
    recorded: Take, simulated: Take, model: RobotModel, *, finer: Sequence[Take] = (), other_contact: Sequence[Take] = (),
    noise: Noise | None = None,
) -> TakeComparison:
    """Compares any two takes of one robot; the second is resampled onto the first one's clock if necessary.

    finer: `simulated` again with the step halved and quartered; other_contact: with the other contact model; both observed as
    `simulated` was. noise: of the capture, if known better than from this take's rest. InputError if the takes have no joint in
    common.
    """
    if not np.isfinite(recorded.starts_at):
        recorded = replace(recorded, starts_at=float(recorded.time[0]))
    if simulated.zeroed and not recorded.zeroed:
        recorded = _zero(recorded)
    joints = tuple(j for j in recorded.joints if j in simulated.joints)
    if not joints:
        raise InputError(recorded.name, f"no joint in common with '{simulated.name}'; expected takes of one robot")
    takes = _Takes(recorded, align(simulated, recorded), [align(t, recorded) for t in finer],
                   [align(t, recorded) for t in other_contact])
    noise = noise or noise_of([recorded])
    return TakeComparison(
        name=recorded.name, recorded=recorded, simulated=takes.simulated, joints=_joint_channels(takes, joints, noise),
        body=_body_channel(takes, noise), distance=takes.pair(lambda t: float(np.linalg.norm(_displacement(t)[:2]))),
        forward=takes.pair(lambda t: float(_displacement(t)[0])), heading=takes.pair(_heading_change), speed=takes.pair(_speed),
        smoothness=takes.pair(_smoothness),
        joint_smoothness={j: Pair(_joint_smoothness(recorded, j), _joint_smoothness(takes.simulated, j)) for j in joints},
        recorded_phases=foot_phases(recorded, model), simulated_phases=foot_phases(takes.simulated, model),
        force_phases=force_phases(takes.simulated),
    )


@dataclass(frozen=True)
class Noise:
    """RMS at rest before the first command: joints [rad], body (the base link's origin, all axes together) [m]."""

    joints: Mapping[str, float]
    body: float = NAN


def noise_of(takes: Sequence[Take]) -> Noise:
    """The noise of a capture from all its takes, each about its own rest. For logs it is at least the angles' stated standard
    deviation: logs need not begin at rest, and at rest an encoder's count does not change."""
    joints = {}
    for joint in dict.fromkeys(j for t in takes for j in t.joints):
        seen = [t for t in takes if joint in t.joints]
        joints[joint] = float(metrics.noise_at_rest([t.q[t.resting, t.column(joint)][:, None] for t in seen])[0])
        sigmas = [t.q_sigma[:, t.column(joint)] for t in seen if t.q_sigma is not None and not t.zeroed]
        if sigmas and np.isfinite(np.concatenate(sigmas)).any():
            joints[joint] = float(np.fmax(joints[joint], np.nanmedian(np.concatenate(sigmas))))
    paths = [t.p_WB[t.resting] for t in takes if t.p_WB is not None]
    return Noise(joints, float(np.linalg.norm(metrics.noise_at_rest(paths))) if paths else NAN)


def align(take: Take, reference: Take) -> Take:
    """`take` at the times of `reference`, both counted from their first commands, with zeros defined as in the reference.

    Without a known first command, time is counted from a take's first frame.
    """
    if reference.zeroed and not take.zeroed:
        take = _zero(take)
    if np.array_equal(take.time, reference.time) and take.starts_at == reference.starts_at:
        return take
    start, onto = (t.starts_at if np.isfinite(t.starts_at) else float(t.time[0]) for t in (take, reference))
    return replace(take.resampled(reference.time - onto + start), time=reference.time, starts_at=onto)


def _zero(take: Take) -> Take:
    """The angles at rest; for a take without a rest, the first ones seen."""
    take = take.zeroed_at_rest()
    if take.zeroed:
        return take
    seen = np.isfinite(take.q)
    first = take.q[seen.argmax(axis=0), np.arange(len(take.joints))]
    return replace(take, q=take.q - first, zeroed=True)


@dataclass(frozen=True)
class _Takes:
    """A recording, its rollout, and the rollouts that show how certain that one is; all on one clock."""

    recorded: Take
    simulated: Take
    finer: Sequence[Take]
    other: Sequence[Take]

    def pair(self, of: Callable[[Take], float]) -> Pair | None:
        """`of` applied to the base's motion in each take; None if one of them has no base pose."""
        if any(t.p_WB is None or t.quat_WB is None for t in (self.recorded, self.simulated, *self.finer, *self.other)):
            return None
        simulated = of(self.simulated)
        floor, spread = (max((abs(of(t) - simulated) for t in takes), default=NAN) for takes in (self.finer, self.other))
        return Pair(of(self.recorded), simulated, floor, spread)

    @property
    def use(self) -> Mask:
        """Frames after the first command."""
        return np.asarray(self.recorded.since_start >= 0)


def _joint_channels(takes: _Takes, joints: tuple[str, ...], known: Noise) -> dict[str, Channel]:
    def q(take: Take) -> Array:
        return take.q[:, [take.column(j) for j in joints]]

    def apart(others: Sequence[Take]) -> Array:
        rows = [metrics.rms_difference(q(t), b, takes.use) for t in others]
        return np.max(rows, axis=0) if rows else np.full(len(joints), NAN)

    a, b = q(takes.recorded), q(takes.simulated)
    noise = np.array([known.joints.get(j, NAN) for j in joints])
    rows = np.column_stack([
        metrics.rms_difference(a, b, takes.use), noise, apart(takes.finer), apart(takes.other),
        metrics.correlation(a, b, takes.use), metrics.lag(takes.recorded.time, a, b, takes.use, noise)])
    return {j: Channel(*map(float, row)) for j, row in zip(joints, rows)}


def _body_channel(takes: _Takes, known: Noise) -> Channel | None:
    a, b = _path(takes.recorded), _path(takes.simulated)
    if a is None or b is None:
        return None

    def apart(others: Sequence[Take]) -> float:
        paths = [p for p in map(_path, others) if p is not None]
        return max((metrics.rms_distance(p, b, takes.use) for p in paths), default=NAN)

    return Channel(metrics.rms_distance(a, b, takes.use), known.body, apart(takes.finer), apart(takes.other))


def _path(take: Take) -> Array | None:
    """Path of the base link's origin from where it rested before the first command, or was first seen (N, 3) [m]."""
    if take.p_WB is None:
        return None
    seen = np.isfinite(take.p_WB).all(axis=1)
    rest = take.resting & seen
    if not rest.any():
        rest = seen & (np.cumsum(seen) == 1)
    return take.p_WB - take.p_WB[rest].mean(axis=0) if rest.any() else None


def _displacement(take: Take) -> Array:
    assert take.p_WB is not None
    return metrics.displacement(take.p_WB, take.since_start)


def _heading_change(take: Take) -> float:
    assert take.quat_WB is not None
    return metrics.heading_change(take.quat_WB, take.since_start)


def _walking(take: Take) -> Mask:
    end = np.inf if take.commands is None else take.commands.end
    return np.asarray((take.since_start >= 0) & (take.since_start <= end))


def _speed(take: Take) -> float:
    """Straight-line distance in the plane over the duration of the commands [m/s]."""
    use = _walking(take)
    if not use.any():
        return NAN
    assert take.p_WB is not None
    upto = np.asarray(take.since_start <= take.since_start[use][-1])
    return float(np.linalg.norm(metrics.displacement(take.p_WB[upto], take.since_start[upto])[:2]) / take.since_start[use][-1])


def _smoothness(take: Take) -> float:
    assert take.p_WB is not None
    return metrics.smoothness(take.time[_walking(take)], metrics.speed(take.time, take.p_WB[:, :2])[_walking(take)])


def _joint_smoothness(take: Take, joint: str) -> float:
    speed = metrics.speed(take.time, take.q[:, take.column(joint)][:, None])
    return metrics.smoothness(take.time[_walking(take)], speed[_walking(take)])
