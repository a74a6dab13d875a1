"""Smaller riddles: the last pose that may not be sent, the first pose that comes late, and the body that leans back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.common import COORDINATES, body_track
from studies.riddles.cameras import record
from studies.riddles.hypotheses import LEAD, Hypothesis, Progress, Setting, run_all, walk
from workbench.motion import Commands, Motion
from workbench.recording.take import Take
from workbench.robot import RobotModel, foot_points
from workbench.simulation import Job, SimulationConfig
from workbench.simulation.batch import run_job

Array = NDArray[np.float64]

ALL, LAST = "all poses", "last pose missing"
WALKED, AFTER = 4, 0.6
"""Cycles walked, and how long the robot stands after them [s]."""


def without_last(commands: Commands) -> Commands:
    """Algorithm 3.1 read literally: it steps on, finds itself at the last pose and resets, before that is sent."""
    k = len(commands.times) - 1
    return Commands(commands.times[:k], commands.joints, commands.goals[:k], commands.speeds[:k], commands.enabled[:k],
                    float(commands.times[k]), commands.poses[:k])


@dataclass(frozen=True)
class Result:
    """All of it. stands: hypothesis -> joint -> recorded angle at which it comes to stand [rad]. noise: of a joint's angle, mean
    over frames that stand [rad], the worst joint. late: joint -> how far it is from pose 1 when pose 2 is sent [rad]: of the
    reference in the first cycle, recorded in the first, recorded in the later ones (median). lean: nose up [deg], of the geometry
    alone, at rest with the servo law, at rest with ideal joints, mean of the walk."""

    takes: Mapping[str, Take]
    stands: Mapping[str, Mapping[str, float]]
    noise: float
    late: Mapping[str, tuple[float, float, float]]
    lean: Mapping[str, float]


def measure(model: RobotModel, progress: Progress) -> Result:
    """All runs and what is read off their recordings."""
    motion = walk()
    end = WALKED * motion.duration + AFTER
    runs = run_all([Hypothesis(ALL, ""), Hypothesis(LAST, "", sends=without_last)], model, Setting(end, motion, WALKED), progress)
    takes = {n: record(r.take, model, end, runs[ALL].take).take for n, r in runs.items()}
    stands, noise = {}, 0.0
    for name, take in takes.items():
        late = take.since_start > end - 0.25
        stands[name] = {j: float(take.q[late, i].mean()) for i, j in enumerate(take.joints)}
        noise = max(noise, float((take.q[late].std(axis=0, ddof=1) / np.sqrt(late.sum())).max()))
    ideal = run_job(Job(model, SimulationConfig(drive="ideal", contact_period=0.0), None, 0.1, LEAD,
                        (np.array([0.0, 0.1]), np.zeros((2, len(model.joints))))))
    nose = COORDINATES.index("rz")
    walking = body_track(runs[ALL].take, np.linspace(motion.duration, WALKED * motion.duration, 400))
    lean = {"geometry": geometric_lean(model), "servo law": float(body_track(runs[ALL].take, np.array([0.0]))[0, nose]),
            "ideal joints": float(body_track(ideal, np.array([0.0]))[0, nose]), "walk": float(walking[:, nose].mean())}
    return Result(takes, stands, noise, lateness(takes[ALL], motion), lean)


def lateness(take: Take, motion: Motion) -> dict[str, tuple[float, float, float]]:
    """How far each joint is from pose 1 when pose 2 is sent [rad]: its reference and the joint in cycle 1, the joint later."""
    commands = motion.commands(WALKED)
    second = commands.times[commands.poses == 1]
    reference = commands.reference(second - 1e-6)
    out = {}
    for i, joint in enumerate(take.joints):
        c = commands.column(joint)
        goal = commands.goals[0, c]
        at = np.interp(second, take.since_start, take.q[:, i])
        out[joint] = float(abs(goal - reference[0, c])), float(abs(goal - at[0])), float(np.median(np.abs(goal - at[1:])))
    return out


def geometric_lean(model: RobotModel) -> float:
    """Nose up [deg] of the neutral pose with rigid joints on four feet: the slope between the lowest points of hind and front."""
    poses = model.kinematics.forward(np.zeros((1, len(model.joints))))
    low = {}
    for foot, (points, radii) in foot_points(model).items():
        p, R = poses[model.foot_links[foot]]
        world = p[0] + points @ R[0].T
        i = int(np.argmin(world[:, 2] - radii))
        low[foot] = world[i, 0], world[i, 2] - radii[i]
    front, hind = (np.mean([low[f] for f in low if f[0] == end], axis=0) for end in "fb")
    return float(np.degrees(np.arctan2(hind[1] - front[1], front[0] - hind[0])))
