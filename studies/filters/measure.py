"""Two inputs of the thesis, each under each of its filters, and what the body makes of them.

What the filters are: studies/inputs.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from studies.common import COORDINATES, body_track
from studies.inputs import CYCLES, JOINT, MIDDLE, ORDER, SECONDS, STEP, comparable_time_constant, ideal_job, robotis
from workbench.motion import Trajectory, filter_derivatives, inconsistency, interpolate, load_motion, low_pass, savitzky_golay
from workbench.robot import RobotModel, data_file
from workbench.simulation import Simulation, SimulationConfig
from workbench.simulation.batch import run_job
from workbench.simulation.play import play_motion

__all__ = ["capture", "comparable_time_constant", "robotis", "study"]

Array = NDArray[np.float64]
Filter = Callable[[Trajectory], Trajectory]

WINDOWS = (91, 1001, 2001)
CYCLE = 0.468
RATE = 120.0
NOISE = np.radians(0.12)
NAMES = ("unfiltered", *(f"window {w}" for w in WINDOWS), "low-pass")
IDEAL = SimulationConfig(drive="ideal", contact_period=0.0)


@dataclass(frozen=True)
class Row:
    """One filter on one input.

    velocity_error: of JOINT, RMS [deg/s]. lag: of its velocity behind the unfiltered one [ms]. stray: by how much the worst
    joint's v is not the derivative of its q [deg]. x, left [cm], heading [deg, left]: where the body ends.
    """

    filter: str
    velocity_error: float
    lag: float
    stray: float
    x: float
    left: float
    heading: float


@dataclass(frozen=True)
class Result:
    """One input.

    reference: what velocities are measured by. paths: filtered as in the thesis. tracks: the body's, (N, 3) [cm, cm, deg]. floor:
    tracks of the unfiltered run at other steps and contact approximations. like: time constant [s] comparable to a window.
    seconds: length of the tracks.
    """

    title: str
    reference: tuple[str, Trajectory]
    rows: list[Row]
    paths: dict[str, Trajectory]
    tracks: dict[str, Array]
    floor: list[Array]
    like: dict[int, float]
    seconds: float = SECONDS

    def row(self, name: str) -> Row:
        """A filter's row."""
        return next(r for r in self.rows if r.filter == name)

    def spread(self, coordinate: int) -> tuple[float, float]:
        """Of the body's end over the three windows, and over the floor's runs."""
        windows = [self.tracks[f"window {w}"][-1, coordinate] for w in WINDOWS]
        return float(np.ptp(windows)), float(np.ptp([t[-1, coordinate] for t in self.floor]))


def capture(model: RobotModel, seconds: float = SECONDS) -> tuple[Trajectory, Trajectory, dict[str, float]]:
    """A synthetic capture of the walk, noisy angles joined by cubics that rest at each frame, and the truth at the same times.

    Also the velocity error of JOINT [deg/s] that the noise alone and the resting alone make.
    """
    take = play_motion(Simulation(model, SimulationConfig()), load_motion(data_file("robotis_walk.csv")), CYCLES)
    frames = take.resampled(np.arange(0.0, seconds + 1e-9, 1 / RATE))
    noisy = frames.q + np.random.default_rng(0).normal(0, NOISE, frames.q.shape)
    raw = interpolate(frames.time, take.joints, noisy, STEP, knots="rest")
    fine = take.resampled(raw.time)
    assert fine.v is not None
    truth = replace(raw, q=fine.q, v=fine.v, a=np.gradient(fine.v, STEP, axis=0))
    alone = {"noise": interpolate(frames.time, take.joints, noisy, STEP, knots="smooth"),
             "rest": interpolate(frames.time, take.joints, frames.q, STEP, knots="rest")}
    return raw, truth, {what: velocity_error(path, truth) for what, path in alone.items()}


def velocity_error(path: Trajectory, truth: Trajectory) -> float:
    """RMS difference of JOINT's velocities [deg/s], clear of the ends."""
    i = path.column(JOINT)
    return float(np.degrees(np.sqrt(np.mean((path.v - truth.v)[MIDDLE, i] ** 2))))


def lag(path: Trajectory, raw: Trajectory) -> float:
    """Delay [ms] of JOINT's velocity at which it is nearest to the unfiltered one."""
    i = path.column(JOINT)
    shifts = range(-100, 601)
    best = min(shifts, key=lambda s: float(np.mean((np.roll(path.v[:, i], -s) - raw.v[:, i])[MIDDLE] ** 2)))
    return best * STEP * 1e3


def walk(model: RobotModel, config: SimulationConfig, path: Trajectory, seconds: float) -> Array:
    """A walk with joints that follow the angles ideally, as in the thesis's inverse dynamics.

    Returns the base's way forward and to the left [cm] and its heading, left [deg], (N, 3) at every millisecond.
    """
    take = run_job(ideal_job(model, config, path, seconds))
    track = body_track(take, np.linspace(0, seconds - 1e-6, round(1e3 * seconds)))
    return np.asarray(track[:, [COORDINATES.index(c) for c in ("x", "z", "ry")]] * [1, -1, 1])


def study(model: RobotModel, title: str, raw: Trajectory, reference: tuple[str, Trajectory],
          progress: Callable[[str, float | None], None], seconds: float = SECONDS) -> Result:
    """All filters on one input."""
    like = {w: comparable_time_constant(raw, w) for w in WINDOWS[1:]}
    result = Result(title, reference, [], {}, {}, [], like, seconds)
    for name, (shown, played) in filters(like[WINDOWS[1]]).items():
        progress(f"{title}: {name}", None)
        path = result.paths[name] = shown(raw)
        track = result.tracks[name] = walk(model, IDEAL, played(raw), seconds)
        result.rows.append(Row(name, velocity_error(path, reference[1]), lag(path, raw),
                               float(np.degrees(inconsistency(path).max())), *(float(x) for x in track[-1])))
    progress(f"{title}: numerical floor", None)
    others = [replace(IDEAL, time_step=h) for h in (5e-4, 2.5e-4)]
    others += [replace(IDEAL, approximation=a) for a in ("sap", "similar")]
    result.floor.extend([result.tracks["unfiltered"], *(walk(model, c, raw, seconds) for c in others)])
    return result


def filters(T: float) -> Mapping[str, tuple[Filter, Filter]]:
    """Name -> what the thesis does to the derivatives, and a consistent filter of the angles, as strong, to simulate."""
    def same(raw: Trajectory) -> Trajectory:
        return raw

    out: dict[str, tuple[Filter, Filter]] = {"unfiltered": (same, same)}
    for window in WINDOWS:
        out[f"window {window}"] = (partial(filter_derivatives, window=window, order=ORDER),
                                   partial(savitzky_golay, window=window, order=ORDER))
    return out | {"low-pass": (partial(low_pass, time_constant=T), partial(low_pass, time_constant=T))}
