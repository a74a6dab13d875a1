"""The contract's effects on the rig, many parameter sets and logs at a time: for screening and fitting, where the station would
take minutes a fit. On the gains left out its errors are within 1 to 3 % of the station's (Drake), from which comes what the study
states of its final models.

The nominal rig is the published M1; steps are semi-implicit, dry friction is the torque that would stop the joint within the
step, cut at what there is of it. Goals are held from row to row of the log, as the station holds them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from studies.xl330.bam import Logs
from studies.xl330.rig import ARM, JOINT
from workbench.effects.base import Parameter
from workbench.effects.registry import effect_named
from workbench.robot import GRAVITY, EffectSpec

Array = NDArray[np.float64]
STEP = 4e-3
LOAD_SMOOTHING = 2e-3
"""As in the servo bank (workbench/servo/term_bank.py) [s]."""
EFFECTS: dict[str, tuple[tuple[str, ...], dict[str, float]]] = {
    "zero_offset": ((JOINT,), {"angle": 1.0}),
    "load_friction": ((JOINT,), {"coefficient": 0.2}),
    "supply_voltage": ((), {"voltage": 7.8}),
    "supply_sag": ((), {"drop": 1.0}),
    "viscous_friction": ((JOINT,), {"coefficient": 0.002}),
    "coulomb_friction": ((JOINT,), {"torque": 0.005}),
    "stribeck_friction": ((JOINT,), {"torque": 0.01, "speed": 10.0}),
    "torque_ceiling": ((JOINT,), {"torque": 0.55}),
    "servo_gain": ((JOINT,), {"ratio": 1.05}),
    "dead_band": ((JOINT,), {"margin": 0.3}),
    "reflected_inertia": ((JOINT,), {"inertia": 2e-4}),
    "command_delay": ((), {"delay": 0.002}),
    "thermal_fade": ((), {"rate": 0.01}),
    "parallel_spring": ((JOINT,), {"stiffness": 0.02}),
    "payload": ((ARM,), {"mass": 0.02}),
}
"""What this rig could show, where, and the sizes from which fits start, in the contract's units. A payload sits with the mass, at
the arm's end."""


@dataclass(frozen=True)
class Knob:
    """One number of an effect. start: from which fits start; bounds and unit are the effect's."""

    effect: str
    parameter: Parameter
    start: float

    @property
    def name(self) -> str:
        return f"{self.effect}.{self.parameter.name}"


def knobs(effects: Sequence[str]) -> list[Knob]:
    """The numbers of some effects, in their order."""
    return [Knob(e, next(p for p in effect_named(e).parameters if p.name == name), start)
            for e in effects for name, start in EFFECTS[e][1].items()]


def neutral(supply: float) -> dict[str, float]:
    """Numbers that are not 0 where their effect is absent; a speed only shapes its effect."""
    return {"supply_voltage.voltage": supply, "servo_gain.ratio": 1.0, "torque_ceiling.torque": 10.0,
            "stribeck_friction.speed": 10.0}


def specs(values: Mapping[str, float], length: float) -> tuple[EffectSpec, ...]:
    """Effects of a model from numbers by knob name, in the contract's units; length [m] of the arm."""
    out: dict[str, dict[str, float | tuple[float, float, float]]] = {}
    for name, value in values.items():
        effect, _, parameter = name.partition(".")
        out.setdefault(effect, {})[parameter] = float(value)
    if "payload" in out:
        out["payload"]["position"] = (0.0, 0.0, -length)
    return tuple(EffectSpec(e, EFFECTS[e][0], parameters) for e, parameters in out.items())


def roll_out(logs: Logs, m1: Mapping[str, float], values: Mapping[str, Array | float], step: float = STEP) -> Array:
    """Angles (T, P, L) [rad] that the servo's own sensor tells, of P sets of numbers (by knob name, (P,) or one for all, in the
    contract's units) on L logs, from their first state on."""
    p, asked = _InSI(values), {name.partition(".")[0] for name in values}
    inertia_link = (logs.mass + p("payload.mass")) * logs.length**2
    inertia = inertia_link + m1["armature"] + p("reflected_inertia.inertia")
    weight = (logs.mass + p("payload.mass")) * GRAVITY * logs.length
    back_emf = m1["kt"] ** 2 / m1["R"]
    per_volt = m1["kt"] / m1["R"]
    supply = p("supply_voltage.voltage", logs.supply)
    viscous = m1["friction_viscous"] + p("viscous_friction.coefficient")
    coulomb = m1["friction_base"] + p("coulomb_friction.torque")
    stribeck, fading = p("stribeck_friction.torque"), p("stribeck_friction.speed", 1.0)
    ceiling, rubbing = p("torque_ceiling.torque", np.inf), p("load_friction.coefficient")
    gain, margin = logs.gain * p("servo_gain.ratio", 1.0), p("dead_band.margin")
    zero, drop, fade = p("zero_offset.angle"), p("supply_sag.drop"), p("thermal_fade.rate")
    spring = p("parallel_spring.stiffness")
    rows = p("command_delay.delay") / step
    shape = np.broadcast_shapes(inertia.shape, supply.shape, *(np.shape(p(name)) for name in values), (1, len(logs.names)))
    q = np.broadcast_to(logs.position[0], shape).copy()
    v = np.broadcast_to(logs.speed, shape).copy()
    load = np.zeros(shape)
    goals, on = np.nan_to_num(logs.goal), logs.enabled.astype(float)
    column, share = np.arange(shape[1]), step / (step + LOAD_SMOOTHING)
    out = np.empty((len(goals), *shape))
    for n in range(len(goals)):
        out[n] = q
        if np.any(rows):
            at = np.maximum(np.round(n - rows), 0).astype(int)
            goal, enabled = goals[at, column], on[at, column]
        else:
            goal, enabled = goals[n], on[n]
        error = goal - q
        size = np.maximum(np.abs(error) - margin, 0.0) * gain if "dead_band" in asked else np.abs(error) * gain
        size = np.minimum(size, 1.0)
        motor = np.copysign(size * per_volt * (supply - drop * size), error)
        if "thermal_fade" in asked:
            motor = motor * np.exp(-fade * n * step)
        motor = motor - back_emf * v
        if "torque_ceiling" in asked:
            motor = np.minimum(np.maximum(motor, -ceiling), ceiling)
        motor = motor * enabled
        external = -weight * np.sin(q + zero)
        if "parallel_spring" in asked:
            external = external - spring * (q + zero)
        budget = coulomb
        if "stribeck_friction" in asked:
            budget = budget + stribeck * np.exp(-np.square(v / fading))
        if "load_friction" in asked:
            budget = budget + rubbing * load
        net = motor + external - viscous * v
        acceleration = (net - np.minimum(np.maximum(inertia / step * v + net, -budget), budget)) / inertia
        v = v + acceleration * step
        q = q + v * step
        if "load_friction" in asked:
            load = load + share * (np.abs(external - inertia_link * acceleration) - load)
    return out


class _InSI:
    """Numbers in SI as (P, 1), by knob name."""

    def __init__(self, values: Mapping[str, Array | float]) -> None:
        scale = {k.name: k.parameter.si for k in knobs(list(EFFECTS))}
        self._values = {name: scale[name] * np.atleast_1d(np.asarray(v, dtype=float))[:, None] for name, v in values.items()}

    def __call__(self, name: str, neutral: float = 0.0) -> Array:
        return cast(Array, self._values.get(name, np.array([[neutral]])))
