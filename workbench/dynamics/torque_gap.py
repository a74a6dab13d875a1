"""The gap between recorded and required torque of a log without goals, and the load that would explain it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from workbench.dynamics.machine import Machine
from workbench.dynamics.torque_log import TorqueLog
from workbench.dynamics.trajectory import RobotTrajectory, smooth
from workbench.robot import EffectSpec, RobotModel
from workbench.types import Array

_WINDOW = 0.1
"""Window in which angles are smoothed and differentiated [s]."""
_ROWS = 300
"""Number of rows that are evaluated, evenly chosen."""
_PROBE = 0.1
"""Mass [kg] and distance [m] of the probes of a load."""


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
    """joints: by gap, the largest first. load: None where no load explains a tenth of the gap. assumed: as of TorqueLog. time:
    (N,) [s] of the rows that were evaluated; torque, required: (N, n) [N m], recorded and by the model, of the joints
    `columns`."""

    joints: tuple[JointGap, ...]
    load: Load | None
    assumed: str = ""
    time: Array = field(default_factory=lambda: np.empty(0))
    columns: tuple[str, ...] = ()
    torque: Array = field(default_factory=lambda: np.empty((0, 0)))
    required: Array = field(default_factory=lambda: np.empty((0, 0)))

    def table(self) -> str:
        """A line for each joint, and one for the load."""
        lines = ["joint             torque   gap    mean   with load [N m, RMS]"]
        lines += [f"{g.joint:16s} {g.recorded:7.3f} {g.gap:6.3f} {g.mean:+7.3f}  {g.with_load:6.3f}" for g in self.joints]
        return "\n".join([*lines, self.load_line()])

    def load_line(self) -> str:
        """The load in one sentence."""
        if self.load is None:
            return "no single load explains a tenth of the gap"
        x, y, z = (1000 * p for p in self.load.position)
        return (f"a load of {1000 * self.load.mass:.0f} g at ({x:.0f}, {y:.0f}, {z:.0f}) mm of {self.load.link} explains "
                f"{100 * self.load.explains:.0f} % of it (besides dry friction)")


def torque_gap(log: TorqueLog, model: RobotModel, link: str | None = None) -> TorqueGap:
    """The gap of a robot whose base is held level, and the load on one link (that given, or any) that explains most of it,
    together with dry friction of each joint as large as the gap shows."""
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
    for candidate in model.kinematics.links if link is None else (link,):
        if candidate == model.base:
            continue
        found = _load(model, candidate, path, required, columns, gap, friction)
        if found is not None and (best is None or found[0].explains > best.explains):
            best, rest = found
    if best is None or best.explains < 0.1:
        best, rest = None, gap
    rms = [np.sqrt(np.mean(x**2, axis=0)) for x in (log.torque[kept], gap, rest)]
    joints = [JointGap(j, float(rms[0][i]), float(rms[1][i]), float(gap[:, i].mean()), float(rms[2][i]))
              for i, j in enumerate(log.joints)]
    return TorqueGap(tuple(sorted(joints, key=lambda g: -g.gap)), best, log.assumed, log.time[kept], log.joints, log.torque[kept],
                     required[:, columns])


def compare_torques(logs: Mapping[str, TorqueLog], gaps: Mapping[str, TorqueGap], model: RobotModel) -> str:
    """The additional load of the second of two logs against the first, in a sentence, both weighed on the link that explains
    the larger gap: errors of the model, equal in both, cancel. Empty for one log, or where neither shows a load."""
    if len(logs) != 2:
        return ""
    found = [gap.load for gap in gaps.values() if gap.load is not None]
    if not found:
        return ""
    link = max(found, key=lambda load: load.mass).link
    first, second = (torque_gap(log, model, link).load for log in logs.values())
    a, b = (0.0 if load is None else load.mass for load in (first, second))
    names = list(logs)
    return f"{names[1]} carries {1000 * (b - a):+.0f} g against {names[0]}, weighed on {link}"


def _path(log: TorqueLog, model: RobotModel) -> RobotTrajectory:
    q = np.zeros((len(log.time), len(model.joints)))
    for i, joint in enumerate(log.joints):
        q[:, model.joints.index(joint)] = log.q[:, i]
    place = np.zeros((len(q), 3))
    level = np.tile([1.0, 0, 0, 0], (len(q), 1))
    return smooth(log.time, model.joints, q, place, level, _WINDOW)[0]


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


def summary(gap: TorqueGap) -> Mapping[str, object]:
    """Plain types, for JSON."""
    load = None if gap.load is None else {"link": gap.load.link, "mass": gap.load.mass, "position": list(gap.load.position),
                                          "explains": gap.load.explains}
    return {"format": 1, "joints": {g.joint: {"torque": g.recorded, "gap": g.gap, "mean": g.mean, "with_load": g.with_load,
                                              "unit": "N m"} for g in gap.joints}, "load": load}
