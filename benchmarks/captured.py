"""Rollouts of captured takes read off the compiled log, against the same observed body by body (`observe`)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from benchmarks.figure import Figure, in_turns, median_and_quartiles
from workbench.compare.channels import channel_names, channels_of
from workbench.compare.session import TakeSpec
from workbench.compare.session_takes import RegisteredTake
from workbench.identify.problem import TakeEvidence
from workbench.identify.rollouts.captured import Rollout, seen_channels
from workbench.identify.rollouts.evaluator import RolloutEvaluator
from workbench.identify.shooting import base_states
from workbench.motion import load_motion
from workbench.recording import Measurement, observe
from workbench.recording.recording import Recording
from workbench.recording.take import Take
from workbench.robot import EffectSpec, RobotModel, data_file, puppy_model
from workbench.simulation import SimulationConfig
from workbench.simulation.batch import Job, run_job
from workbench.types import Array

CONFIG = SimulationConfig(settle=0.2, contact_period=0, time_step=2e-3)
STARTS_AT, UNTRACKED = 0.4137, ("head", "neck")
CASES = {"held": ("fixed", ()), "held_with_play": ("fixed", (EffectSpec("backlash", ("flm",), {"gap": 2.0}),)),
         "walking": ("free", ())}
"""Base and effects of the rollouts that are timed."""


def captured_against_observed(length: float, repeats: int) -> list[Figure]:
    """Processor time of a rollout's channels, the rollout included. length: of the take [s]."""
    takes = {base: captured_take(base, length) for base in ("fixed", "free")}
    return [_ratio(name, takes[base], puppy_model().with_effects(effects), length, repeats)
            for name, (base, effects) in CASES.items()]


def _ratio(name: str, e: TakeEvidence, model: RobotModel, length: float, repeats: int) -> Figure:
    rollout = rollout_of(e, model)

    def compiled() -> Array:
        channels = seen_channels(rollout)
        assert channels is not None
        return channels

    runs = {"observed": lambda: e.observe(run_job(rollout.job), model), "compiled": compiled}
    apart = float(np.nanmax(np.abs(runs["observed"]() - compiled())))
    seconds = in_turns(runs, repeats)
    value, quartiles = median_and_quartiles(seconds["observed"] / seconds["compiled"])
    meaning = ("speed of a rollout of a captured take, channels included, read off the log by compiled passes, over the same "
               f"observed body by body: {name.replace('_', ' ')}")
    return Figure(f"captured_rollouts_{name}", meaning, value, quartiles, details={
        "take_seconds": length, "turns": repeats, "largest_difference": apart,
        "milliseconds_per_rollout": {n: float(np.median(s)) * 1e3 for n, s in seconds.items()}})


def rollout_of(e: TakeEvidence, model: RobotModel, until: float = np.inf) -> Rollout:
    """A model on a take, until a time after the first command [s]."""
    config = replace(CONFIG, base=e.take.spec.base)
    return Rollout(e, model, RolloutEvaluator([e], CONFIG, n_jobs=1).job(model, 0, config, until))


def _of_joints(take: Take, joints: tuple[str, ...]) -> Take:
    columns = [take.column(j) for j in joints]
    assert take.off_axis is not None
    assert take.v is not None
    return replace(take, joints=joints, q=take.q[:, columns], v=take.v[:, columns], off_axis=take.off_axis[:, columns])


def captured_take(base: Literal["free", "fixed"], length: float, without: tuple[str, ...] = ()) -> TakeEvidence:
    """A take of the puppy's walk of so many seconds, as its own simulation shows it to cameras that stand askew. Joints that no
    camera sees are left out; they are kept where further bodies are not tracked (`without`, assets)."""
    model = puppy_model()
    walk = load_motion(data_file("robotis_walk.csv"), model).commands(max(1, math.ceil(length)))
    rng = np.random.default_rng(3)
    assets = [a for a in model.rigid_bodies if a not in without]
    measurement = Measurement(STARTS_AT, yaw=0.3, origin=np.array([0.5, -0.2, 0.1]),
                              pivots={a: rng.normal(0.0, 0.02, 3) for a in assets})
    take = run_job(Job(model, replace(CONFIG, base=base), walk, length, 0.3))
    recorded = replace(observe(take, measurement, model, np.arange(0.0, STARTS_AT + length - 0.05, 1 / 120))[0], commands=walk)
    if not without:
        recorded = _of_joints(recorded, tuple(j for j in model.joints if j not in UNTRACKED))
    unused = Recording("walk", "motive", "", recorded.time, np.arange(len(recorded)), 120.0, sensing="mocap")
    spec = TakeSpec("walk", recording=data_file("robotis_walk.csv"), base=base)
    registered = RegisteredTake(spec, model, unused, walk, measurement, recorded)
    names = channel_names(registered)
    nothing, one = np.zeros((len(recorded), len(names))), np.ones(len(names))
    assert base == "fixed" or base_states(recorded) is not None
    return TakeEvidence(registered, names, channels_of(recorded, names), one, nothing,
                        dict.fromkeys(("fit", "choose", "validate"), recorded.time > STARTS_AT), one, True, nothing,
                        steadied=base_states(recorded))
