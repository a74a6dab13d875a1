"""From recordings to evidence: takes with the model's rollouts, registered, walks cut into windows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.compare.channels import ACROSS, BODY, channel_names, channels_of
from workbench.compare.compare_session import Rollouts, roll_out, run_of
from workbench.compare.comparison import noise_of
from workbench.compare.metrics import rms
from workbench.compare.options import COMPARE
from workbench.compare.session import Session
from workbench.compare.session_takes import LeftOut, ReadTake, RegisteredTake, register_takes
from workbench.files import InputError
from workbench.identify.options import PROBLEM
from workbench.identify.problem import TakeEvidence, part_of, running_sum
from workbench.identify.shooting import base_states, unsettled_frames
from workbench.recording.servo_log.goal_stamps import STAMPS
from workbench.recording.take import Take
from workbench.simulation import SimulationConfig
from workbench.simulation.steady import BaseStates
from workbench.types import Array, Mask, Progress


@dataclass(frozen=True)
class Prepared:
    """Takes with a model's rollouts: evidence, by take the rollout of an unconstrained robot (of a log, at its rows alone), takes
    left out and why."""

    evidence: list[TakeEvidence]
    nominal: dict[str, Take]
    left_out: LeftOut


def prepare(session: Session, takes: Sequence[ReadTake], config: SimulationConfig, n_jobs: int, progress: Progress) -> Prepared:
    """Rolls out the session's model for each take, registers the takes against these rollouts, and resets the simulated base of
    floating-base takes to the recorded one at the beginning of each window."""
    def roll(these: Sequence[ReadTake], steadied: Mapping[str, BaseStates | None], floors: bool = True) -> dict[str, Rollouts]:
        runs = [run_of(t, steadied.get(t.spec.name)) for t in these]
        return {r.name: of for r, of in zip(runs, roll_out(runs, config, progress=progress, n_jobs=n_jobs, floors=floors))}

    rollouts = (roll([t for t in takes if t.spec.base != "free"], {})
                | roll([t for t in takes if t.spec.base == "free"], {}, floors=False))
    nominal = {name: r.nominal for name, r in rollouts.items()}
    registered, left_out = register_takes(session, takes, nominal, progress)
    walking = [t for t in registered if t.spec.base == "free"]
    steadied = {t.spec.name: base_states(t.recorded) for t in walking}
    rollouts |= roll(walking, steadied)  # fixed-base takes are judged by what they were registered with
    nominal |= {t.spec.name: t.observe(nominal[t.spec.name]) for t in registered if not t.recorded.zeroed}
    return Prepared(gather(registered, rollouts, steadied), nominal, left_out)


def check_duration(session: Session, evidence: Sequence[TakeEvidence]) -> None:
    """InputError where takes are so short that no conclusion could be drawn, whatever they show."""
    least = PROBLEM.block * len(PROBLEM.uses)
    longest = max(float(np.ptp(e.take.recorded.time[e.moving])) if e.moving.any() else 0.0 for e in evidence)
    if longest < least and not any(e.take.spec.use for e in evidence):
        raise InputError(session.path, f"nothing can be concluded: no take shows more than {longest:.1f} s after its first "
                                       f"command, but fitting, choosing and validating take {least:.1f} s")


def gather(takes: Sequence[RegisteredTake], rollouts: Mapping[str, Rollouts],
           steadied: Mapping[str, BaseStates | None] | None = None) -> list[TakeEvidence]:
    """The evidence of registered takes; rollouts: of the nominal model at the search's step, put back to `steadied`, with floors,
    by take name."""
    known = noise_of([t.recorded for t in takes])
    alone = not any(t.spec.use == "validate" for t in takes)
    return [_evidence(t, rollouts[t.spec.name], known.joints, alone, (steadied or {}).get(t.spec.name)) for t in takes]


def _evidence(t: RegisteredTake, r: Rollouts, noise_of_joints: Mapping[str, float], alone: bool, steadied: BaseStates | None
              ) -> TakeEvidence:
    names = channel_names(t)
    joints = t.recorded.joints
    recorded = channels_of(t.recorded, names)
    moving = t.recorded.time >= t.measurement.starts_at
    if steadied is not None:
        moving &= ~unsettled_frames(steadied, t.recorded.since_start)
    if t.start_state() is not None:
        moving &= t.recorded.since_start >= PROBLEM.forgets
    nominal = channels_of(t.observe(r.nominal), names)
    finer = [channels_of(t.observe(f), names) for f in r.finer]
    finest = finer[-1] if finer else nominal
    floor = _apart(finest, finer[:-1] or [nominal], moving)
    others = [channels_of(t.observe(o), names) for o in r.other_contact]
    spread = _apart(nominal, others, moving)
    noise = np.array([noise_of_joints.get(c, np.nan) if c in joints else np.nan for c in names])
    resting = recorded[t.recorded.resting]
    noise = np.where(np.isnan(noise), [t.measurement.noise.get(c, np.nan) for c in names], noise)
    if len(resting) > 5:  # a pose is a mean over rest, so that this is about zero
        own = rms(resting - np.nanmean(resting, axis=0))
        noise = np.where(np.isnan(noise), own, noise)
    across = [i for i, c in enumerate(names) if ACROSS in c]
    if across:  # one camera system sees all bodies alike
        noise[across] = np.nanmedian(noise[across])
    sigma = np.sqrt(np.nan_to_num(noise) ** 2 + floor**2 + spread**2 + _stamp_error(t, recorded, moving) ** 2)
    weight = np.ones(len(names))
    if BODY[0] in names:  # neighbouring frames of the body tell nearly the same
        body = [names.index(c) for c in BODY]
        sigma[body] = np.maximum(sigma[body], PROBLEM.least_body_sigma)
        weight[body] = 1.0 / max(1.0, COMPARE.gain_span / float(np.median(np.diff(t.recorded.time))))
    sigma = np.maximum(sigma, 1e-6)
    apart = [*(f - finest for f in (*finer[:-1], nominal)), *(o - nominal for o in others)]
    rough = _rough(sigma, noise, apart, t) if others else 1.0
    offset = np.nan_to_num(finest - nominal)
    contact = np.nan_to_num(others[0] - nominal) if others else np.zeros_like(nominal)
    return TakeEvidence(
        t, names, np.where(moving[:, None], recorded, np.nan), sigma, offset, _uses(t, moving, alone), weight,
        t.recorded.zeroed and t.spec.starts_at is None, contact, np.nan_to_num(noise) ** 2 / sigma**2, rough, steadied)


def _stamp_error(t: RegisteredTake, recorded: Array, moving: Mask) -> Array:
    """Standard deviation (c,) of each channel from goals that were sent at an unknown time within an interval: its RMS speed
    times the interval over sqrt(12)."""
    within = float(t.recording.metadata.get(STAMPS, 0.0))
    if not within:
        return np.zeros(recorded.shape[1])
    speed = np.gradient(recorded, t.recorded.time, axis=0)[moving]
    return np.asarray(np.nan_to_num(rms(speed)) * within / np.sqrt(12.0))


def _rough(sigma: Array, noise: Array, apart: Sequence[Array], t: RegisteredTake) -> Array:
    """Times sigma (c,), by frame (N, c): at least 1, and more where steps and contact models part within a block."""
    frames = max(1, round(PROBLEM.block / float(np.median(np.diff(t.recorded.time)))))
    worst = np.max(np.square(np.nan_to_num(np.array(apart))), axis=0)
    local = running_sum(worst, frames) / frames
    return np.maximum(np.sqrt(np.nan_to_num(noise) ** 2 + local) / sigma, 1.0)


def _uses(t: RegisteredTake, moving: Mask, alone: bool) -> dict[str, Mask]:
    since = t.recorded.since_start
    role = np.array(PROBLEM.uses)[np.mod(np.floor(since / PROBLEM.block).astype(int), len(PROBLEM.uses))]
    if t.spec.base == "fixed":
        role = np.where(role == "validate", role, np.where(part_of(since) == PROBLEM.deciding_part, "choose", "fit"))
    if t.spec.use == "validate":
        role[:] = "validate"
    elif not alone:
        role = np.where(role == "validate", "fit", role)
    return {use: moving & (role == use) for use in ("fit", "choose", "validate")}


def _apart(nominal: Array, others: Sequence[Array], use: Mask) -> Array:
    if not others:
        return np.zeros(nominal.shape[1])
    return np.asarray(np.max([np.nan_to_num(rms((o - nominal)[use])) for o in others], axis=0), dtype=float)
