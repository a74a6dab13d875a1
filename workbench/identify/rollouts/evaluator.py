"""Rollouts of models on every take, in batches and remembered, and the chi squared of their residuals."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path

import joblib
import numpy as np
from numpy.typing import NDArray

from workbench.compare.channels import joint_of
from workbench.effects.registry import known_effects
from workbench.identify.options import PROBLEM
from workbench.identify.problem import TakeEvidence, channel_gaps
from workbench.identify.rollouts.captured import Rollout, channels_stream
from workbench.identify.rollouts.key import ModelKeys, take_key
from workbench.identify.rollouts.memory import RolloutMemory
from workbench.identify.rollouts.servo_logs import frames, is_log, log_angles, most_together
from workbench.identify.rollouts.windows import recorded_states
from workbench.recording.take import Take
from workbench.robot import EffectSpec, RobotModel
from workbench.simulation import SimulationConfig
from workbench.simulation.batch import Job, simulate_batch
from workbench.simulation.cluster import in_blocks, on_cluster
from workbench.types import Array


@dataclass(frozen=True)
class RolloutRequest:
    """A model on some takes (indices). step: in search steps; coarse ones are good for differences alone. until: how long after
    the first command [s]; frames after that are NaN. horizon [s]: servo logs are put back to the recorded state so often."""

    model: RobotModel
    takes: tuple[int, ...]
    step: float = 1.0
    until: float = np.inf
    horizon: float = np.inf


class RolloutEvaluator:
    """Rolls models out on the session's takes and evaluates the residuals. memory: cached rollouts, which count those of every
    evaluator that shares them, or a folder in which every rollout is kept, so that a killed run resumes; results are the same
    with and without."""

    def __init__(self, evidence: Sequence[TakeEvidence], config: SimulationConfig, n_jobs: int = 2,
                 memory: Path | RolloutMemory | None = None) -> None:
        self.evidence = tuple(evidence)
        self.config = config
        self.n_jobs = n_jobs
        self.memory = memory if isinstance(memory, RolloutMemory) else RolloutMemory(memory, PROBLEM.remembered << 20)
        self._take_keys: dict[int, str] = {}
        self._state_keys: dict[tuple[int, float], str] = {}
        self._model_keys = ModelKeys()

    def residuals(self, questions: Sequence[RolloutRequest], corrected: bool = True) -> list[dict[int, Array]]:
        """For each question, residuals (N, c) by take; NaN where a take is not looked at. corrected: for the search's step."""
        answers: dict[str, Array] = {}
        keys: list[dict[int, str]] = []
        new: dict[str, tuple[RolloutRequest, int, RobotModel]] = {}
        for q in questions:
            felt = {i: self._felt(q.model, i) for i in q.takes}
            keys.append({i: self._key(model, i, q) for i, model in felt.items()})
            for i, key in keys[-1].items():
                if key in answers or key in new:
                    continue
                if not self._until(i, q):
                    answers[key] = np.full_like(self.evidence[i].recorded, np.nan)
                elif not self._recall(key, i, q, answers):
                    new[key] = (q, i, felt[i])
        # the longest first, so that no core waits at the end
        order = sorted(new, key=lambda key: -self._length(new[key][1], self._until(new[key][1], new[key][0])) / new[key][0].step)
        rollouts = [self._rollout(*new[key]) for key in order]
        for key, channels in zip(order, channels_stream(rollouts, self.n_jobs)):
            q, i, _ = new[key]
            seen = np.where(self.evidence[i].since[:, None] <= self._until(i, q), channels, np.nan)
            kept = seen.astype(np.float32)  # there are a thousand; noise is a ten thousandth
            self.memory.keep(key, kept)
            answers[key] = kept.astype(float)
        return [{i: self.evidence[i].residual(answers[key], q.model, corrected and q.step >= 1) for i, key in by_take.items()}
                for q, by_take in zip(questions, keys)]

    def _rollout(self, q: RolloutRequest, take: int, felt: RobotModel) -> Rollout:
        config = replace(self.config, time_step=self.config.time_step * q.step)
        return Rollout(self.evidence[take], q.model, self.job(felt, take, config, self._until(take, q)))

    def uncorrected(self, questions: Sequence[RolloutRequest]) -> list[dict[int, Array]]:
        """`residuals` without the correction for the error of their step. Servo logs are not shifted, as their start is known,
        and come straight from the compiled station where it knows their physics."""
        if self.config.engine == "drake" or not all(is_log(self.evidence[i]) for q in questions for i in q.takes):
            return self.residuals(questions, corrected=False)
        answers: dict[str, Array] = {}
        keys, missing, seen = [], [], set[str]()
        for q in questions:
            keys.append({i: f"log-{self._key(self._felt(q.model, i), i, q)}{self._windows_key(i, q.horizon)}" for i in q.takes})
            new = {i: k for i, k in keys[-1].items()
                   if k not in answers and k not in seen and not self._recall(k, i, q, answers)}
            seen |= set(new.values())
            missing.append(new)
        asked = [(q, new) for q, new in zip(questions, missing) if new]
        for (_, new), angles in zip(asked, self._in_threads(asked)):
            for key, q_servo in zip(new.values(), angles or ()):
                self.memory.keep(key, q_servo)
                answers[key] = q_servo
        covered = [set(by_take.values()) <= set(answers) for by_take in keys]
        others = iter(self.residuals([q for q, here in zip(questions, covered) if not here], corrected=False))
        return [{i: self._log_residual(i, answers[key]) for i, key in by_take.items()} if here else next(others)
                for by_take, here in zip(keys, covered)]

    def _in_threads(self, asked: Sequence[tuple[RolloutRequest, Mapping[int, str]]]) -> Iterator[list[Array] | None]:
        """Angles of logs, by question, a block of them as soon as those before it are there."""
        wanted, rolled = [(q, tuple(takes)) for q, takes in asked], partial(log_angles, self.evidence, self.config)
        size = max(1, min(most_together(self.evidence, self.config, wanted), -(-len(wanted) // self.n_jobs)))
        blocks = (wanted[k:k + size] for k in range(0, len(wanted), size))
        if self.n_jobs == 1 or len(wanted) < 2:
            yield from chain.from_iterable(map(rolled, blocks))
            return
        if on_cluster():
            yield from in_blocks(rolled, wanted, self.n_jobs)
            return
        with ThreadPoolExecutor(self.n_jobs) as pool:  # kernels hold no lock
            try:
                yield from chain.from_iterable(pool.map(rolled, blocks))
            finally:
                pool.shutdown(cancel_futures=True)

    def _log_residual(self, i: int, angles: Array) -> Array:
        """Residuals of a log's angles (M, c) at its `frames`."""
        e = self.evidence[i]
        simulated = np.full(e.recorded.shape, np.nan)
        simulated[frames(e)] = angles
        return np.asarray((e.recorded - simulated) / (e.sigma * e.rough))

    def on(self, evidence: Sequence[TakeEvidence]) -> RolloutEvaluator:
        """The evaluator on other takes of the same robot, or on these with another observation; both share their rollouts."""
        return RolloutEvaluator(evidence, self.config, self.n_jobs, self.memory)

    @property
    def seconds(self) -> float:
        """A rollout of every take is this much work."""
        return sum(self._length(i) for i in range(len(self.evidence)))

    def any_floating(self, takes: Sequence[int]) -> bool:
        """Whether the base is free in any of these takes."""
        return any(self.evidence[i].take.spec.base == "free" for i in takes)

    def observe(self, model: RobotModel, config: SimulationConfig) -> list[Take]:
        """All takes as a model left to itself would show them, in another configuration (a finer step), seen like recordings."""
        everywhere = range(len(self.evidence))
        rollouts = simulate_batch([replace(self.job(model, i, config), steadied=None) for i in everywhere], self.n_jobs)
        return [self.evidence[i].take.observe(r, model) for i, r in zip(everywhere, rollouts)]

    def job(self, model: RobotModel, take: int, config: SimulationConfig, until: float = np.inf) -> Job:
        """The job of one rollout, with the take's own servo changes."""
        e = self.evidence[take]
        spec = e.take.spec
        frames = e.since
        times = np.concatenate([[-PROBLEM.rest, -PROBLEM.rest / 2, -1e-3], frames[(frames >= 0) & (frames <= until)]])
        duration = float(times[-1]) + 2e-3
        return Job(spec.robot(model), replace(config, base=spec.base), e.take.commands, duration, PROBLEM.rest,
                   name=spec.name, times=times, start=e.take.start_state(), steadied=e.steadied)

    def vector(self, residuals: dict[int, Array], use: str, joint: str | None = None) -> Array:
        """Residuals of one use as one vector, weighted, gaps as zeros: comparable between models. joint: its channels alone."""
        parts = [np.empty(0)]
        for i, r in sorted(residuals.items()):
            e = self.evidence[i]
            columns = e.columns(joint)
            parts.append(np.nan_to_num(r[e.uses[use]][:, columns] * np.sqrt(e.weight[columns])).ravel())
        return np.concatenate(parts)

    def cost(self, residuals: dict[int, Array], use: str, joint: str | None = None) -> float:
        """Chi squared: the sum of squares of `vector`."""
        left = self.vector(residuals, use, joint)
        return float(left @ left)

    def beyond(self, residuals: dict[int, Array], use: str, before: dict[int, Array], share: Array, everywhere: bool) -> float:
        """Chi squared beyond the expectation of a correct model, of the channels that have a gap, and beyond this share of their
        reduction since `before`. everywhere: for floating-base takes beyond noise alone, since errors of steps and contact models
        are rarely as large as allowed, and for every channel, since effects on the robot's motion appear a little in each."""
        cost, expected = self.by_channel(residuals, use)
        may_err = share * np.maximum(self.by_channel(before, use)[0] - cost, 0.0)
        widths = [r.shape[1] for _, r in sorted(residuals.items())]
        walking = np.repeat([everywhere and self.any_floating((i,)) for i in sorted(residuals)], widths)
        noisy = np.concatenate([np.broadcast_to(self.evidence[i].noisy, n) for i, n in zip(sorted(residuals), widths)])
        ill = walking | (cost > self._without_gap(residuals, cost, expected))
        return float(np.sum(np.maximum(cost - expected * np.where(walking, noisy, 1.0) - may_err, 0.0)[ill]))

    def share_closed(self, before: dict[int, Array], after: dict[int, Array], joint: str | None = None,
                     without: Collection[str] = ()) -> float:
        """Share of `before`'s gaps on the choosing stretches that is closed in `after`, in the channels that had one, so that
        good channels hide nothing. without: joints whose channels do not count."""
        cost, expected = self.by_channel(before, "choose", joint)
        left, _ = self.by_channel(after, "choose", joint)
        most = self._without_gap(before, cost, expected, joint)
        names = [self.evidence[i].channels[k] for i in sorted(before) for k in self.evidence[i].columns(joint)]
        ill = (cost > most) & ~np.isin([joint_of(c) for c in names], list(without))
        return float(np.sum((cost - np.maximum(left, most))[ill]) / max(1.0, float(np.sum((cost - most)[ill]))))

    def stretches(self, takes: Sequence[int], joint: str | None = None) -> NDArray[np.int_]:
        """For each number of the fitted `vector`, which stretch of which take it is of."""
        parts = [np.empty(0, dtype=int)]
        for i in sorted(takes):
            e = self.evidence[i]
            stretch = i * PROBLEM.most_stretches + np.floor(e.since[e.uses["fit"]] / PROBLEM.block).astype(int)
            parts.append(np.repeat(stretch, len(e.columns(joint))))
        return np.concatenate(parts)

    def expected_cost(self, takes: Sequence[int], use: str) -> float:
        """The sum of squares of `vector` that noise, numerics and contact models make."""
        frames = (np.isfinite(self.evidence[i].recorded[self.evidence[i].uses[use]]).sum(axis=0) for i in takes)
        return float(sum(np.sum(n * self.evidence[i].weight) for i, n in zip(takes, frames)))

    def by_channel(self, residuals: dict[int, Array], use: str, joint: str | None = None) -> tuple[Array, Array]:
        """Chi squared of each channel of each take, and its expectation."""
        cost, expected = [np.empty(0)], [np.empty(0)]
        for i, r in sorted(residuals.items()):
            e = self.evidence[i]
            columns = e.columns(joint)
            rows = r[e.uses[use]][:, columns]
            cost.append(np.nansum(np.square(rows), axis=0) * e.weight[columns])
            expected.append(np.isfinite(rows).sum(axis=0) * e.weight[columns])
        return np.concatenate(cost), np.concatenate(expected)

    def _without_gap(self, residuals: dict[int, Array], cost: Array, expected: Array, joint: str | None = None) -> Array:
        """What chi squared of each channel, in the order of `by_channel`, may be without a gap: of a robot on a fixed base no
        more than expected, where running means alone show one."""
        most = PROBLEM.gap_ratio**2 * expected
        slight = [np.empty(0, dtype=bool)]
        for i, r in sorted(residuals.items()):
            e = self.evidence[i]
            gaps = channel_gaps(e, r) if e.take.spec.base == "fixed" else {}
            slight.append(np.array([e.channels[c] in gaps for c in e.columns(joint)], dtype=bool))
        return np.where(np.concatenate(slight) & (cost <= most), expected, most)

    def _length(self, take: int, until: float = np.inf) -> float:
        """Cost of a rollout [s of a puppy's rollout], a walk counting more as it takes longer, few joints less."""
        e = self.evidence[take]
        share = (len(e.joints) + PROBLEM.station_joints) / (PROBLEM.puppy_joints + PROBLEM.station_joints)
        return min(until, float(e.take.recorded.time[-1])) * (1.5 if e.take.spec.base == "free" else 1.0) * share

    def _felt(self, model: RobotModel, take: int) -> RobotModel:
        """The model as this take can tell it: where the base is fixed, no floor and no mass of the base is felt."""
        if self.evidence[take].take.spec.base != "fixed":
            return model
        felt = tuple(e for e in model.effects if not _of_the_floor(e) and e.where != (model.base,))
        return model if len(felt) == len(model.effects) else model.with_effects(felt)

    def _key(self, felt: RobotModel, take: int, q: RolloutRequest) -> str:
        if take not in self._take_keys:
            self._take_keys[take] = take_key(self.evidence[take], replace(self.config, base=self.evidence[take].take.spec.base))
        until = self._until(take, q)
        late = "" if np.isinf(until) else f"-until{until:.6g}"
        return f"{self._model_keys.of(felt)}-{self._take_keys[take]}-{q.step:g}{late}"

    def _windows_key(self, take: int, horizon: float) -> str:
        """Key of a log's windows: when and in which recorded states they begin; empty where it is rolled out whole."""
        if np.isinf(horizon):
            return ""
        if (take, horizon) not in self._state_keys:
            states = recorded_states(self.evidence[take].take, horizon)
            self._state_keys[take, horizon] = str(joblib.hash((states.times, states.q, states.v)))
        return f"-every{horizon:.6g}-{self._state_keys[take, horizon]}"

    def _until(self, take: int, q: RolloutRequest) -> float:
        """How long a question looks at a take [s]."""
        return min(q.until, self.evidence[take].until)

    def _recall(self, key: str, take: int, q: RolloutRequest, answers: dict[str, Array]) -> bool:
        """Counts a rollout; whether it is known, from this run or from one before: then it is among the answers."""
        self.memory.request(key, self._length(take, self._until(take, q)) / q.step)
        known = self.memory.get(key)
        if known is not None:
            answers[key] = known.astype(float)
        return known is not None


def take_of(stretches: NDArray[np.int_]) -> NDArray[np.int_]:
    """Take of each entry of `RolloutEvaluator.stretches`."""
    return stretches // PROBLEM.most_stretches


def _of_the_floor(e: EffectSpec) -> bool:
    effect = known_effects().get(e.effect)
    return effect is not None and not effect.observable_when_fixed
