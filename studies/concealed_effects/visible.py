"""Is it observable? The recordings of a robot with something hidden, compared with the same robot without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from studies.concealed_effects.takes import LOG_COUNT, LOG_NOISE, LogPlan, play_log
from studies.other_engine.firmware import commands_from_rows
from studies.other_engine.hidden import turned_frames
from studies.other_engine.make_session import TakePlan
from studies.other_engine.player import Rollout, play
from workbench.robot import RobotModel
from workbench.types import Array

COARSE, FINE = 1e-3, 5e-4
"""Steps [s]: of the search, and of the recordings."""
ROTATION_NOISE = float(np.deg2rad(0.12) * np.sqrt(6))
"""Of the angle between two rigid bodies, three axes each [rad]."""
POSITION_NOISE = 1e-4 * np.sqrt(3)
SHOWS = 1.5
"""Times its noise that some channel has to differ."""
PATH_FLOOR = 0.05
"""Share of the way walked by which two engines differ anyway."""


@dataclass(frozen=True)
class Seen:
    """One take as its channels: rotations between tracked neighbours (N, k, 3, 3), since rest; their places in the base's
    frame since rest (N, k, 3) [m]; the base's place (N, 3) [m]; servo angles (N, n) [rad] of logs. upright: the z axis's z."""

    rotations: Array
    places: Array
    path: Array
    angles: Array
    upright: float

    @property
    def travel(self) -> float:
        """Way from start to end on the floor [m]."""
        return float(np.linalg.norm((self.path[-1] - self.path[0])[:2]))


def see(model: RobotModel, plan: TakePlan | LogPlan, timestep: float = COARSE, chance: int = 0) -> Seen:
    """Plays one take and looks at it without noise."""
    if isinstance(plan, LogPlan):
        run = play_log(model, plan, timestep, chance)
        empty = np.zeros((0, 0, 3, 3))
        return Seen(empty, empty[..., 0], np.zeros((1, 3)), run.sensed[:: round(0.01 / timestep)], 1.0)
    commands = commands_from_rows(plan.motion.joints, plan.motion.times, plan.motion.angles, plan.cycles)
    return _filmed(play(model, commands, commands.end + 0.3, 0.01, plan.base, timestep, chance=chance), model)


def _filmed(run: Rollout, model: RobotModel) -> Seen:
    time = np.arange(0.0, run.time[-1], 1 / 60)
    links = tuple(dict.fromkeys(model.rigid_bodies.values()))
    poses = run.poses(time, links)
    p_WB, R_WB = poses[model.base]
    turned = {model.rigid_bodies[a]: Rotation.from_rotvec(r).as_matrix() for a, r in turned_frames(model).items()}
    rotations, places = [], []
    for link in links:
        if link == model.base:
            continue
        p, R = poses[link]
        parent = _tracked_parent(model, link, links)
        between = np.swapaxes(poses[parent][1], 1, 2) @ R
        # A frame that is turned stays so: everything else is counted from rest.
        since_rest = between[0].T @ between
        rotations.append(since_rest @ turned[link] if link in turned else since_rest)
        in_base = np.einsum("nji,nj->ni", R_WB, p - p_WB)
        places.append(in_base - in_base[0])
    return Seen(np.stack(rotations, 1), np.stack(places, 1), p_WB, np.zeros((0, 0)), float(R_WB[-1, 2, 2]))


def _tracked_parent(model: RobotModel, link: str, tracked: Sequence[str]) -> str:
    k = model.kinematics
    while True:
        joint = k.parent_joint[link]
        assert joint is not None
        link = k.frames[joint].parent
        if link in tracked:
            return link


def excess(hidden: Seen, without: Seen, nominal: Seen, finer: Seen | None) -> float:
    """Largest RMS difference of a channel, with something hidden and without it, over its noise. finer: the nominal robot with
    half the step, whose difference from `nominal` counts as noise too. A take that is longer is compared where both are."""
    if nominal.angles.size:
        n = min(len(hidden.angles), len(without.angles))
        noise = np.hypot(LOG_NOISE, LOG_COUNT / np.sqrt(12))
        return float(np.max(_rms(hidden.angles[:n] - without.angles[:n]))) / noise
    floor = (0.0, 0.0, 0.0) if finer is None else _differences(finer, nominal)
    rotation, place, path = _differences(hidden, without)
    walked = 0.0 if finer is None else PATH_FLOOR * nominal.travel
    return max(float(np.max(rotation / np.hypot(ROTATION_NOISE, floor[0]))),
               float(np.max(place / np.hypot(POSITION_NOISE, floor[1]))),
               0.0 if finer is None else float(path / np.sqrt(POSITION_NOISE**2 + floor[2] ** 2 + walked**2)))


def _differences(a: Seen, b: Seen) -> tuple[Array, Array, float]:
    n = min(len(a.path), len(b.path))
    between = np.swapaxes(a.rotations[:n], 2, 3) @ b.rotations[:n]
    angle = np.arccos(np.clip((np.trace(between, axis1=2, axis2=3) - 1) / 2, -1, 1))
    place = np.linalg.norm(a.places[:n] - b.places[:n], axis=2)
    path = np.linalg.norm((a.path[:n] - a.path[0]) - (b.path[:n] - b.path[0]), axis=1)
    return _rms(angle), _rms(place), float(_rms(path[:, None])[0])


def _rms(x: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(np.square(x), axis=0)), dtype=float)
