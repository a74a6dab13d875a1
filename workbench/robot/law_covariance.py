"""Covariance of the numbers of a servo's law, as an earlier diagnosis estimated it and servo.yaml and model.yaml keep it, and the
motion of the recordings it comes from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import InputError
from workbench.physical import LEAST_KNOWN
from workbench.types import Array


@dataclass(frozen=True)
class MotionRange:
    """How fast a joint moved in some recordings: magnitudes that it exceeded for one percent of the time. speed [deg/s],
    acceleration [deg/s^2], duty (0 to 1) of the nominal law."""

    speed: float
    acceleration: float
    duty: float

    def within(self, other: MotionRange, margin: float) -> bool:
        """Whether no magnitude is more than `margin` times that of the other range."""
        return all(a <= margin * b for a, b in zip(astuple(self), astuple(other)))

    def joined(self, other: MotionRange) -> MotionRange:
        """The range of both."""
        return MotionRange(*map(max, astuple(self), astuple(other)))

    def __str__(self) -> str:
        return f"{self.speed:.0f} deg/s, {self.acceleration:.0f} deg/s^2 and {100 * self.duty:.0f} % duty"


@dataclass(frozen=True)
class LawCovariance:
    """names (n): keys of servo.yaml, "torque_at_full_duty", "back_emf" and "zero". rows (n, n): covariance of their natural
    logarithms, of "zero" in rad. observed: the motion of the recordings, beyond which nobody knows whether the law holds; None if
    it is not told. InputError if it is not a covariance."""

    names: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]
    observed: MotionRange | None = None

    def __post_init__(self) -> None:
        n = len(self.names)
        if len(set(self.names)) != n:
            raise InputError(None, "covariance: expected each name once")
        if len(self.rows) != n or any(len(row) != n for row in self.rows):
            raise InputError(None, f"covariance: expected {n} rows of {n} numbers, as there are {n} names")
        C = self.matrix
        scale = float(np.max(np.diag(C), initial=0.0))
        if not np.isfinite(C).all() or not np.allclose(C, C.T, atol=1e-9 * scale):
            raise InputError(None, "covariance: expected finite numbers, the same across the diagonal")
        if n and float(np.diag(C).max()) > LEAST_KNOWN**2:
            raise InputError(None, f"covariance: expected variances of at most {LEAST_KNOWN**2:g}, got {np.diag(C).max():g}")
        if n and float(np.linalg.eigvalsh(C)[0]) < -1e-9 * scale:
            raise InputError(None, "covariance: expected no negative variance in any direction")

    @property
    def matrix(self) -> Array:
        """The rows as an array (n, n)."""
        return np.array(self.rows, dtype=float).reshape(len(self.names), len(self.names))

    @classmethod
    def of(cls, names: Sequence[str], matrix: Array, observed: MotionRange | None = None) -> LawCovariance:
        """The covariance of an array (n, n)."""
        return cls(tuple(names), tuple(tuple(float(v) for v in row) for row in 0.5 * (matrix + matrix.T)), observed)

    def among(self, names: Sequence[str]) -> Array:
        """The covariance (n, n) of these numbers, zero where a name is not known."""
        at = {name: k for k, name in enumerate(self.names)}
        out, known = np.zeros((len(names), len(names))), [k for k, name in enumerate(names) if name in at]
        there = [at[names[k]] for k in known]
        out[np.ix_(known, known)] = self.matrix[np.ix_(there, there)]
        return out

    def as_dict(self) -> dict[str, Any]:
        """Content of the file."""
        seen = {} if self.observed is None else {"observed": asdict(self.observed)}
        return {"names": list(self.names), "rows": [list(row) for row in self.rows], **seen}


def law_covariance(content: Any, path: Path, at: str, known: Sequence[str]) -> LawCovariance:
    """Reads it from a file. at: its place there, for messages; known: possible names. InputError names file, place and the
    expected form."""
    if not isinstance(content, Mapping) or set(content) - {"observed"} != {"names", "rows"}:
        raise InputError(path, f"{at}expected {{names: [...], rows: [[...], ...]}}, with or without observed: {{...}}")
    names, rows = content["names"], content["rows"]
    if not isinstance(names, list) or any(name not in known for name in names):
        raise InputError(path, f"{at}names: expected a list of {', '.join(known)}")
    numbers = isinstance(rows, list) and all(isinstance(row, list) and all(
        isinstance(v, (int, float)) and not isinstance(v, bool) for v in row) for row in rows)
    if not numbers:
        raise InputError(path, f"{at}rows: expected lists of numbers")
    observed = _motion_range(content["observed"], path, f"{at}observed: ") if "observed" in content else None
    try:
        return LawCovariance(tuple(names), tuple(tuple(float(v) for v in row) for row in rows), observed)
    except InputError as e:
        raise InputError(path, f"{at}{e}") from None


def _motion_range(content: Any, path: Path, at: str) -> MotionRange:
    keys = [f.name for f in fields(MotionRange)]
    if not isinstance(content, Mapping) or set(content) != set(keys):
        raise InputError(path, f"{at}expected {{{', '.join(f'{key}: ...' for key in keys)}}}")
    for key, value in content.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not (math.isfinite(value) and value >= 0):
            raise InputError(path, f"{at}{key}: expected a non-negative number, got {value!r}")
    return MotionRange(**{key: float(content[key]) for key in keys})
