"""BAM's friction models M1, M3, M4 and M6 on the rig, many parameter sets and logs at a time (Rhoban/bam, bam/model.py and
simulate.py, Apache-2.0; Duclusaud & Passault, arXiv 2410.08650).

As there: logs brought to even times (linear between rows), a motor fed kp · error through its resistance and back-EMF, friction
as the torque that would stop the joint within the step, cut at the model's budget, and a semi-implicit step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from studies.xl330.rig import DUTY_PER_UNIT, Log
from workbench.types import Array

STEP = 5e-3
GRAVITY = 9.80665
BOUNDS = {
    "kt": (0.1, 3.0), "R": (2.0, 5.0), "armature": (1e-4, 0.05), "q_offset": (-0.1, 0.1), "friction_base": (0.0, 0.2),
    "friction_viscous": (0.0, 1.0), "friction_stribeck": (0.0, 0.2), "dtheta_stribeck": (0.1, 3.0), "alpha": (1.0, 10.0),
    "load_friction_base": (0.0, 0.5), "load_friction_stribeck": (0.0, 1.0), "load_friction_motor": (0.0, 0.5),
    "load_friction_external": (0.0, 0.5), "load_friction_motor_stribeck": (0.0, 1.0),
    "load_friction_external_stribeck": (0.0, 1.0), "load_friction_motor_quad": (0.0, 0.01),
    "load_friction_external_quad": (0.0, 0.01)}
"""Within which BAM searches (bam/model.py, bam/dynamixel/actuator.py)."""
_MOTOR = ("kt", "R", "armature", "q_offset", "friction_base", "friction_viscous")
_STRIBECK = ("friction_stribeck", "dtheta_stribeck", "alpha")
PARAMETERS = {
    "m1": _MOTOR, "m3": (*_MOTOR, "load_friction_base"),
    "m4": (*_MOTOR, *_STRIBECK, "load_friction_base", "load_friction_stribeck"),
    "m6": (*_MOTOR, *_STRIBECK, *(f"load_friction_{side}{kind}" for side in ("motor", "external")
                                  for kind in ("", "_stribeck", "_quad")))}


@dataclass(frozen=True)
class Logs:
    """Logs side by side at even times. goal, position (T, L) [rad], NaN after a log's end; enabled (T, L); speed (L,): of the
    first row [rad/s]; gain (L,): duty per radian; mass, length, supply of the one rig."""

    names: tuple[str, ...]
    gains: tuple[int, ...]
    goal: Array
    position: Array
    enabled: NDArray[np.bool_]
    speed: Array
    gain: Array
    mass: float
    length: float
    supply: float

    def at(self, gains: Sequence[int]) -> Logs:
        """Those at some gains."""
        keep = [i for i, g in enumerate(self.gains) if g in gains]
        return Logs(tuple(self.names[i] for i in keep), tuple(self.gains[i] for i in keep), self.goal[:, keep],
                    self.position[:, keep], self.enabled[:, keep], self.speed[keep], self.gain[keep], self.mass, self.length,
                    self.supply)


def even(logs: Sequence[Log], step: float = STEP, held: bool = False) -> Logs:
    """Brings logs to even times, linear between rows and from 0 on, as bam/process.py does; or `held`: from their first rows on,
    and goals as they stood in the row before."""
    recordings = [log.read() for log in logs]
    if held:
        recordings = [replace(r, time=r.time - r.time[0]) for r in recordings]
    times = np.arange(0.0, max(float(r.time[-1]) for r in recordings), step)

    def channel(name: str) -> Array:
        columns = []
        for r in recordings:
            values = next(c for n, c in r.channels.items() if n.startswith(name))
            if held and name != "position.":
                row = np.searchsorted(r.time, times + 1e-9, side="right") - 1
                columns.append(np.where(times <= r.time[-1], values[row], np.nan))
                continue
            first = values[0] + (values[1] - values[0]) * (times - r.time[0]) / (r.time[1] - r.time[0])  # as there
            columns.append(np.where(times < r.time[0], first, np.interp(times, r.time, values, right=np.nan)))
        return np.column_stack(columns)

    return Logs(tuple(log.name for log in logs), tuple(log.gain for log in logs), channel("goal."), channel("position."),
                channel("enabled.") > 0.5, channel("velocity.")[0], np.array([log.gain * DUTY_PER_UNIT for log in logs]),
                logs[0].mass, logs[0].length, logs[0].supply)


def roll_out(logs: Logs, model: str, parameters: Mapping[str, Array | float], step: float = STEP) -> Array:
    """Positions (T, P, L) [rad] of P parameter sets (values (P,) or one number for all) on L logs."""
    p = {name: np.atleast_1d(np.asarray(parameters[name], dtype=float))[:, None] for name in PARAMETERS[model]}
    inertia = logs.mass * logs.length**2 + p["armature"]
    weight = logs.mass * GRAVITY * logs.length
    torque_per_volt, back_emf = p["kt"] / p["R"], p["kt"] ** 2 / p["R"]
    shape = (max(len(v) for v in p.values()), len(logs.names))
    q = np.broadcast_to(logs.position[0], shape).copy()
    v = np.broadcast_to(logs.speed, shape).copy()
    goal = np.nan_to_num(logs.goal)
    out = np.empty((len(goal), *shape))
    for n in range(len(goal)):
        out[n] = q
        duty = np.clip((goal[n] - q) * logs.gain, -1.0, 1.0)
        external = -weight * np.sin(q + p["q_offset"])
        motor = (torque_per_volt * logs.supply * duty - back_emf * v) * logs.enabled[n]
        budget = friction(model, p, motor, external, v) + p["friction_viscous"] * np.abs(v)
        net = motor + external
        stop = inertia / step * v + net
        acceleration = (net - np.clip(stop, -budget, budget)) / inertia
        v = np.clip(v + acceleration * step, -100.0, 100.0)
        q = q + v * step + 0.5 * acceleration * step**2
    return out


def friction(model: str, p: Mapping[str, Array], motor: Array, external: Array, v: Array) -> Array:
    """The budget of dry friction [N m] (bam/model.py, compute_frictions)."""
    budget = p["friction_base"]
    if model == "m1":
        return budget
    if model == "m3":
        return cast(Array, budget + p["load_friction_base"] * np.abs(external - motor))
    still = np.exp(-(np.abs(v / p["dtheta_stribeck"]) ** p["alpha"]))
    budget = budget + still * p["friction_stribeck"]
    if model == "m4":
        return cast(Array, budget + (p["load_friction_base"] + still * p["load_friction_stribeck"]) * np.abs(external - motor))

    def load(kind: str) -> Array:
        return np.abs(external * p[f"load_friction_external{kind}"] - motor * p[f"load_friction_motor{kind}"])

    driving = np.abs(external) < np.abs(motor)
    squared = np.where(driving, p["load_friction_external_quad"] * external**2, p["load_friction_motor_quad"] * motor**2)
    opposed = (np.sign(external) != np.sign(motor)) & (np.abs(external) != np.abs(motor))
    return cast(Array, budget + load("") + still * (load("_stribeck") + opposed * squared))


def errors(logs: Logs, positions: Array) -> Array:
    """Mean absolute error (P, L) [rad] of positions (T, P, L)."""
    return cast(Array, np.nanmean(np.abs(positions - logs.position[:, None]), axis=0))
