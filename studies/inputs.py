"""What the thesis fed its simulation with, shared by the studies: the ROBOTIS angles, recorded angles, and its two filters.

"Own filter": cubics that rest at each sample, derivatives smoothed by Savitzky-Golay (6.7). "MATLAB filter": the low-pass of
Simulink's converter (6.8). Neither polynomial order nor time constant is stated in the thesis: the order is 3 here, the window
1001 samples, and the time constant the one that comes closest to it, as the thesis says it does (7.2.2). Both filter the angles
themselves, as Drake's joints cannot have a velocity that contradicts their angle; `studies.filters` measures what that changes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.compare.session import load_session
from workbench.compare.session_takes import RegisteredTake, read_takes, register_takes
from workbench.motion import (
    Trajectory,
    filter_derivatives,
    interpolate,
    interpolate_motion,
    load_motion,
    low_pass,
    savitzky_golay,
)
from workbench.motion.smoothing import Knots
from workbench.recording.take import Take
from workbench.robot import RobotModel, data_file
from workbench.simulation import Job, SimulationConfig, simulate_batch

Array = NDArray[np.float64]

STEP = 1e-4
ORDER = 3
WINDOW = 1001
JOINT = "flb"  # the one that the thesis shows
SECONDS = 6.0
CYCLES = 13
LEAD = 0.3
MIDDLE = slice(2000, -2000)  # clear of what the ends do to a filter
KNOTS: tuple[Knots, Knots] = ("rest", "smooth")


def robotis() -> tuple[Trajectory, Trajectory]:
    """The walk's own angles, joined as in the thesis, and joined by a smooth spline; six seconds every STEP."""
    motion = load_motion(data_file("robotis_walk.csv"))
    rest, smooth = (interpolate_motion(motion, CYCLES, STEP, knots) for knots in KNOTS)
    return first_seconds(rest), first_seconds(smooth)


def recording() -> RegisteredTake:
    """The bundled recording, which is synthetic (the puppy in another engine), read and registered as any of the robot."""
    session = load_session(data_file("synthetic_walk/session.yaml"))
    takes, _ = read_takes(session)
    jobs = [Job(t.model, SimulationConfig(), t.commands, t.duration, LEAD) for t in takes]
    rollouts = {t.spec.name: rollout for t, rollout in zip(takes, simulate_batch(jobs))}
    registered, _ = register_takes(session, takes, rollouts)
    return registered[0]


def recorded_angles(take: Take) -> Trajectory:
    """A recording's angles from the first command on, six seconds every STEP, joined as in the thesis; gaps bridged."""
    since = take.since_start
    frames = (since > 1e-6) & (since < SECONDS + 0.1)
    times = np.concatenate([[0.0], since[frames]])
    angles = np.empty((len(times), len(take.joints)))
    for i, column in enumerate(take.q.T):
        seen = np.isfinite(column)
        angles[:, i] = np.interp(times, since[seen], column[seen])
    return first_seconds(interpolate(times, take.joints, angles, STEP, knots="rest"))


def own_filter(raw: Trajectory) -> Trajectory:
    """The thesis's own filter, of the angles themselves."""
    return savitzky_golay(raw, WINDOW, ORDER)


def matlab_filter(raw: Trajectory) -> Trajectory:
    """Simulink's low-pass, about as strong; it lags."""
    return low_pass(raw, comparable_time_constant(raw, WINDOW))


def comparable_time_constant(raw: Trajectory, window: int) -> float:
    """Time constant [s] of the low-pass whose velocity, its lag taken out, is nearest to that of a window."""
    i = raw.column(JOINT)
    one = replace(raw, joints=(JOINT,), q=raw.q[:, i:i + 1], v=raw.v[:, i:i + 1], a=raw.a[:, i:i + 1])
    goal = filter_derivatives(one, window, ORDER).v

    def distance(T: float) -> float:
        early = np.roll(low_pass(one, T).v, -round(2 * T / STEP), axis=0)
        return float(np.mean((early - goal)[MIDDLE] ** 2))

    return float(min(np.geomspace(1e-3, 0.1, 41), key=distance))


def ideal_job(model: RobotModel, config: SimulationConfig, path: Trajectory, seconds: float = SECONDS,
              name: str = "ideal") -> Job:
    """Joints that follow `path` ideally, as in the thesis's inverse dynamics.

    Before it, in LEAD [s], they go from neutral to its first angles. The reference has a row for each step, so that its
    corners are no coarser than the step.
    """
    every = min(config.time_step or 1e-3, 1e-3)
    times = np.asarray(np.arange(round(seconds / every) + 1) * every, dtype=np.float64)
    angles: Array = np.zeros((len(times), len(model.joints)))
    for joint in path.joints:
        angles[:, model.joints.index(joint)] = np.interp(times, path.time, path.q[:, path.column(joint)])
    return Job(model, config, None, seconds, LEAD, (times, angles), name=name)


def first_seconds(path: Trajectory, seconds: float = SECONDS) -> Trajectory:
    """The first part of a trajectory."""
    n = round(seconds / STEP) + 1
    return replace(path, time=path.time[:n], q=path.q[:n], v=path.v[:n], a=path.a[:n])
