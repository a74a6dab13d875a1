"""Speed of rollouts of one servo log for many models, as a fit makes them, against MuJoCo's."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.arm import ODD, SERVO, arm, goals
from benchmarks.figure import Figure, in_turns, median_and_quartiles
from workbench.identify.options import PROBLEM
from workbench.identify.rollouts.servo_logs import REST, SETTLE
from workbench.robot import RobotModel
from workbench.simulation import Job, SimulationConfig
from workbench.simulation.compiled import NotCoveredError
from workbench.simulation.compiled.angles import servo_angles
from workbench.types import Array

SHARED = ("of a held arm's servo log, each with other frictions of one joint; building the models and reading angles at the "
          "log's times are included")
NAMES = {"servo_log_rollouts_against_mujoco": ("mujoco", "alone", "this library's rollouts, one by one, over MuJoCo's"),
         "servo_log_lanes_against_mujoco": ("mujoco", "lanes", "this library's rollouts, in lanes, over MuJoCo's"),
         "servo_log_lanes_against_alone": ("alone", "lanes", "rollouts played together in lanes over the same one by one")}
"""Figures: the slower, the faster, and the meaning of their ratio."""


def servo_log_rollouts(duration: float, models: int, repeats: int, seed: int) -> list[Figure]:
    """Processor time. duration: of the log [s]; models: how many pairs of frictions."""
    meanings = {name: f"speed of {what}, {SHARED}" for name, (_, _, what) in NAMES.items()}
    try:
        from studies.other_engine.sysid import Identification
    except ImportError as e:
        why = f'MuJoCo\'s twin is in the source tree, its toolbox in "mujoco[sysid]" ({e})'
        return [Figure(name, meaning, skipped=why) for name, meaning in meanings.items()]
    with TemporaryDirectory() as place:
        model, log = arm(Path(place)), goals(duration)
        theirs = Identification(model, ODD, log.commands, PROBLEM.time_step)
        config = SimulationConfig(base="fixed", contact_period=0, time_step=PROBLEM.time_step, settle=SETTLE)
        draws = np.random.default_rng(seed).uniform(0.5, 2.0, (models, 2))
        frictions = [(float(a) * SERVO["coulomb_friction"], float(b) * SERVO["viscous_friction"]) for a, b in draws]
        commands = log.commands

        def ours(several: Sequence[tuple[float, float]], in_lanes: bool) -> list[Array]:
            played = servo_angles([[Job(_rubbing(model, *f), config, commands, duration + 2e-3, REST, times=log.time)]
                                   for f in several], in_lanes)
            return [angles[0] for angles in played if not isinstance(angles, NotCoveredError)]

        columns = [model.joints.index(j) for j in theirs.joints]
        few = frictions[:3]
        apart = max(float(np.abs(q[:, columns] - theirs.played(f, log.time)).max()) for f, q in zip(few, ours(few, True)))
        seconds = in_turns({"alone": lambda: [ours([f], False) for f in frictions], "lanes": lambda: ours(frictions, True),
                            "mujoco": lambda: [theirs.played(f, log.time) for f in frictions]}, repeats)
    details = {"log_seconds": duration, "step_seconds": PROBLEM.time_step, "models": models, "turns": repeats,
               "milliseconds_per_model": {n: float(np.median(s)) / models * 1e3 for n, s in seconds.items()},
               "rollouts_per_second": {n: models / float(np.median(s)) for n, s in seconds.items()},
               "largest_difference_deg": float(np.degrees(apart))}
    return [Figure(name, meanings[name], *median_and_quartiles(seconds[slow] / seconds[fast]), details=details)
            for name, (slow, fast, _) in NAMES.items()]


def _rubbing(model: RobotModel, coulomb: float, viscous: float) -> RobotModel:
    servos = {j: model.servo(j) for j in model.joints}
    servos[ODD] = servos[ODD].updated({"coulomb_friction": coulomb, "viscous_friction": viscous})
    return model.with_physics(servos, model.effects)
