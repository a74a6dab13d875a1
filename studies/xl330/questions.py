"""What else would fit as well: each effect taken out, and exchanged for what it could be mistaken for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.xl330.bam import Logs
from studies.xl330.rig import Log
from studies.xl330.selection import Model, fit_effects, mean_errors, training

RIVALS = {"load_friction": ("coulomb_friction", "stribeck_friction"), "supply_sag": ("torque_ceiling", "thermal_fade"),
          "supply_voltage": ("servo_gain",), "zero_offset": ("parallel_spring",)}
"""What each could be mistaken for."""


@dataclass(frozen=True)
class RolloutRequest:
    """One change of a model and what it costs on the validated gain: mean absolute errors [rad] by gain, before and after."""

    taken: str
    given: str
    before: Mapping[int, float]
    after: Mapping[int, float]

    def verdict(self, gains: Sequence[int]) -> str:
        """Whether the recordings ask for what was taken: by a tenth of the error on each of these gains, unseen by its fit."""
        change = [self.after[g] / self.before[g] for g in gains]
        return "supported" if min(change) > 1.1 else "not wanted" if max(change) < 0.9 else "open"


def ask(models: Mapping[int, Model], logs: Logs, m1: Mapping[str, float]) -> list[RolloutRequest]:
    """Refits each model, by the gain that it did not see, without each of its effects, and with its rivals in its place."""
    changes = [(taken, given) for taken in dict.fromkeys(e for m in models.values() for e in m.effects)
               for given in ("", *RIVALS.get(taken, ()))]
    problems, of = [], []
    for taken, given in changes:
        for gain, m in models.items():
            names = tuple(n for n in dict.fromkeys(given if e == taken else e for e in m.effects) if n)
            problems.append((names, training(logs, gain), m.values))
            of.append((taken, given, gain))
    fits = dict(zip(of, fit_effects(problems, logs, m1)))

    def validated(m: Model, gain: int) -> float:
        return float(mean_errors(m, logs, m1)[np.array(logs.gains) == gain].mean())

    before = {g: validated(m, g) for g, m in models.items()}
    return [
        RolloutRequest(taken, given, before, {g: validated(fits[taken, given, g], g) for g in models}) for taken, given in changes
    ]


def full_duty(logs: Sequence[Log]) -> tuple[float, float, int]:
    """What the logs say of the supply [V]: median while the motor is idle, median while it stands at full duty, and rows of the
    latter."""
    idle: list[NDArray[np.float64]] = []
    full: list[NDArray[np.float64]] = []
    for log in logs:
        channels = {name.partition(".")[0]: c for name, c in log.read().channels.items()}
        duty = np.abs(channels["duty"])
        idle.append(channels["voltage"][duty < 0.02])
        full.append(channels["voltage"][(duty > 0.98) & (np.abs(channels["velocity"]) < 0.3)])
    return float(np.median(np.concatenate(idle))), float(np.median(np.concatenate(full))), sum(len(f) for f in full)
