"""Which foot is on the ground when: from the feet's positions, recorded or simulated, or from contact forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.compare.options import COMPARE
from workbench.recording.take import Take
from workbench.robot import RobotModel, foot_points
from workbench.types import Array, Mask


@dataclass(frozen=True)
class FootPhases:
    """When one foot is on the ground. stance: (N,) for each of the take's frames. known: (N,) where the foot was seen.

    falls: times at which it touches down [s], on the take's clock. duty: share of the time from the first command to the last
    command's end (or the take's) in which it stands.
    """

    stance: Mask
    known: Mask
    falls: Array
    duty: float


def foot_phases(take: Take, model: RobotModel) -> dict[str, FootPhases]:
    """Stance of each foot (by its knee's joint) from the height of its lowest point over where it stood at rest.

    Works on any take with a base pose and the legs' joints, zeroed or not: heights are compared with the same foot's own
    at rest, so that zero poses, droop and a pivot's error cancel. Empty for a base held fixed or a robot without feet.
    """
    if take.p_WB is None or take.quat_WB is None or take.base == "fixed":
        return {}
    heights = foot_heights(take, model)
    rest_height = _rest_height(take, heights)
    out = {}
    for foot, z in heights.items():
        resting = z[take.resting & np.isfinite(z)]
        ground = float(np.median(resting)) if len(resting) else float(np.nanmin(z, initial=np.inf))
        out[foot] = _phases(take, z - ground < COMPARE.lift * rest_height, np.isfinite(z))
    return out


def force_phases(take: Take) -> dict[str, FootPhases]:
    """Stance of each foot from a simulation's contact forces: more than `COMPARE.stance_load` of the mean total load. Empty for a
    take without forces."""
    if not take.contact:
        return {}
    load = {foot: f[:, 2] for foot, f in take.contact.items()}
    total = float(np.nanmean(np.sum(list(load.values()), axis=0)))
    if not total > 0:
        return {}
    return {foot: _phases(take, f > COMPARE.stance_load * total, np.isfinite(f)) for foot, f in load.items()}


def foot_heights(take: Take, model: RobotModel) -> dict[str, Array]:
    """Height of each foot's lowest point in the world (N,) [m]; NaN where its leg or the base was not seen."""
    from scipy.spatial.transform import Rotation  # slow to import, and not needed to read a log

    assert take.p_WB is not None
    assert take.quat_WB is not None
    seen = np.isfinite(take.p_WB).all(axis=1) & np.isfinite(take.quat_WB).all(axis=1)
    z_axis = np.full((len(take), 3), np.nan)  # the world's up in the base link's frame
    z_axis[seen] = Rotation.from_quat(take.quat_WB[seen], scalar_first=True).as_matrix()[:, 2, :]
    kinematics = model.kinematics
    poses = kinematics.forward(take.q, take.joints)
    p_RB, R_RB = poses[model.base]
    out = {}
    for foot, (points, radii) in foot_points(model).items():
        link = model.foot_links[foot]
        if not set(kinematics.chain(link)) & set(kinematics.joints) <= set(take.joints):
            continue
        p, R = poses[link]
        p_B = np.einsum("nji,nmj->nmi", R_RB, (p - p_RB)[:, None] + np.einsum("nij,mj->nmi", R, points))
        out[foot] = take.p_WB[:, 2] + (np.einsum("ni,nmi->nm", z_axis, p_B) - radii).min(axis=1)
    return out


def _rest_height(take: Take, heights: dict[str, Array]) -> float:
    """Height of the base link's origin above the feet before the first command (or in the first frames) [m]."""
    assert take.p_WB is not None
    use = take.resting if take.resting.any() else np.arange(len(take)) < 10
    over = [np.nanmedian(take.p_WB[use, 2] - z[use]) for z in heights.values() if np.isfinite(z[use]).any()]
    return float(np.median(over)) if over else float("nan")


def _phases(take: Take, stance: Mask, known: Mask) -> FootPhases:
    stance = _without_chatter(stance | ~known, take.time)
    end = take.starts_at + take.commands.end if take.commands is not None else take.time[-1]
    moving = (take.since_start >= 0) & (take.time <= end)
    down = np.flatnonzero(np.diff(stance.astype(int)) == 1) + 1
    falls = take.time[down[known[down] & known[down - 1] & moving[down]]]
    use = moving & known
    return FootPhases(stance & known, known, falls, float(stance[use].mean()) if use.any() else float("nan"))


def _without_chatter(stance: Mask, time: Array) -> Mask:
    """Joins phases below SHORTEST to their neighbours, the shortest first; the first and the last phase are kept."""
    stance = stance.copy()
    while True:
        edges = np.concatenate([[0], np.flatnonzero(np.diff(stance.astype(int))) + 1, [len(stance)]])
        lengths = np.append(time, time[-1])[edges[1:]] - time[edges[:-1]]
        inner = lengths[1:-1]
        if not len(inner) or inner.min() >= COMPARE.shortest:
            return stance
        i = int(np.argmin(inner)) + 1
        stance[edges[i] : edges[i + 1]] ^= True
