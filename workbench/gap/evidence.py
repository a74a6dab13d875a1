"""What the recordings say about a model: residuals over noise, on stretches for fitting, choosing and validating.

Takes are simulated whole, from rest. Joint angles enter frame by frame. Of the body, height and tilt enter as they are, path and
heading as what they gain in a quarter of a second: walking is chaotic over seconds, not over fractions of one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from workbench.gap.compare_session import Rollouts
from workbench.gap.comparison import noise_of
from workbench.gap.metrics import rms
from workbench.gap.registered import RegisteredTake
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig
from workbench.simulation.batch import Job, simulate_batch

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
GAIN_SPAN = 0.25
"""Span over which path and heading are compared [s]."""
BLOCK = 0.4
"""Length of a stretch [s]; of four in a row two are fitted, one decides, one validates."""
USES = ("fit", "choose", "fit", "validate")
REST = 0.1
"""Rest before the first command in rollouts [s]."""
BODY = ("forward", "left", "heading", "height", "roll", "pitch")
LEAST_BODY_SIGMA = np.array([1e-3, 1e-3, 0.01, 5e-4, 0.004, 0.004])
"""Below this no contact model is believed: [m, m, rad, m, rad, rad]."""


@dataclass(frozen=True)
class TakeEvidence:
    """One registered take: recorded channels (N, c), their sigma (c,), and which frames serve for what.

    Channels are the take's joints, then BODY on the ground. sigma: measurement noise, the numerical floor and, on the ground, the
    spread between contact models together.
    """

    take: RegisteredTake
    channels: tuple[str, ...]
    recorded: Array
    sigma: Array
    uses: Mapping[str, Mask]
    weight: Array

    @property
    def name(self) -> str:
        return self.take.spec.name

    def residual(self, rollout: Take, model: RobotModel) -> Array:
        """Recorded less simulated, over sigma (N, c); NaN where unseen or before the first command."""
        return (self.recorded - channels_of(self.take.observed(rollout, model), self.take.recorded.joints)) / self.sigma


def channels_of(take: Take, joints: tuple[str, ...]) -> Array:
    """Joint angles and, of a free take, body channels (N, n [+ 6]) of an observed take."""
    q = take.q[:, [take.column(j) for j in joints]]
    return np.hstack([q, body_channels(take)]) if take.base == "free" else q


def body_channels(take: Take) -> Array:
    """Gains in path (in the heading's frame) and heading over GAIN_SPAN, height, roll and pitch: (N, 6) [m, rad]."""
    assert take.p_WB is not None
    assert take.quat_WB is not None
    n = len(take)
    out = np.full((n, 6), np.nan)
    good = np.isfinite(take.quat_WB).all(axis=1) & np.isfinite(take.p_WB).all(axis=1)
    if not good.any():
        return out
    angles = np.full((n, 3), np.nan)
    angles[good] = Rotation.from_quat(take.quat_WB[good], scalar_first=True).as_euler("ZYX")
    angles[good, 0] = np.unwrap(angles[good, 0])
    step = max(1, round(GAIN_SPAN / float(np.median(np.diff(take.time)))))
    gain = np.full((n, 3), np.nan)
    gain[:-step, :2] = take.p_WB[step:, :2] - take.p_WB[:-step, :2]
    gain[:-step, 2] = angles[step:, 0] - angles[:-step, 0]
    c, s = np.cos(angles[:, 0]), np.sin(angles[:, 0])
    out[:, 0] = c * gain[:, 0] + s * gain[:, 1]
    out[:, 1] = -s * gain[:, 0] + c * gain[:, 1]
    out[:, 2] = gain[:, 2]
    out[:, 3] = take.p_WB[:, 2] - np.nanmean(take.p_WB[take.resting, 2]) if take.resting.any() else take.p_WB[:, 2]
    out[:, 4], out[:, 5] = angles[:, 2], angles[:, 1]
    return out


def gather(takes: Sequence[RegisteredTake], rollouts: Mapping[str, Rollouts]) -> list[TakeEvidence]:
    """The evidence of registered takes; rollouts: of the nominal model, with floors, by take name."""
    known = noise_of([t.recorded for t in takes])
    alone = not any(t.spec.use == "validate" for t in takes)
    out = []
    for t in takes:
        joints = t.recorded.joints
        free = t.recorded.base == "free"
        recorded = channels_of(t.recorded, joints)
        nominal = channels_of(t.observed(rollouts[t.spec.name].nominal), joints)
        moving = t.recorded.time >= t.measurement.starts_at
        floor = _apart(nominal, [channels_of(t.observed(r), joints) for r in rollouts[t.spec.name].finer], moving)
        spread = _apart(nominal, [channels_of(t.observed(r), joints) for r in rollouts[t.spec.name].other_contact], moving)
        noise = np.array([known.joints[j] for j in joints])
        if free:
            resting = recorded[t.recorded.resting][:, len(joints):]
            noise = np.concatenate([noise, rms(resting - np.nanmean(resting, axis=0))])
        sigma = np.sqrt(np.nan_to_num(noise) ** 2 + floor**2 + spread**2)
        if free:
            sigma[len(joints):] = np.maximum(sigma[len(joints):], LEAST_BODY_SIGMA)
        weight = np.ones(recorded.shape[1])
        if free:  # neighbouring frames of the body tell nearly the same
            weight[len(joints):] = 1.0 / max(1.0, GAIN_SPAN / float(np.median(np.diff(t.recorded.time))))
        out.append(TakeEvidence(t, (*joints, *(BODY if free else ())), np.where(moving[:, None], recorded, np.nan), sigma,
                                _uses(t, moving, alone), weight))
    return out


def _uses(t: RegisteredTake, moving: Mask, alone: bool) -> dict[str, Mask]:
    block = np.floor((t.recorded.time - t.measurement.starts_at) / BLOCK).astype(int)
    role = np.array(USES)[np.mod(block, len(USES))]
    if t.spec.use == "validate":
        role[:] = "validate"
    elif not alone:
        role = np.where(role == "validate", "fit", role)
    return {use: moving & (role == use) for use in ("fit", "choose", "validate")}


def _apart(nominal: Array, others: Sequence[Array], use: Mask) -> Array:
    if not others:
        return np.zeros(nominal.shape[1])
    return np.max([np.nan_to_num(rms((o - nominal)[use])) for o in others], axis=0)


class Jury:
    """Rolls models out on every take, over both cores, and weighs what they leave."""

    def __init__(self, evidence: Sequence[TakeEvidence], config: SimulationConfig, n_jobs: int = 2) -> None:
        self.evidence = tuple(evidence)
        self.config = config
        self.n_jobs = n_jobs

    def residuals(self, models: Sequence[RobotModel], takes: Sequence[int] | None = None, time_step: float | None = None
                  ) -> list[list[Array]]:
        """For each model, residuals (N, c) of each take (indices `takes`; default all). Each take's own servo changes apply."""
        index = list(range(len(self.evidence))) if takes is None else list(takes)
        jobs = [self._job(model, self.evidence[i], time_step) for model in models for i in index]
        rollouts = iter(simulate_batch(jobs, self.n_jobs))
        return [[self.evidence[i].residual(next(rollouts), model) for i in index] for model in models]

    def observed(self, models: Sequence[RobotModel], take: int) -> list[Take]:
        """One take as each model would show it, observed like the recording."""
        e = self.evidence[take]
        rollouts = simulate_batch([self._job(m, e, None) for m in models], self.n_jobs)
        return [e.take.observed(r, m) for r, m in zip(rollouts, models)]

    def _job(self, model: RobotModel, e: TakeEvidence, time_step: float | None) -> Job:
        spec = e.take.spec
        own = replace(model.with_servos(spec.servos), effects=model.effects)
        config = replace(self.config, base=spec.base, time_step=time_step or self.config.time_step)
        frames = e.take.recorded.time - e.take.measurement.starts_at
        times = np.concatenate([[-REST, -REST / 2, -1e-3], frames[frames >= 0]])
        return Job(own, config, e.take.commands, float(frames[-1]) + 2e-3, REST, name=spec.name, times=times)

    def vector(self, residuals: Sequence[Array], use: str, takes: Sequence[int] | None = None) -> Array:
        """All residuals of one use as one vector, weighted, gaps left out as zeros: comparable between models."""
        of = [self.evidence[i] for i in (range(len(self.evidence)) if takes is None else takes)]
        return np.concatenate([np.nan_to_num(r[e.uses[use]] * np.sqrt(e.weight)).ravel() for e, r in zip(of, residuals)])
