"""Speed of rollouts of one servo log for many models, as a fit makes them, against MuJoCo's."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.arm import ODD, SERVO, arm, goals
from benchmarks.figure import Figure, in_turns, median_and_quartiles
from workbench.identify.options import PROBLEM
from workbench.identify.rollouts.servo_logs import REST, SETTLE
from workbench.robot import RobotModel
from workbench.simulation import Job, SimulationConfig
from workbench.simulation.compiled.angles import servo_angles
from workbench.types import Array

NAME = "servo_log_rollouts_against_mujoco"
MEANING = ("speed of this library's rollouts of a held arm's servo log over MuJoCo's, each with other frictions of one joint, at "
           "the same step; both include building the model and reading angles at the log's times")


def servo_log_rollouts_against_mujoco(duration: float, models: int, repeats: int, seed: int) -> Figure:
    """Processor time. duration: of the log [s]; models: how many pairs of frictions."""
    try:
        from studies.other_engine.sysid import Identification
    except ImportError as e:
        return Figure(NAME, MEANING, skipped=f'MuJoCo\'s twin is in the source tree, its toolbox in "mujoco[sysid]" ({e})')
    with TemporaryDirectory() as place:
        model, log = arm(Path(place)), goals(duration)
        theirs = Identification(model, ODD, log.commands, PROBLEM.time_step)
        config = SimulationConfig(base="fixed", contact_period=0, time_step=PROBLEM.time_step, settle=SETTLE)
        draws = np.random.default_rng(seed).uniform(0.5, 2.0, (models, 2))
        frictions = [(float(a) * SERVO["coulomb_friction"], float(b) * SERVO["viscous_friction"]) for a, b in draws]

        def ours(coulomb: float, viscous: float) -> Array:
            job = Job(_rubbing(model, coulomb, viscous), config, log.commands, duration + 2e-3, REST, times=log.time)
            (angles,) = servo_angles([job])
            return angles

        columns = [model.joints.index(j) for j in theirs.joints]
        apart = max(float(np.abs(ours(*f)[:, columns] - theirs.played(f, log.time)).max()) for f in frictions[:3])
        seconds = in_turns({"ours": lambda: [ours(*f) for f in frictions],
                            "mujoco": lambda: [theirs.played(f, log.time) for f in frictions]}, repeats)
    value, quartiles = median_and_quartiles(seconds["mujoco"] / seconds["ours"])
    return Figure(NAME, MEANING, value, quartiles, details={
        "log_seconds": duration, "step_seconds": PROBLEM.time_step, "models": models, "turns": repeats,
        "milliseconds_per_model": {n: float(np.median(s)) / models * 1e3 for n, s in seconds.items()},
        "largest_difference_deg": float(np.degrees(apart))})


def _rubbing(model: RobotModel, coulomb: float, viscous: float) -> RobotModel:
    servos = {j: model.servo(j) for j in model.joints}
    servos[ODD] = servos[ODD].updated({"coulomb_friction": coulomb, "viscous_friction": viscous})
    return model.with_physics(servos, model.effects)
