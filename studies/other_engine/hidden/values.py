"""Parameters of effects, from the contract's units to SI."""

from __future__ import annotations

import numpy as np

from workbench.robot import EffectSpec
from workbench.types import Array


def number(spec: EffectSpec, name: str) -> float:
    """A parameter as it stands; ValueError where it is missing or a vector."""
    value = spec.parameters.get(name)
    if value is None or isinstance(value, tuple):
        raise ValueError(f"{spec.effect}: expected a number '{name}', got {value!r}")
    return float(value)


def optional(spec: EffectSpec, name: str) -> float:
    """A number that may be left out, and is 0 then."""
    return number(spec, name) if name in spec.parameters else 0.0


def angle(spec: EffectSpec, name: str) -> float:
    """A parameter in degrees [rad]."""
    return float(np.deg2rad(number(spec, name)))


def vector(spec: EffectSpec, name: str) -> Array:
    """A parameter of three numbers (3,); ValueError where it is not."""
    value = spec.parameters.get(name)
    if not isinstance(value, tuple) or len(value) != 3:
        raise ValueError(f"{spec.effect}: expected three numbers '{name}', got {value!r}")
    return np.array(value, dtype=float)
