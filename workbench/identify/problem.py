"""The evidence of a take: recorded channels, their standard deviation, the split of frames, and which channels have a gap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.compare.channels import BODY, channels_of, joint_of
from workbench.compare.session_takes import RegisteredTake
from workbench.effects.base import si_values
from workbench.effects.registry import known_effects
from workbench.effects.schedules import LOOP
from workbench.identify.options import PROBLEM
from workbench.motion.commands import Commands
from workbench.recording.mocap.yaw import weighted_median
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation.steady import BaseStates
from workbench.types import Array, Mask


@dataclass(frozen=True)
class TakeEvidence:
    """One registered take: recorded channels (N, c), their sigma (c,), and which frames serve for what.

    Channels are the take's joints, what lies across their axes where bodies were tracked, then BODY on the ground. sigma:
    measurement noise, numerical floor and, on the ground, the spread between contact models together. offset (N, c): what
    the search's step is wrong by on the nominal robot, which is taken to be the same with effects. start_is_free: whether
    the first command's time was estimated, so that every model may shift it; else by no more than LOOP. contact (N, c): the
    nominal robot with the other contact model less that with this one. noisy (c,): share of sigma squared that is
    measurement noise, which alone every model leaves. rough (N, c): times sigma, where steps and contact models part by more
    than on the whole, as when a robot is about to tip over. steadied: where every model's base is put back to. until: how
    long after the first command models are asked about it [s]; 0: not at all.
    """

    take: RegisteredTake
    channels: tuple[str, ...]
    recorded: Array
    sigma: Array
    offset: Array
    uses: Mapping[str, Mask]
    weight: Array
    start_is_free: bool
    contact: Array
    noisy: Array | float = 1.0
    rough: Array | float = 1.0
    steadied: BaseStates | None = None
    until: float = np.inf

    @property
    def name(self) -> str:
        """Name of the take."""
        return self.take.spec.name

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints of the robot, in the model's order."""
        return self.take.recorded.joints

    @property
    def frame_time(self) -> float:
        """Between two frames [s]."""
        return float(np.median(np.diff(self.take.recorded.time)))

    @property
    def since(self) -> Array:
        """Time of each frame after the first command [s]."""
        return self.take.recorded.since_start

    @property
    def moving(self) -> Mask:
        """Frames after the first command."""
        return np.asarray(self.since >= 0.0)

    def looked_at(self, until: float) -> TakeEvidence:
        """The take and its commands cropped to the time until which models are simulated [s after the first command], with a
        margin for a shifted start, so that neither time nor memory grows with unused data."""
        frames = int(np.searchsorted(self.since, until + max(PROBLEM.late, LOOP), side="right")) + 1
        early = self.since[:frames] <= until
        rough = self.rough[:frames] if isinstance(self.rough, np.ndarray) and self.rough.ndim == 2 else self.rough
        early_uses = {use: mask[:frames] & early for use, mask in self.uses.items()}
        cropped = replace(self, recorded=self.recorded[:frames], offset=self.offset[:frames], contact=self.contact[:frames],
                          rough=rough, until=until, uses=early_uses)
        return replace(cropped, take=replace(self.take, recorded=self.take.recorded.first(frames))).played(self.take.commands)

    def played(self, commands: Commands | None) -> TakeEvidence:
        """The take played by other commands, of which those are kept that can come while models are asked about it."""
        if commands is not None and np.isfinite(self.until):
            commands = commands.until(PROBLEM.fastest * (self.until + max(PROBLEM.late, LOOP)))
        return replace(self, take=replace(self.take, commands=commands))

    def zero(self, joint: str) -> float:
        """Recorded zero of a joint's angle, on its servo's scale [rad]."""
        return float(self.take.measurement.rest_pose.get(joint, 0.0)) if self.take.recorded.zeroed else 0.0

    def columns(self, joint: str | None = None) -> NDArray[np.int_]:
        """Indices of one joint's channels; without a joint, of all."""
        return np.array([i for i, c in enumerate(self.channels) if joint is None or joint_of(c) == joint], dtype=int)

    def observe(self, rollout: Take, model: RobotModel) -> Array:
        """A rollout's channels (N, c) as this take would have shown them."""
        return channels_of(self.take.observe(rollout, model), self.channels)

    def residual(self, simulated: Array, model: RobotModel, corrected: bool = True) -> Array:
        """Recorded less simulated, over sigma (N, c); NaN where unseen or before the first command. model: that was simulated;
        corrected: for the search's step."""
        simulated = simulated + self.offset if corrected else simulated
        simulated = self._shift(self._lying_in_its_play(simulated, model))
        return np.asarray((self.recorded - simulated) / (self.sigma * self.rough))

    def _lying_in_its_play(self, simulated: Array, model: RobotModel) -> Array:
        """A link with play hangs free in it while the base is fixed: where it lay when the recording was zeroed no model knows,
        so that it is put where the frames that are not kept for validation want it, within the play."""
        if not self.take.recorded.zeroed or self.take.spec.base != "fixed":
            return simulated
        out, used = simulated.copy(), ~self.uses["validate"]
        for spec, effect in ((s, known_effects()[s.effect]) for s in model.effects):
            if not effect.free_play:
                continue
            play = si_values(effect, spec)[effect.free_play]
            for i in (i for joint in spec.where for i in self.columns(joint)):
                off = (self.recorded - simulated)[used, i]
                if np.isfinite(off).any():
                    out[:, i] += np.clip(np.nanmedian(off), -play, play)
        return out

    def _shift(self, simulated: Array) -> Array:
        """Shifted later by the median over the joints: a start that one bad joint cannot move."""
        time, late, n = self.take.recorded.time, 0.0, len(self.joints)
        used = ~self.uses["validate"]
        shifted = simulated[:, :n]
        for _ in range(PROBLEM.shifts):
            slope = np.gradient(shifted, time, axis=0) / self.sigma[:n]
            r = (self.recorded[:, :n] - shifted) / self.sigma[:n]
            good = np.isfinite(r) & np.isfinite(slope) & used[:, None]
            s, r = np.where(good, slope, 0.0), np.where(good, r, 0.0)
            sharpness = np.sum(s * s, axis=0)
            sharp = sharpness > 1.0
            if not sharp.any():
                break
            by_joint = -np.sum(s * r, axis=0)[sharp] / sharpness[sharp]
            most = PROBLEM.late if self.start_is_free else LOOP
            late = float(np.clip(late + weighted_median(by_joint, np.sqrt(sharpness[sharp])), -most, most))
            shifted = _later(simulated[:, :n], time, late)
        return simulated if late == 0.0 else np.where(np.isfinite(simulated), _later(simulated, time, late), np.nan)


