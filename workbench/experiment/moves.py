"""Short motions that bring one joint's physics to light: from neutral back to neutral, within the servos' limits."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from workbench.experiment.limits import Reach
from workbench.experiment.options import EXPERIMENT
from workbench.experiment.segment import Segment
from workbench.robot import GRAVITY, RobotModel
from workbench.types import Array


@dataclass
class Path:
    """A segment under construction. speeds: (n,) [rad/s] the most that each joint is asked for."""

    joints: tuple[str, ...]
    speeds: Array
    times: list[float] = field(default_factory=lambda: [0.0])
    poses: list[Array] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.poses.append(np.zeros(len(self.joints)))

    def to(self, pose: Mapping[str, float], speed: float = math.inf, least: float = 0.05) -> Path:
        """Moves the named joints on to these angles, the others staying, at `speed` or the maximum, in at least `least`
        seconds."""
        angles = self.poses[-1].copy()
        for joint, angle in pose.items():
            angles[self.joints.index(joint)] = angle
        needed = float(np.max(np.abs(angles - self.poses[-1]) / np.minimum(speed, self.speeds)))
        self.times.append(round(self.times[-1] + max(needed, least) + 5e-4, 3))
        self.poses.append(angles)
        return self

    def hold(self, seconds: float) -> Path:
        """Stays."""
        return self.to({}, least=seconds)

    def home(self, speed: float = EXPERIMENT.quick) -> Path:
        """Back to neutral, and at rest."""
        return self.to(dict.fromkeys(self.joints, 0.0), speed).hold(EXPERIMENT.rest_at_end)

    def segment(self, name: str, base: str = "fixed", long: bool = False) -> Segment:
        """The motion so far, as one segment."""
        return Segment(name, base, np.array(self.times), np.vstack(self.poses), long)


class JointMoves:
    """Segments for a robot whose base is fixed, that make effects in the joints of `focus` observable."""

    def __init__(self, model: RobotModel, reach: Reach, focus: Sequence[str]) -> None:
        self.model, self.reach, self.focus = model, reach, tuple(focus)
        self.others = _neighbours(model, self.focus) if len(self.focus) == 1 else ()

    def segments(self) -> list[Segment]:
        """All moves, made smaller where links would come too near each other; those that stay too near are left out."""
        named = (replace(s, name=f"{' '.join(self.focus)}: {s.name}") for s in self._all())
        return [s for s in map(self.reach.scaled_clear, named) if s is not None]

    def _all(self) -> Iterator[Segment]:
        yield self._sweep(30, 1.4 * EXPERIMENT.slow)
        yield self._steps("neutral", {}, (40, 0, -40, 0, 18, -18, 8, 0))
        yield self._tremble()
        for n, (name, posture) in enumerate(self._postures().items()):
            yield self._approach(name, posture)
            if n == 0:  # as a rule the other posture is this one's mirror image
                yield self._steps(name, posture, (25, 0, -25, 0, 10, 0))
                yield self._stairs(name, posture)
                if self.others:
                    yield self._shaken(name, posture)
        if self.others:
            yield self._reversal()

    def _path(self) -> Path:
        return Path(self.model.joints, self.reach.speeds)

    def _offset(self, degrees: float, posture: Mapping[str, float]) -> dict[str, float]:
        """The joints of the focus so far from where they are in a posture, within their ranges."""
        return {j: self.reach.within(j, posture.get(j, 0.0) + math.radians(degrees)) for j in self.focus}

    def _sweep(self, size: float, speed: float) -> Segment:
        path = self._path()
        for share in (1, -1, 0.5, -0.5):
            path.to(self._offset(share * size, {}), speed).hold(0.1)
        return path.home(speed).segment(f"sweep of {size:.0f} deg")

    def _steps(self, name: str, posture: Mapping[str, float], sizes: Sequence[float]) -> Segment:
        path = self._path()
        if posture:
            path.to(posture, EXPERIMENT.quick).hold(EXPERIMENT.pause)
        for size in sizes:
            path.to(self._offset(size, posture)).hold(EXPERIMENT.pause)
        return path.home().segment(f"quick steps, {name}")

    def _tremble(self) -> Segment:
        path = self._path()
        for size, beat, times in ((4, 0.06, 6), (8, 0.09, 6), (15, 0.14, 4)):
            for k in range(2 * times):
                path.to(self._offset(size * (-1) ** k, {}), least=beat)
        return path.home().segment("small oscillation")

    def _approach(self, name: str, posture: Mapping[str, float]) -> Segment:
        """Moves that reach the same angle from both sides, from near and from far."""
        path = self._path().to(posture, EXPERIMENT.quick).hold(0.25)
        for size in (15, 0, -15, 0, 5, 0, -5, 0):
            path.to(self._offset(size, posture), EXPERIMENT.slow).hold(0.15)
        return path.home().segment(f"both ways, {name}")

    def _stairs(self, name: str, posture: Mapping[str, float]) -> Segment:
        path = self._path().to(posture, EXPERIMENT.quick).hold(EXPERIMENT.pause)
        for size in (1.5, 3, 4.5, 6, 4.5, 3, 1.5, 0, -1.5, -3, -1.5, 0):
            path.to(self._offset(size, posture)).hold(0.12)
        return path.home().segment(f"stairs, {name}")

    def _shaken(self, name: str, posture: Mapping[str, float]) -> Segment:
        """The joint holds while its neighbours jerk."""
        path = self._path().to(posture, EXPERIMENT.quick).hold(EXPERIMENT.pause)
        for share in (1, -1, 1, -1, 0.4, -0.4, 0.4, 0):
            shaken = {j: self.reach.within(j, posture.get(j, 0.0) + share * math.radians(18)) for j in self.others[:1]}
            path.to(shaken).hold(0.15)
        return path.home().segment(f"shaken by {self.others[0]}, {name}")

    def _reversal(self) -> Segment:
        """The joint holds while its neighbours turn the load on it round, slowly and fast."""
        (joint,) = self.focus
        q, torque = self._grid()
        column = self.model.joints.index(joint)
        best = max(np.unique(q[:, column]), key=lambda a: np.ptp(torque[q[:, column] == a]))
        here = np.flatnonzero(q[:, column] == best)
        up, down = (self._pose(q[here[k]]) for k in (np.argmax(torque[here]), np.argmin(torque[here])))
        path = self._path().to(up, EXPERIMENT.quick).hold(EXPERIMENT.pause)
        for pose, speed in ((down, EXPERIMENT.slow), (up, EXPERIMENT.quick), (down, EXPERIMENT.quick)):
            path.to(pose, speed).hold(EXPERIMENT.pause)
        return path.home().segment("load reversed")

    def _postures(self) -> dict[str, dict[str, float]]:
        """Postures in which gravity pulls the joint one way and the other as hard as may be; neutral for several joints."""
        if len(self.focus) != 1:
            return {"spread": self._offset(25, {})}
        q, torque = self._grid()
        return {"pulled up": self._pose(q[np.argmax(torque)]), "pulled down": self._pose(q[np.argmin(torque)])}

    def _grid(self) -> tuple[Array, Array]:
        """Postures (M, n) [rad] of the joint and its neighbours, clear of each other, and gravity's torque on the joint (M,)."""
        (joint,) = self.focus
        moved = (joint, *self.others)
        ranges = [sorted({self.reach.within(j, math.radians(a), room=math.radians(15)) for a in EXPERIMENT.grid}) for j in moved]
        rows = np.array(list(itertools.product(*ranges)))
        q = np.zeros((len(rows), len(self.model.joints)))
        q[:, [self.model.joints.index(j) for j in moved]] = rows
        q = q[self.reach.clear(q)]
        q = q if len(q) else np.zeros((1, len(self.model.joints)))
        # of two alike, the one nearer to neutral
        return q, gravity_torque(self.model, joint, q) * (1 - 1e-3 * np.abs(q).sum(axis=1))

    def _pose(self, row: Array) -> dict[str, float]:
        moved = (*self.focus, *self.others)
        return {j: float(row[self.model.joints.index(j)]) for j in moved}


