"""Logs of angles and torques without goals, read as tables."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.files import InputError
from workbench.files.tables import is_binary, plain_head
from workbench.recording.formats.numbers import column, read_columns, table_bytes
from workbench.recording.formats.table_header import table_header
from workbench.robot import RobotModel
from workbench.types import Array

_TIME = ("t", "time")
_ANGLE = re.compile(r"(?i)(?:q|pos|position)[._\[]?(.+?)\]?")
_TORQUE = re.compile(r"(?i)(?:tau|torque|effort)[._\[]?(.+?)\]?")


@dataclass(frozen=True)
class TorqueLog:
    """time: (N,) [s]. joints: (n,) of the model. q (N, n) [rad], torque (N, n) [N m]. assumed: how columns without names were
    assigned; empty where they have names."""

    time: Array
    joints: tuple[str, ...]
    q: Array
    torque: Array
    assumed: str = ""


def is_torque_log(path: str | Path) -> bool:
    """Whether a table has a time, and an angle and a torque of one joint at least, but no goals."""
    if not Path(path).is_file():
        return False
    head = plain_head(path)
    if is_binary(head):
        return False
    names = table_header(head).names
    angles, torques = _columns(names, _ANGLE), _columns(names, _TORQUE)
    goals = any(name.lower().startswith(("goal", "cmd", "command", "target")) for name in names)
    return not goals and any(t in names for t in _TIME) and bool(torques) and set(torques) <= set(angles)


def read_torque_log(path: str | Path, model: RobotModel) -> TorqueLog:
    """Reads such a table: seconds, radians, N m. Columns with numbers (q0, tau0) are the model's joints from the base on.

    InputError where a joint is not of the model, or there are more than it has."""
    source = str(path)
    content, _ = table_bytes(path)
    header = table_header(content)
    angles, torques = _columns(header.names, _ANGLE), _columns(header.names, _TORQUE)
    keys = [key for key in torques if key in angles]
    joints, assumed = _joints(source, keys, model)
    at = next(i for i, name in enumerate(header.names) if name in _TIME)
    wanted = {at, *(angles[k] for k in keys), *(torques[k] for k in keys)}
    table = read_columns(source, content, header.end, header.lines, len(header.names), wanted=wanted)
    time = column(table, at)
    if len(time) < 10 or np.any(np.diff(time) <= 0):
        raise InputError(source, "expected ten or more rows with increasing times")
    q, torque = (np.column_stack([column(table, of[k]) for k in keys]) for of in (angles, torques))
    if np.nanmax(np.abs(q)) > 4 * np.pi:
        raise InputError(source, f"angles reach {np.nanmax(np.abs(q)):.3g}; expected radians")
    return TorqueLog(time, joints, q, torque, assumed)


def _columns(names: tuple[str, ...], pattern: re.Pattern[str]) -> dict[str, int]:
    out: dict[str, int] = {}
    for i, name in enumerate(names):
        found = pattern.fullmatch(name)
        if found and not re.match(r"(?i)qd|qw|qx|qy|qz", name):
            out.setdefault(found.group(1), i)
    return out


def _joints(source: str, keys: list[str], model: RobotModel) -> tuple[tuple[str, ...], str]:
    if all(key in model.joints for key in keys):
        return tuple(keys), ""
    if not all(key.isdigit() for key in keys):
        strange = next(k for k in keys if k not in model.joints)
        raise InputError(source, f"the robot has no joint '{strange}'; its joints: {' '.join(model.joints)}")
    if len(keys) > len(model.joints):
        raise InputError(source, f"{len(keys)} joints; the robot has {len(model.joints)}: {' '.join(model.joints)}")
    from_base = [j for link in model.kinematics.links if (j := model.kinematics.joint_of(link)) in model.joints]
    chosen = tuple(str(j) for j in from_base[:len(keys)])
    assignment = ", ".join(f"{key} is {joint}" for key, joint in zip(keys, chosen))
    return chosen, f"columns without names were taken from the base on: {assignment}"