def _later(columns: Array, time: Array, late: float) -> Array:
    """Columns (N, c) at `time` (N,), shifted later by `late` [s]."""
    return np.column_stack([np.interp(time - late, time, c) for c in columns.T])


def part_of(since: Array) -> NDArray[np.int_]:
    """Which of `ProblemOptions.parts` a frame of a fixed-base take is in, by its time after the first command [s]."""
    return np.mod(np.floor(since / PROBLEM.part).astype(int), PROBLEM.parts)


def running_sum(columns: Array, frames: int) -> Array:
    """Sum of each column (N, c) over `frames` around each frame; beyond the ends it counts as zero."""
    kernel = np.ones(max(1, frames))
    return np.column_stack([np.convolve(c, kernel, mode="same") for c in columns.T])


def running_means(residual: Array, frames: int) -> Array:
    """Running means of residuals (N, c) over `frames`, scaled to stay 1 where they are white noise of 1; NaN stays."""
    known = np.isfinite(residual)
    total, count = running_sum(np.where(known, residual, 0.0), frames), running_sum(known.astype(float), frames)
    return np.where(known, total / np.sqrt(np.maximum(count, 1.0)), np.nan)


def ratios(e: TakeEvidence, residual: Array, use: str | None = None, smooth: bool = False) -> dict[str, float]:
    """RMS of residual over sigma, by channel; on all frames after the first command, or those of one use. smooth: of running
    means, in which noise averages out."""
    if smooth:
        residual = running_means(residual, round(PROBLEM.smoothing / e.frame_time))
    rows = residual[e.moving] if use is None else residual[e.uses[use]]
    count = np.isfinite(rows).sum(axis=0)
    value = np.sqrt(np.nansum(np.square(rows), axis=0) / np.maximum(count, 1))
    return {c: float(value[i]) if count[i] else float("nan") for i, c in enumerate(e.channels)}


def channel_gaps(e: TakeEvidence, residual: Array) -> dict[str, float]:
    """Channels of a take that are beyond noise, with their RMS over sigma (or what their running means amount to)."""
    raw, smooth = ratios(e, residual), ratios(e, residual, smooth=True)
    # the body's frames overlap as it is
    size = {
        c: raw[c] if c in BODY else max(raw[c], smooth[c] * PROBLEM.gap_ratio / PROBLEM.gap_ratio_smoothed) for c in e.channels
    }
    return {c: s for c, s in size.items() if s > PROBLEM.gap_ratio}


def joint_error(evidence: Sequence[TakeEvidence], joints: Sequence[str], residuals: Mapping[int, Array], use: str) -> float:
    """RMS error [deg] of some joints over all takes' frames of one use; residuals: over sigma, by take."""
    parts = [np.square((residuals[i] * e.sigma)[e.uses[use]][:, [e.channels.index(j) for j in joints if j in e.channels]]).ravel()
             for i, e in enumerate(evidence)]
    return float(np.rad2deg(np.sqrt(np.nanmean(np.concatenate(parts)))))


def in_file_units(value: float, channel: str) -> tuple[float, str]:
    """A channel's value [m or rad] in the units of docs/formats.md."""
    return (value, "m") if channel in ("forward", "left", "height") else (float(np.rad2deg(value)), "deg")