def long_runs(model: RobotModel, reach: Reach, focus: Sequence[str], seconds: float) -> list[Segment]:
    """Segments of a given length on a fixed base: hard work for time to show in, and uneven dwells for clocks."""
    path = Path(model.joints, reach.speeds)
    sizes = itertools.cycle((40, -40, 20, -20, 40, 0))
    while path.times[-1] < seconds - 1.5:
        size = math.radians(next(sizes))
        path.to({j: reach.within(j, size) for j in focus}).hold(0.12)
    work = path.home().segment("sustained load", long=True)
    path = Path(model.joints, reach.speeds)
    while path.times[-1] < seconds - 3.5:
        for k in range(18):  # many short poses on a slow zigzag, then few long ones on another
            angle = math.radians(24) * (abs((k + 3) % 12 - 6) / 3 - 1)
            path.to({j: reach.within(j, angle) for j in focus}, least=0.08)
        for size in (20, -20):
            path.to({j: reach.within(j, math.radians(size)) for j in focus}, least=0.9)
    uneven = path.home(EXPERIMENT.slow).segment("uneven dwells", long=True)
    return [s for s in map(reach.scaled_clear, (work, uneven)) if s is not None]


def gravity_torque(model: RobotModel, joint: str, q: Array) -> Array:
    """Torque (N,) [N m] of gravity about a joint's axis, base level, at angles (N, n) [rad] in the model's order."""
    k = model.kinematics
    poses = k.forward(q, model.joints)
    f = k.frames[joint]
    p_WP, R_WP = poses[f.parent]
    origin, axis = p_WP + R_WP @ f.X_PF_p, R_WP @ f.axis_of_parent
    out = np.zeros(len(q))
    for link in k.links:
        if joint in k.chain(link):
            p, R = poses[link]
            arm = p + R @ k.centers[link] - origin
            out += k.masses[link] * np.einsum("ni,ni->n", axis, np.cross(arm, [0.0, 0.0, -GRAVITY]))
    return out


def _neighbours(model: RobotModel, focus: Sequence[str]) -> tuple[str, ...]:
    """Up to two joints that carry the joint and one that it carries, the nearest first."""
    (joint,) = focus
    k = model.kinematics
    carriers = [j for j in reversed(k.chain(k.frames[joint].parent)) if j in model.joints]
    carried = [j for j in model.joints if joint in k.chain(k.frames[j].parent)]
    return (*carriers[:2], *carried[:1])
