"""A take as one CSV table, as `simulate` writes it."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import InputError
from workbench.files.errors import in_words
from workbench.files.reading import parse_json, read_text, write_whole
from workbench.motion.commands import Commands
from workbench.recording.formats.log_commands import out_of_order
from workbench.recording.formats.numbers import number_columns
from workbench.recording.take import Take
from workbench.types import Array

_DEG = np.pi / 180
HEADER = "# workbench rollout"
_UNITS = ("# s; deg; deg/s; N m; base and contact in the world's axes, x forward, y left, z up: m, quaternion wxyz, N; "
          "time 0 is the first command of a simulation, the first frame of a recording")
_POSE = ("base.x", "base.y", "base.z", "base.qw", "base.qx", "base.qy", "base.qz")
_DECIMALS = 7  # decimals of degrees, metres and seconds: far below any noise, and the table stays short


def is_rollout(first_line: str) -> bool:
    """Whether a file that starts with this line is a rollout table."""
    return first_line.lstrip("\ufeff").startswith(HEADER)


def save_rollout(take: Take, path: str | Path) -> Path:
    """Writes a take as CSV under three comment lines: format, description (JSON, commands included), units.

    Columns: time, position.J, velocity.J, torque.J of each joint J, base.x … base.qz, contact.FOOT.x … (line 3: units);
    quantities that the take lacks are omitted; a gap is a blank cell. Rigid bodies are not written.
    """
    columns: dict[str, Array] = {"time": take.time}
    for kind, values, unit in (("position", take.q, _DEG), ("velocity", take.v, _DEG), ("torque", take.torque, 1.0)):
        if values is not None:
            columns |= {f"{kind}.{j}": values[:, i] / unit for i, j in enumerate(take.joints)}
    if take.p_WB is not None and take.quat_WB is not None:
        columns |= dict(zip(_POSE, np.hstack([take.p_WB, take.quat_WB]).T))
    for foot, force in take.contact.items():
        columns |= {f"contact.{foot}.{axis}": force[:, i] for i, axis in enumerate("xyz")}
    about = {
        "name": take.name, "source": take.source, "base": take.base, "zeroed": take.zeroed,
        "starts_at": float(take.starts_at) if np.isfinite(take.starts_at) else None, "problems": list(take.problems),
        "commands": None if take.commands is None else _commands_out(take.commands)}
    out = io.StringIO()
    out.write(f"{HEADER}, format 1\n# {json.dumps(about)}\n{_UNITS}\n")
    import pandas as pd

    pd.DataFrame({k: np.round(v, _DECIMALS) + 0.0 for k, v in columns.items()}).to_csv(out, index=False)
    return write_whole(path, out.getvalue())


def load_rollout(path: str | Path) -> Take:
    """Reads what `save_rollout` wrote, by the columns' names; InputError names the line or column that is wrong."""
    text = read_text(path)
    lines = text.split("\n", 3)
    if not is_rollout(text) or len(lines) < 4:
        raise InputError(path, f"line 1: expected a table that starts with '{HEADER}'")
    if lines[0].rstrip() != f"{HEADER}, format 1":
        raise InputError(path, f"line 1: expected format 1, got '{lines[0].rstrip()}'")
    about = parse_json(path, lines[1].lstrip("# "), "line 2: ")
    try:
        name, source, zeroed, base = (about[k] for k in ("name", "source", "zeroed", "base"))
        start = float("nan") if about["starts_at"] is None else float(about["starts_at"])
        commands = None if about["commands"] is None else _commands_in(about["commands"])
        problems = tuple(map(str, about["problems"]))
    except (ValueError, KeyError, TypeError, IndexError, OverflowError) as e:
        raise InputError(path, f"line 2: expected a JSON description of the take ({in_words(e)})") from None
    columns = number_columns(path, lines[3], first_line=4, skip_blank=True)
    joints = tuple(c.removeprefix("position.") for c in columns if c.startswith("position."))
    feet = dict.fromkeys(c.split(".")[1] for c in columns if c.startswith("contact."))
    time = columns.get("time")
    if time is None or not joints:
        raise InputError(path, "line 4: expected the columns 'time' and 'position.JOINT'")
    if not len(time):
        raise InputError(path, "line 5: is missing; expected a row for each frame")
    if out_of_order(time).any():
        raise InputError(path, "column 'time': expected increasing numbers")

    def stack(names: list[str], unit: float = 1.0) -> Array | None:
        if not any(n in columns for n in names):
            return None
        missing = [n for n in names if n not in columns]
        if missing:
            raise InputError(path, f"line 4: column '{missing[0]}' is missing")
        return np.column_stack([columns[n] for n in names]) * unit

    pose = stack(list(_POSE))
    q = stack([f"position.{j}" for j in joints], _DEG)
    assert q is not None
    contact = {f: stack([f"contact.{f}.{a}" for a in "xyz"]) for f in feet}
    return Take(
        name=str(name), source=str(source), base=str(base), time=time, joints=joints, q=q, starts_at=start,
        zeroed=bool(zeroed), v=stack([f"velocity.{j}" for j in joints], _DEG),
        torque=stack([f"torque.{j}" for j in joints]),
        p_WB=None if pose is None else pose[:, :3], quat_WB=None if pose is None else pose[:, 3:],
        contact={f: c for f, c in contact.items() if c is not None}, commands=commands, problems=problems)


def _commands_out(c: Commands) -> dict[str, Any]:
    return {
        "times": c.times.tolist(), "joints": list(c.joints), "goals": np.rad2deg(c.goals).tolist(),
        "speeds": np.rad2deg(c.speeds).tolist(), "enabled": c.enabled.astype(int).tolist(), "end": c.end,
        "poses": c.poses.tolist()}


def _commands_in(d: Mapping[str, Any]) -> Commands:
    shape = (len(d["times"]), len(d["joints"]))
    return Commands(
        times=np.asarray(d["times"], dtype=float), joints=tuple(d["joints"]),
        goals=np.deg2rad(np.asarray(d["goals"], dtype=float)).reshape(shape),
        speeds=np.deg2rad(np.asarray(d["speeds"], dtype=float)).reshape(shape),
        enabled=np.asarray(d["enabled"], dtype=bool).reshape(shape), end=float(d["end"]),
        poses=np.asarray(d["poses"], dtype=int))
