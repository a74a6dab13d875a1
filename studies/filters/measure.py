"""Two inputs of the thesis, each under each of its filters, and what the body makes of them.

"Own filter": cubics that rest at each sample, derivatives smoothed by Savitzky-Golay (6.7). "MATLAB filter": the low-pass of
Simulink's converter (6.8). Neither polynomial order nor time constant is stated in the thesis: the order is 3 here, and the time
constant the one that comes closest to window 1001, as the thesis says it does (7.2.2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from workbench.motion import (
    Trajectory,
    filter_derivatives,
    inconsistency,
    interpolate,
    interpolate_motion,
    load_motion,
    low_pass,
    savitzky_golay,
)
from workbench.motion.smoothing import Knots
from workbench.robot import RobotModel, data_file
from workbench.simulation import Simulation, SimulationConfig
from workbench.simulation.play import play_motion

Array = NDArray[np.float64]
Filter = Callable[[Trajectory], Trajectory]

WINDOWS = (91, 1001, 2001)
ORDER = 3
STEP = 1e-4
JOINT = "flb"  # the one that the thesis shows
SECONDS = 6.0
CYCLES = 13
CYCLE = 0.468
RATE = 120.0
NOISE = np.radians(0.12)
NAMES = ("unfiltered", *(f"window {w}" for w in WINDOWS), "low-pass")
MIDDLE = slice(2000, -2000)  # clear of what the ends do to a filter
KNOTS: tuple[Knots, Knots] = ("rest", "smooth")
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
    """

    title: str
    reference: tuple[str, Trajectory]
    rows: list[Row]
    paths: dict[str, Trajectory]
    tracks: dict[str, Array]
    floor: list[Array]
    like: dict[int, float]

    def row(self, name: str) -> Row:
        """A filter's row."""
        return next(r for r in self.rows if r.filter == name)

    def spread(self, coordinate: int) -> tuple[float, float]:
        """Of the body's end over the three windows, and over the floor's runs."""
        windows = [self.tracks[f"window {w}"][-1, coordinate] for w in WINDOWS]
        return float(np.ptp(windows)), float(np.ptp([t[-1, coordinate] for t in self.floor]))


def capture(model: RobotModel) -> tuple[Trajectory, Trajectory, dict[str, float]]:
    """A synthetic capture of the walk, noisy angles joined by cubics that rest at each frame, and the truth at the same times.

    Also the velocity error of JOINT [deg/s] that the noise alone and the resting alone make.
    """
    take = play_motion(Simulation(model, SimulationConfig()), load_motion(data_file("robotis_walk.csv")), CYCLES)
    frames = take.resampled(np.arange(0.0, SECONDS + 1e-9, 1 / RATE))
    noisy = frames.q + np.random.default_rng(0).normal(0, NOISE, frames.q.shape)
    raw = interpolate(frames.time, take.joints, noisy, STEP, knots="rest")
    fine = take.resampled(raw.time)
    assert fine.v is not None
    truth = replace(raw, q=fine.q, v=fine.v, a=np.gradient(fine.v, STEP, axis=0))
    alone = {"noise": interpolate(frames.time, take.joints, noisy, STEP, knots="smooth"),
             "rest": interpolate(frames.time, take.joints, frames.q, STEP, knots="rest")}
    return raw, truth, {what: velocity_error(path, truth) for what, path in alone.items()}


def robotis() -> tuple[Trajectory, Trajectory]:
    """The walk's own angles, joined as in the thesis, and joined by a smooth spline."""
    motion = load_motion(data_file("robotis_walk.csv"))
    n = round(SECONDS / STEP) + 1
    rest, smooth = (interpolate_motion(motion, CYCLES, STEP, knots) for knots in KNOTS)
    return _first(rest, n), _first(smooth, n)


def comparable_time_constant(raw: Trajectory, window: int) -> float:
    """Time constant [s] of the low-pass whose velocity, its lag taken out, is nearest to that of a window."""
    i = raw.column(JOINT)
    one = replace(raw, joints=(JOINT,), q=raw.q[:, i:i + 1], v=raw.v[:, i:i + 1], a=raw.a[:, i:i + 1])
    goal = filter_derivatives(one, window, ORDER).v

    def distance(T: float) -> float:
        early = np.roll(low_pass(one, T).v, -round(2 * T / STEP), axis=0)
        return float(np.mean((early - goal)[MIDDLE] ** 2))

    return float(min(np.geomspace(1e-3, 0.1, 41), key=distance))


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


def walk(simulation: Simulation, path: Trajectory) -> Array:
    """Six seconds with joints that follow the angles ideally, as in the thesis's inverse dynamics.

    Returns the base's way forward and to the left [cm] and its heading, left [deg], (N, 3) at every millisecond.
    """
    every = round(1e-3 / STEP)
    angles = np.zeros((len(path.time[::every]), len(simulation.joints)))
    for joint in path.joints:
        angles[:, simulation.joints.index(joint)] = path.q[::every, path.column(joint)]
    take = simulation.run(duration=SECONDS, lead=0.3, trajectory=(path.time[::every], angles))
    take = take.resampled(np.linspace(0, SECONDS - 1e-6, 6000))
    assert take.p_WB is not None
    assert take.quat_WB is not None
    yaw = np.unwrap(Rotation.from_quat(take.quat_WB, scalar_first=True).as_euler("ZYX")[:, 0])
    track = np.column_stack([take.p_WB[:, :2] * 100, np.degrees(yaw)])
    return np.asarray(track - track[0])


def study(model: RobotModel, title: str, raw: Trajectory, reference: tuple[str, Trajectory]) -> Result:
    """All filters on one input."""
    like = {w: comparable_time_constant(raw, w) for w in WINDOWS[1:]}
    simulation = Simulation(model, IDEAL)
    result = Result(title, reference, [], {}, {}, [], like)
    for name, (shown, played) in filters(like[WINDOWS[1]]).items():
        print(f"{title}: {name}", flush=True)
        path = result.paths[name] = shown(raw)
        track = result.tracks[name] = walk(simulation, played(raw))
        result.rows.append(Row(name, velocity_error(path, reference[1]), lag(path, raw),
                               float(np.degrees(inconsistency(path).max())), *(float(x) for x in track[-1])))
    print(f"{title}: numerical floor", flush=True)
    others = [replace(IDEAL, time_step=h) for h in (5e-4, 2.5e-4)]
    others += [replace(IDEAL, approximation=a) for a in ("sap", "similar")]
    result.floor.extend([result.tracks["unfiltered"], *(walk(Simulation(model, c), raw) for c in others)])
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


def _first(path: Trajectory, n: int) -> Trajectory:
    return replace(path, time=path.time[:n], q=path.q[:n], v=path.v[:n], a=path.a[:n])
