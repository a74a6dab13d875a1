"""A robot of the other engine with a hidden effect, filmed motion by motion; and how well a name fits the recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import yaml
from scipy.optimize import minimize_scalar

from studies.concealed_effects.robots import quadruped
from studies.other_engine.excitation import MotionRows
from studies.other_engine.make_session import TakePlan, random_camera, record, servo_yaml, session_entry
from studies.other_engine.motive_file import write_motive_csv
from workbench.compare.comparison import noise_of
from workbench.compare.session import Session, load_session
from workbench.compare.session_takes import RegisteredTake, read_takes, register_takes
from workbench.experiment.design import ObservationModel
from workbench.experiment.projection import PairChannels, recording_unknowns
from workbench.motion import Motion
from workbench.recording.take import Take
from workbench.robot import EffectSpec, RobotModel
from workbench.simulation import SimulationConfig
from workbench.simulation.batch import Job, simulate_batch
from workbench.types import Array

FLOOR = float(np.deg2rad(0.05))
"""By which two engines differ anyway [rad]."""
TOGETHER = 6.0
"""Frames with correlated errors."""
REST = 0.1


@dataclass
class Hidden:
    """A quadruped of the other engine with an effect, before one camera. folder: of its session, which grows take by take."""

    folder: Path
    effect: EffectSpec
    seed: int
    takes: list[dict[str, object]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        robot = quadruped(self.rng)
        self.folder.mkdir(parents=True, exist_ok=True)
        (self.folder / "robot.sdf").unlink(missing_ok=True)
        self.model = robot.model(self.folder / "robot.sdf")
        self.camera = random_camera(self.rng)

    def film(self, name: str, motion: Motion, base: str) -> Session:
        """Plays a motion and records it as one more take; returns the session, which reveals nothing of the hidden effect."""
        rows = MotionRows(motion.joints, motion.times, np.rad2deg(motion.angles))
        _, capture, _ = record(self.model.with_effect(self.effect), TakePlan(name, rows, 1, base), self.camera, self.rng)
        (self.folder / f"{name}.motion.csv").write_text(rows.to_csv(), encoding="utf-8")
        write_motive_csv(self.folder / f"{name}.csv", capture, name)
        (self.folder / "servo.yaml").write_text(servo_yaml(self.model), encoding="utf-8")
        self.takes.append({"name": name, "motion": f"{name}.motion.csv", "recording": f"{name}.csv", "base": base})
        content = session_entry(self.model, "robot.sdf", "servo.yaml") | {"takes": self.takes}
        (self.folder / "session.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        return load_session(self.folder / "session.yaml")


@dataclass(frozen=True)
class Fitted:
    """A name with its best parameter. cost: chi squared, frames with correlated errors counted once; observed: by take."""

    effect: EffectSpec
    cost: float
    observed: tuple[Take, ...]

    @property
    def value(self) -> float:
        (value,) = self.effect.parameters.values()
        assert not isinstance(value, tuple)
        return value


class Jury:
    """All takes of a session, and how well models fit them."""

    def __init__(self, session: Session, n_jobs: int = 2) -> None:
        self.n_jobs = n_jobs
        self.nominal = session.model
        read, left = read_takes(session)
        assert not left, left
        rest = [Job(t.model, self._config(t.spec.base), t.commands, t.duration, 0.3) for t in read]
        rollouts = dict(zip([t.spec.name for t in read], simulate_batch(rest, n_jobs)))
        self.takes, left = register_takes(session, read, rollouts)
        assert not left, left
        noise = noise_of([t.recorded for t in self.takes]).joints
        self.sight = ObservationModel({j: float(np.hypot(s, FLOOR)) for j, s in noise.items()}, captured=True, rate=120.0)

    def fit(self, name: str, where: tuple[str, ...], parameter: str, values: Sequence[float]) -> Fitted:
        """The number, between the first and the last of `values`, at which an effect fits all takes best: on a grid, then between
        the neighbours of its best point (Brent's method, in the logarithm)."""
        def at(v: float) -> EffectSpec:
            return EffectSpec(name, where, {parameter: float(v)})

        grid = self._weighed([at(v) for v in values])
        k = min(range(len(grid)), key=lambda i: grid[i].cost)
        known = [grid[k]]

        def cost(x: float) -> float:
            known.extend(self._weighed([at(np.exp(x))]))
            return known[-1].cost

        minimize_scalar(cost, bounds=(np.log(values[max(k - 1, 0)]), np.log(values[min(k + 1, len(grid) - 1)])), method="bounded",
                        options={"xatol": 0.01, "maxiter": 8})
        return min(known, key=lambda f: f.cost)

    def _weighed(self, effects: Sequence[EffectSpec]) -> list[Fitted]:
        models = [self.nominal.with_effect(e) for e in effects]
        jobs = [self._job(m, t) for m in models for t in self.takes]
        played = iter(simulate_batch(jobs, self.n_jobs))
        out = []
        for e, m in zip(effects, models):
            observed = tuple(t.observe(next(played), m) for t in self.takes)
            out.append(Fitted(e, sum(self._cost(t, o) for t, o in zip(self.takes, observed)), observed))
        return out

    def _cost(self, take: RegisteredTake, observed: Take) -> float:
        joints = list(self.sight.sigma)
        sigma = np.array(list(self.sight.sigma.values()))
        moving = ~take.recorded.resting
        recorded, simulated = (t.q[moving][:, [t.column(j) for j in joints]] / sigma for t in (take.recorded, observed))
        open_ = recording_unknowns(np.nan_to_num(simulated), self.sight)
        known = np.isfinite(recorded) & np.isfinite(simulated)
        weight = known.ravel() / np.sqrt(TOGETHER)

        def flat(y: Array) -> Array:
            return np.asarray(weight * np.nan_to_num(y).ravel())

        none = np.zeros((known.size, 0))
        return PairChannels(flat(recorded), flat(simulated), none, none, np.stack([flat(c) for c in open_], axis=1),
                            np.zeros(known.size, dtype=int), weight, np.ones(known.size)).closest("b").cost

    def _job(self, model: RobotModel, t: RegisteredTake) -> Job:
        frames = t.recorded.since_start
        times = np.concatenate([[-REST, -REST / 2, -1e-3], frames[frames >= 0]])
        return Job(model, self._config(t.spec.base), t.commands, float(frames[-1]) + 0.02, REST, times=times)

    def _config(self, base: str) -> SimulationConfig:
        return replace(SimulationConfig(settle=0.6, contact_period=0), time_step=2e-3, base=base)
