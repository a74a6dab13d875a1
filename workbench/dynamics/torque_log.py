"""Logs of angles and torques without goals: the gap between recorded and required torque, and the load that would explain it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from workbench.dynamics.machine import Machine
from workbench.dynamics.trajectory import RobotTrajectory, smoothed
from workbench.files import InputError
from workbench.files.tables import is_binary, plain_head
from workbench.recording.formats.numbers import column, read_columns, table_bytes
from workbench.recording.formats.table_header import table_header
from workbench.robot import EffectSpec, RobotModel
from workbench.types import Array

_TIME = ("t", "time")
_ANGLE = re.compile(r"(?i)(?:q|pos|position)[._\[]?(.+?)\]?")
_TORQUE = re.compile(r"(?i)(?:tau|torque|effort)[._\[]?(.+?)\]?")
_WINDOW = 0.1
"""Over which angles are smoothed and differentiated [s]."""
_ROWS = 300
"""Rows that are evaluated, evenly chosen."""
_PROBE = 0.1
"""Mass [kg] and distance [m] of the probes of a load."""


@dataclass(frozen=True)
class TorqueLog:
    """time: (N,) [s]. joints: (n,) of the model. q (N, n) [rad], torque (N, n) [N m]. assumed: how columns without names were
    assigned; empty where they have names."""

    time: Array
    joints: tuple[str, ...]
    q: Array
    torque: Array
    assumed: str = ""


@dataclass(frozen=True)
class JointGap:
    """Recorded less required torque of one joint [N m]. recorded, gap: RMS; mean: of the gap; with_load: RMS with the best
    load."""

    joint: str
    recorded: float
    gap: float
    mean: float
    with_load: float


@dataclass(frozen=True)
class Load:
    """A mass [kg] at a point of a link's frame (3,) [m], and the share of the gap's mean square that it explains."""

    link: str
    mass: float
    position: tuple[float, float, float]
    explains: float


@dataclass(frozen=True)
class TorqueGap:
    """joints: by gap, the largest first. load: None where no load explains a tenth of the gap. assumed: as of TorqueLog."""

    joints: tuple[JointGap, ...]
    load: Load | None
    assumed: str = ""

    def table(self) -> str:
        """A line for each joint, and one for the load."""
        lines = ["joint             torque   gap    mean   with load [N m, RMS]"]
        lines += [f"{g.joint:16s} {g.recorded:7.3f} {g.gap:6.3f} {g.mean:+7.3f}  {g.with_load:6.3f}" for g in self.joints]
        if self.load is None:
            return "\n".join([*lines, "no single load explains a tenth of the gap"])
        x, y, z = (1000 * p for p in self.load.position)
        load = f"a load of {1000 * self.load.mass:.0f} g at ({x:.0f}, {y:.0f}, {z:.0f}) mm of {self.load.link}"
        return "\n".join([*lines, f"{load} explains {100 * self.load.explains:.0f} % of it (besides dry friction)"])


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


def torque_gap(log: TorqueLog, model: RobotModel) -> TorqueGap:
    """The gap of a robot whose base is held level, and the load on one link that explains most of it, beside dry friction of
    each joint as large as the gap shows."""
    path = _path(log, model)
    columns = [model.joints.index(j) for j in log.joints]
    rows = np.unique(np.linspace(0, len(log.time) - 1, _ROWS).astype(int))
    kept = rows[np.isfinite(log.torque[rows]).all(axis=1) & np.isfinite(path.q[rows]).all(axis=1)]
    path = replace(path, **{k: getattr(path, k)[kept] for k in ("time", "q", "v", "a", "p_WB", "quat_WB", "V_WB", "A_WB")})
    required = Machine(model).demand(path)[1]
    gap = log.torque[kept] - required[:, columns]
    friction = _friction(path.v[:, columns])
    best: Load | None = None
    rest = gap
    for link in model.kinematics.links:
        if link == model.base:
            continue
        found = _load(model, link, path, required, columns, gap, friction)
        if found is not None and (best is None or found[0].explains > best.explains):
            best, rest = found
    if best is None or best.explains < 0.1:
        best, rest = None, gap
    rms = [np.sqrt(np.mean(x**2, axis=0)) for x in (log.torque[kept], gap, rest)]
    joints = [JointGap(j, float(rms[0][i]), float(rms[1][i]), float(gap[:, i].mean()), float(rms[2][i]))
              for i, j in enumerate(log.joints)]
    return TorqueGap(tuple(sorted(joints, key=lambda g: -g.gap)), best, log.assumed)


def _path(log: TorqueLog, model: RobotModel) -> RobotTrajectory:
    q = np.zeros((len(log.time), len(model.joints)))
    for i, joint in enumerate(log.joints):
        q[:, model.joints.index(joint)] = log.q[:, i]
    place = np.zeros((len(q), 3))
    level = np.tile([1.0, 0, 0, 0], (len(q), 1))
    return smoothed(log.time, model.joints, q, place, level, _WINDOW)[0]


def _friction(speed: Array) -> Array:
    """(n, N, n): dry friction of each joint alone, smooth about rest."""
    unit = np.tanh(speed / 0.05)
    return np.array([unit * (np.arange(speed.shape[1]) == j) for j in range(speed.shape[1])])


def _load(model: RobotModel, link: str, path: RobotTrajectory, required: Array, columns: list[int], gap: Array,
          friction: Array) -> tuple[Load, Array] | None:
    """The mass and place on a link that explain most of the gap (N, n), with what then remains of it; None where none does."""
    center = np.asarray(model.kinematics.centers.get(link, np.zeros(3)), dtype=float)

    def of(position: Array) -> Array:
        x, y, z = map(float, position)
        loaded = model.with_effect(EffectSpec("payload", (link,), {"mass": _PROBE, "position": (x, y, z)}))
        return np.asarray((Machine(loaded).demand(path)[1] - required)[:, columns] / _PROBE)

    middle = of(center)
    moments = [(of(center + _PROBE * axis) - of(center - _PROBE * axis)) / (2 * _PROBE) for axis in np.eye(3)]
    basis = np.stack([middle, *moments, *friction]).reshape(4 + len(friction), -1).T
    alone = friction.reshape(len(friction), -1).T
    without = gap.ravel() - alone @ np.linalg.lstsq(alone, gap.ravel(), rcond=None)[0]
    found = np.linalg.lstsq(basis, gap.ravel(), rcond=1e-3)[0]
    mass, moment = float(found[0]), found[1:4]
    if mass <= 0:
        return None
    offset = np.clip(moment / max(mass, 1e-3), -0.5, 0.5)
    shape = middle + np.einsum("i,ijk->jk", offset, np.array(moments))
    again = np.column_stack([shape.ravel(), alone])
    sizes = np.linalg.lstsq(again, gap.ravel(), rcond=None)[0]
    rest = gap.ravel() - again @ sizes
    explains = 1 - float(np.mean(rest**2)) / max(float(np.mean(without**2)), 1e-12)
    place = center + offset
    return Load(link, float(sizes[0]), (float(place[0]), float(place[1]), float(place[2])), explains), rest.reshape(gap.shape)


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
    said = ", ".join(f"{key} is {joint}" for key, joint in zip(keys, chosen))
    return chosen, f"columns without names were taken from the base on: {said}"


def summary(gap: TorqueGap) -> Mapping[str, object]:
    """Plain types, for JSON."""
    load = None if gap.load is None else {"link": gap.load.link, "mass": gap.load.mass, "position": list(gap.load.position),
                                          "explains": gap.load.explains}
    return {"format": 1, "joints": {g.joint: {"torque": g.recorded, "gap": g.gap, "mean": g.mean, "with_load": g.with_load,
                                              "unit": "N m"} for g in gap.joints}, "load": load}
