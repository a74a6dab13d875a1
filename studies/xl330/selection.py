"""Which of the contract's effects some gains' logs ask for, one after the other; several training sets side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.xl330 import bam, effects
from studies.xl330.bam import Logs, errors
from studies.xl330.fitting import ITERATIONS, Number, Problem, fit_all

Array = NDArray[np.float64]
LEAST_SHARE = 0.04
"""Of the cost on the training logs, which an effect has to take away to enter."""
MOST = 7
WARM = 6
"""Iterations of a fit that starts from one effect less."""
TOGETHER = (("supply_voltage", "supply_sag"),)
"""Effects that may enter as one: a supply that sags is stronger than nominal while it idles, and either alone says little."""
SHORT = 1
"""Iterations of a fit that only has to tell which effect to add."""
Report = Callable[[str], None]


@dataclass(frozen=True)
class Model:
    """Effects fitted together. values: by knob name, in the contract's units; cost on the training logs."""

    effects: tuple[str, ...]
    values: Mapping[str, float]
    cost: float


def training(logs: Logs, validated: int | None) -> NDArray[np.bool_]:
    """The logs (L,) at other gains; all of them where none is validated."""
    return np.array(logs.gains) != validated


def fit_effects(problems: Sequence[tuple[Sequence[str], NDArray[np.bool_], Mapping[str, float]]], logs: Logs,
                m1: Mapping[str, float], iterations: int = ITERATIONS) -> list[Model]:
    """Fits sets of effects: (names, logs that are seen, values to start from where known)."""
    fits = fit_all([Problem(tuple(_number(k, start, logs.supply) for k in effects.knobs(names)), seen)
                    for names, seen, start in problems],
                   lambda values: effects.roll_out(logs, m1, values), logs.position, effects.neutral(logs.supply), iterations)
    return [Model(tuple(names), f.values, f.cost) for (names, _, _), f in zip(problems, fits)]


_SCALED = ("supply_voltage.voltage", "servo_gain.ratio")
"""Numbers of which a small share is felt."""


def _number(k: effects.Knob, start: Mapping[str, float], supply: float) -> Number:
    p = k.parameter
    size = abs(k.start - effects.neutral(supply).get(k.name, 0.0)) if k.name in _SCALED else 0.5 * k.start
    low = 1.0 if k.name == "stribeck_friction.speed" else p.low
    return Number(k.name, start.get(k.name, k.start), low, p.high, size)


def fit_published(model: str, published: Mapping[str, float], logs: Logs, seen: Sequence[NDArray[np.bool_]],
                  starts: int = 3) -> list[dict[str, float]]:
    """Parameters of one of BAM's friction models refitted to each of some sets of logs: from the published ones and from around
    them, the best by cost."""
    rng = np.random.default_rng(0)
    sizes = {n: max(0.1 * abs(published[n]), _LEAST.get(n, 0.05)) for n in bam.PARAMETERS[model]}
    problems = []
    for start in range(starts):
        shift = {n: (rng.normal(0.0, 1.0) if start else 0.0) * size for n, size in sizes.items()}
        numbers = tuple(Number(n, published[n] + shift[n], *bam.BOUNDS[n], size=size) for n, size in sizes.items())
        problems += [Problem(numbers, s) for s in seen]
    fits = fit_all(problems, lambda values: bam.roll_out(logs, model, values), logs.position, {})
    return [min(fits[i::len(seen)], key=lambda f: f.cost).values for i in range(len(seen))]


_LEAST = {"armature": 1e-4, "q_offset": 0.005, "friction_base": 0.002, "friction_viscous": 0.001, "friction_stribeck": 0.005,
          "kt": 0.02, "R": 0.2, "dtheta_stribeck": 0.2, "alpha": 0.3, "load_friction_motor_quad": 0.002,
          "load_friction_external_quad": 0.002}


def mean_errors(model: Model, logs: Logs, m1: Mapping[str, float]) -> Array:
    """Mean absolute error (L,) [rad] on logs."""
    return np.asarray(errors(logs, effects.roll_out(logs, m1, model.values))[0])


def _priced(m: Model) -> float:
    """Cost, raised by what each effect has to be worth."""
    return float(m.cost / (1 - LEAST_SHARE) ** len(m.effects))


def select(logs: Logs, m1: Mapping[str, float], validated: Sequence[int | None], report: Report = lambda what: None,
           most: int | None = None) -> list[list[Model]]:
    """For each gain left out, models of 0, 1, 2, … effects, at most `most` (MOST): each adds the one that leaves least on the
    other gains' logs, while that is worth LEAST_SHARE."""
    most = most or MOST
    seen = [training(logs, v) for v in validated]
    chains = [[m] for m in fit_effects([((), s, {}) for s in seen], logs, m1)]
    growing = set(range(len(chains)))
    while growing:
        problems, of = [], []
        for i in sorted(growing):
            current = chains[i][-1]
            for move in (*((name,) for name in effects.EFFECTS), *TOGETHER):
                if not set(move) & set(current.effects):
                    problems.append(((*current.effects, *move), seen[i], current.values))
                    of.append(i)
        report(f"effect {1 + min(len(chains[i][-1].effects) for i in growing)}")
        trials = fit_effects(problems, logs, m1, SHORT)
        ahead = {i: min((m for m, j in zip(trials, of) if j == i), key=_priced) for i in sorted(growing)}
        for i, best in zip(ahead, fit_effects([(m.effects, seen[i], m.values) for i, m in ahead.items()], logs, m1, WARM)):
            if _priced(best) > _priced(chains[i][-1]):
                growing.discard(i)
                continue
            chains[i].append(best)
            if len(best.effects) >= most:
                growing.discard(i)
    return chains
