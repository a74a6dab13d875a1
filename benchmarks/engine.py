"""Speed of the station over MuJoCo's, on the same robot and at equal joint error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.drives import LEAD, joint_error
from benchmarks.figure import Figure, in_turns, median_and_quartiles
from workbench.motion import Commands
from workbench.recording import Take
from workbench.robot import RobotModel
from workbench.simulation.config import SimulationConfig
from workbench.simulation.rollout import Simulation

STEPS = (2.5e-4, 5e-4, 1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 8e-3)
"""MuJoCo's time steps that are tried [s]."""


def station_against_mujoco(
    model: RobotModel, commands: Commands, duration: float, exact: Take, finest: float, step: float, repeats: int
) -> Figure:
    """Real-time factor of the station at `step` over that of MuJoCo at its fastest step whose joint error is no larger.

    The error of each engine is against its own rollout at the step `finest` (`exact` is the station's). The details break down
    the time of a step."""
    base = exact.base
    name = f"station_against_mujoco_{base}_base"
    meaning = f"real-time factor of the station over MuJoCo's at the same joint error, base {base}; both with the full servo law"
    try:
        from studies.other_engine.bench import NativePlayer, fastest_within, race
    except ImportError as e:
        return Figure(name, meaning, skipped=f"MuJoCo's robot is in the source tree and its development dependencies ({e})")
    config = SimulationConfig(time_step=step, base=base, contact_period=0.0)
    station = Simulation(model, config)
    servos = {j: replace(model.servo(j), coulomb_friction=0.0) for j in model.joints}
    frictionless = Simulation(replace(model, servos=servos), config)
    (error,) = joint_error([station.run(commands, duration, LEAD)], exact)
    try:
        races = race(model, commands, duration, base, [s for s in STEPS if s > finest], finest, repeats=1)
        best = fastest_within(races, error)
    except ValueError as e:
        return Figure(name, meaning, skipped=str(e))
    player = NativePlayer(model, commands, duration, base, best.timestep)
    seconds = in_turns({"station": lambda: station.run(commands, duration, LEAD), "mujoco": player.run,
                        "without_joint_friction": lambda: frictionless.run(commands, duration, LEAD)}, repeats)
    factors = {"station": (duration + LEAD) / seconds["station"], "mujoco": duration / seconds["mujoco"]}
    value, quartiles = median_and_quartiles(factors["station"] / factors["mujoco"])
    steps = {"station": (duration + LEAD) / step, "without_joint_friction": (duration + LEAD) / step, "mujoco": len(player.time)}
    each = {k: float(np.median(s)) / steps[k] * 1e6 for k, s in seconds.items()}
    friction = each["station"] - each["without_joint_friction"]
    limits = (f"a step of {1e3 * step:g} ms costs {each['station'] / each['mujoco']:.1f} times as much as MuJoCo's of "
              f"{1e3 * best.timestep:g} ms; of its {each['station']:.0f} us, {friction:.0f} us are for joint friction, a "
              "constraint of each joint in Drake's contact solver, the rest for dynamics, contact, servo and log")
    return Figure(name, meaning, value, quartiles,
                  details={"joint_error_deg": {"station": float(np.degrees(error)), "mujoco": float(np.degrees(best.error))},
                           "step_seconds": {"station": step, "mujoco": best.timestep}, "turns": repeats,
                           "real_time_factor": {k: float(np.median(f)) for k, f in factors.items()},
                           "microseconds_per_step": each, "limits": limits})
