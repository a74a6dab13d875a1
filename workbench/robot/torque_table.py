"""A repeatable torque of a servo for which there is no named effect, as a table (docs/formats.md, section 4)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

from workbench.files import InputError
from workbench.physical import SERVO

DependsOn = Literal["angle", "angle and direction", "duty", "duty and direction", "speed"]
"""The argument of the torque. With direction: the torque changes sign with the motion, smoothly through rest."""
UNITS: Mapping[DependsOn, str] = {
    "angle": "deg", "angle and direction": "deg", "duty": "1", "duty and direction": "1", "speed": "deg/s"}
"""Units of the values at which the torque is given."""
MOST_KNOTS = 200
"""Most rows of one table; a torque that needs more is not a smooth function."""


@dataclass(frozen=True)
class TorqueTable:
    """A torque at the joint, linear between knots and constant beyond the ends.

    depends_on: the joint's angle, its speed, or the servo's duty (-1 to 1; with direction, the size of the duty). at (K,):
    increasing, in UNITS; torque (K,) [N m]. InputError names the expected value.
    """

    depends_on: DependsOn
    at: tuple[float, ...]
    torque: tuple[float, ...]

    def __post_init__(self) -> None:
        if self.depends_on not in get_args(DependsOn):
            expected = ", ".join(f"'{name}'" for name in get_args(DependsOn))
            raise InputError(None, f"depends_on: expected {expected}, got {self.depends_on!r}")
        if not len(self.at) == len(self.torque) or not 2 <= len(self.at) <= MOST_KNOTS:
            raise InputError(None, f"at and torque: expected equally many numbers, 2 to {MOST_KNOTS}, "
                                   f"got {len(self.at)} and {len(self.torque)}")
        for name in ("at", "torque"):
            for value in getattr(self, name):
                if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
                    raise InputError(None, f"{name}: expected finite numbers, got {value!r}")
        for value in self.torque:
            if (text := SERVO["stall_torque"].problem(max(abs(value), 1e-9))) is not None:
                raise InputError(None, f"torque: {text}")
        if any(b <= a for a, b in zip(self.at, self.at[1:])):
            raise InputError(None, "at: expected increasing numbers")

    @property
    def scale(self) -> float:
        """Factor that converts `at` to SI."""
        return 1.0 if UNITS[self.depends_on] == "1" else math.radians(1.0)

    def as_dict(self) -> dict[str, Any]:
        """Content of servo.yaml."""
        return {"depends_on": self.depends_on, "at": [float(x) for x in self.at], "torque": [float(x) for x in self.torque]}


def torque_tables(content: Any) -> tuple[TorqueTable, ...]:
    """The value of the key `torque_tables` of servo.yaml; InputError names the expected value."""
    if not isinstance(content, Sequence) or isinstance(content, str):
        raise InputError(None, f"torque_tables: expected a list of tables, got {content!r}")
    out = []
    for i, table in enumerate(content):
        at = f"torque_tables[{i}]"
        if isinstance(table, TorqueTable):
            out.append(table)
            continue
        if not isinstance(table, Mapping) or set(table) != {"depends_on", "at", "torque"}:
            raise InputError(None, f"{at}: expected the keys depends_on, at and torque")
        if not all(isinstance(table[key], Sequence) and not isinstance(table[key], str) for key in ("at", "torque")):
            raise InputError(None, f"{at}: at, torque: expected lists of numbers")
        try:
            out.append(TorqueTable(table["depends_on"], tuple(table["at"]), tuple(table["torque"])))
        except InputError as e:
            raise InputError(None, f"{at}: {e}") from None
    return tuple(out)
