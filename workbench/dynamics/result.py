"""The result of inverse dynamics, and its table."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from workbench.dynamics.margins import ServoLoad
from workbench.files import InputError
from workbench.files.errors import in_words
from workbench.files.reading import read_text, write_whole
from workbench.recording.formats.numbers import number_columns
from workbench.types import Array

HEADER = "# workbench inverse dynamics, format 1"
_WRENCH = tuple(f"{kind}.{axis}" for kind in ("moment", "force") for axis in "xyz")
_UNITS = ("# s; deg, deg/s, deg/s^2; N m, N; forces and moments in the world's axes, x forward, y left, z up, moments about the "
          "base link's origin; speed_margin deg/s; .sigma: standard deviation from the measurement's noise")
_JOINT_COLUMNS = {"position": "q", "velocity": "v", "acceleration": "a", "torque": "torque", "motor_torque": "motor_torque",
                  "torque_margin": "torque_margin", "speed_margin": "speed_margin"}
_ANGLES = ("position", "velocity", "acceleration", "speed_margin")


@dataclass(frozen=True)
class InverseDynamicsResult:
    """Forces and torques that a motion needed. N samples, n joints; NaN where the motion has gaps.

    q, v, a: (N, n) smoothed [rad, per s, per s²]. torque: (N, n) [N m], from servo to link. motor_torque: (N, n) [N m],
    with reflected inertia and the servo's own friction, after back-EMF. contact: foot -> ground reaction (N, 3) [N] in
    W, inside the friction cone. base_wrench_residual: (N, 6) [moment about the base link's origin N m, force N] in W that
    no contact inside the cone supplies; zero on a fixed base, whose mount's wrench is `support` (zero on a free one).
    torque_margin (N, n) [N m], speed_margin (N, n) [rad/s]: of the servos at the supply voltage (margins.py). loads: joint ->
    the same over the whole motion. torque_sigma (N, n), residual_sigma (N, 6): standard deviations caused by the measurement's
    noise; zero where none was given.

    With more than one foot down, how far feet squeeze against each other leaves no trace in the motion: `torque` and
    `contact` are those of the smallest forces that fit the feet's slip (contact.py). The residual does not depend on it.
    """

    name: str
    base: str
    time: Array
    joints: tuple[str, ...]
    q: Array
    v: Array
    a: Array
    torque: Array
    motor_torque: Array
    contact: Mapping[str, Array]
    base_wrench_residual: Array
    support: Array
    torque_margin: Array
    speed_margin: Array
    torque_sigma: Array
    residual_sigma: Array
    loads: Mapping[str, ServoLoad] = field(default_factory=dict)
    problems: tuple[str, ...] = ()

    def column(self, joint: str) -> int:
        """Index of a joint's column."""
        return self.joints.index(joint)


def save_inverse_dynamics(result: InverseDynamicsResult, path: str | Path) -> Path:
    """Writes the result as CSV under three comment lines: format, contents (JSON), units.

    Columns: time; `position.J`, `velocity.J`, `acceleration.J`, `torque.J`, `motor_torque.J`, `torque_margin.J`,
    `speed_margin.J`, `torque.J.sigma` for each joint J; `contact.FOOT.x` …; `residual.moment.x` … `residual.force.z`, the same
    with `.sigma`, and `support.moment.x` …. A gap is a blank cell.
    """
    columns: dict[str, Array] = {"time": result.time}
    for kind, key in _JOINT_COLUMNS.items():
        values = getattr(result, key) * _factor(kind)
        columns |= {f"{kind}.{j}": values[:, i] for i, j in enumerate(result.joints)}
    columns |= {f"torque.{j}.sigma": result.torque_sigma[:, i] for i, j in enumerate(result.joints)}
    for foot, force in result.contact.items():
        columns |= {f"contact.{foot}.{axis}": force[:, i] for i, axis in enumerate("xyz")}
    for name, suffix, wrench in _wrenches(result):
        columns |= {f"{name}.{part}{suffix}": wrench[:, i] for i, part in enumerate(_WRENCH)}
    loads = {j: vars(load) for j, load in result.loads.items()}
    about = {"name": result.name, "base": result.base, "problems": list(result.problems), "loads": _without_nan(loads)}
    out = io.StringIO()
    out.write(f"{HEADER}\n# {json.dumps(about)}\n{_UNITS}\n")
    import pandas as pd

    pd.DataFrame(columns).to_csv(out, index=False, float_format="%.9g")
    return write_whole(path, out.getvalue())


def load_inverse_dynamics(path: str | Path) -> InverseDynamicsResult:
    """Reads what `save_inverse_dynamics` wrote, by the columns' names; InputError names the line or column that is wrong."""
    text = read_text(path)
    lines = text.split("\n", 3)
    if lines[0].rstrip() != HEADER or len(lines) < 4:
        raise InputError(path, f"line 1: expected '{HEADER}'")
    try:
        about = json.loads(lines[1].lstrip("# "))
        name, base, problems = str(about["name"]), str(about["base"]), tuple(about["problems"])
        loads = {joint: ServoLoad(**{k: np.nan if v is None else float(v) for k, v in load.items()})
                 for joint, load in about["loads"].items()}
    except (ValueError, KeyError, TypeError, AttributeError) as e:
        raise InputError(path, f"line 2: expected a JSON description of the table ({in_words(e)})") from None
    table = number_columns(path, lines[3], first_line=4)
    joints = tuple(c.removeprefix("position.") for c in table if c.startswith("position."))
    feet = tuple(dict.fromkeys(c.split(".")[1] for c in table if c.startswith("contact.")))

    def stack(names: list[str]) -> Array:
        missing = [n for n in names if n not in table]
        if missing:
            raise InputError(path, f"line 4: column '{missing[0]}' is missing")
        return np.column_stack([table[n] for n in names])

    def wrench(what: str, suffix: str = "") -> Array:
        return stack([f"{what}.{part}{suffix}" for part in _WRENCH])

    if "time" not in table or not joints:
        raise InputError(path, "line 4: expected the columns 'time' and 'position.JOINT'")
    values = {key: stack([f"{kind}.{j}" for j in joints]) / _factor(kind) for kind, key in _JOINT_COLUMNS.items()}
    return InverseDynamicsResult(
        name=name, base=base, time=table["time"], joints=joints, **values,
        contact={f: stack([f"contact.{f}.{axis}" for axis in "xyz"]) for f in feet},
        base_wrench_residual=wrench("residual"), residual_sigma=wrench("residual", ".sigma"), support=wrench("support"),
        torque_sigma=stack([f"torque.{j}.sigma" for j in joints]), loads=loads, problems=problems)


def _wrenches(result: InverseDynamicsResult) -> list[tuple[str, str, Array]]:
    return [("residual", "", result.base_wrench_residual), ("residual", ".sigma", result.residual_sigma),
            ("support", "", result.support)]


def _factor(kind: str) -> float:
    """Factor from radians to the file's degrees; 1 for columns that are not angles."""
    return 180 / np.pi if kind in _ANGLES else 1.0


def _without_nan(loads: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float | None]]:
    return {j: {k: v if np.isfinite(v) else None for k, v in load.items()} for j, load in loads.items()}
