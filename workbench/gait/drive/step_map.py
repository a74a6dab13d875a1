"""The step-to-step map: heading change and displacement of one cycle of the gait as functions of what it is steered by.

    heading(k+1) = heading(k) + bias + gain · turn(k) + memory · turn(k-1) + side_turns · side(k)
    aside(k) = aside + aside_gain · turn(k) + side_gain · side(k), ahead its mean: in the body's frame at the cycle's beginning

fitted by least squares to rollouts in which each cycle's turn and sideways stride are drawn at random. Its residuals are the
gait's own scatter from cycle to cycle, which no controller that acts once a cycle can remove.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.compare.metrics import heading
from workbench.files import InputError
from workbench.gait.drive.family import GaitFamily, Steer
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import Job, SimulationConfig, simulate_batch
from workbench.types import Array


@dataclass(frozen=True)
class MapOptions:
    """How the map is fitted.

    cycles: of each rollout; 30 give each of five numbers some fifteen independent samples. rollouts: of one model. most: largest
    turn asked [rad per stance]; beyond 0.15 the puppy's feet leave their reach. most_side: largest sideways stride asked [m per
    stance]. hold: cycles for which both are kept, so that gain and memory show. time_step: of the simulation [s].
    """

    cycles: int = 30
    rollouts: int = 3
    most: float = 0.15
    most_side: float = 0.008
    hold: int = 2
    time_step: float = 1e-3


@dataclass(frozen=True)
class StepMap:
    """bias [rad per cycle], gain and memory [rad per rad of turn], ahead and aside [m per cycle], aside_gain [m per rad of turn],
    side_gain [m per m of sideways stride], side_turns [rad per m]: both 0 where sideways strides were not asked; scatter:
    standard deviation of one cycle's heading change [rad] and of its aside [m] about the map. most: largest turn [rad] that it
    was fitted to."""

    bias: float
    gain: float
    memory: float
    ahead: float
    aside: float
    aside_gain: float
    scatter: tuple[float, float]
    most: float
    side_gain: float = 0.0
    side_turns: float = 0.0

    def turned(self, steer: Steer, before: float) -> float:
        """Heading change of a cycle [rad] after one with the turn `before`, without the robot's own bias beyond the map's."""
        return self.bias + self.gain * steer.turn + self.memory * before + self.side_turns * steer.side

    def moved_aside(self, steer: Steer) -> float:
        """How far a cycle moves aside [m] beyond `aside`."""
        return self.aside_gain * steer.turn + self.side_gain * steer.side


def cycle_poses(take: Take, begin: float, period: float, cycles: int) -> Array:
    """x, y [m] and heading [rad] of the base at the beginning of each cycle and the end of the last, (cycles + 1, 3). begin: of
    the first cycle [s after the first command]."""
    assert take.p_WB is not None
    assert take.quat_WB is not None
    times = begin + period * np.arange(cycles + 1) + (0.0 if np.isnan(take.starts_at) else take.starts_at)
    columns = [take.p_WB[:, 0], take.p_WB[:, 1], heading(take.quat_WB)]
    return np.column_stack([np.interp(times, take.time, c) for c in columns])


def fit_step_map(family: GaitFamily, model: RobotModel, seed: int = 0, options: MapOptions | None = None) -> StepMap:
    """The map of one robot. InputError where the robot falls, or steering does nothing to it."""
    options = options or MapOptions()
    rng = np.random.default_rng(seed)
    drawn = rng.uniform(-1.0, 1.0, (options.rollouts, -(-options.cycles // options.hold), 2)) * [options.most, options.most_side]
    asked = [[Steer(*u) for u in rows] for rows in np.repeat(drawn, options.hold, axis=1)[:, :options.cycles].tolist()]
    config = SimulationConfig(time_step=options.time_step, contact_period=0.0, log_period=0.01)
    begin = family.start_seconds
    seconds = begin + options.cycles * family.period
    takes = simulate_batch([Job(model, config, family.sequence(u), seconds) for u in asked])
    rows, changes = [], []
    for take, steers in zip(takes, asked):
        if fell(take):
            raise InputError(None, "the robot falls while its turning is varied; this gait cannot be steered")
        A, moved = rows_of(take, steers, family)
        rows.append(A)
        changes.append(moved)
    return fit_increments(np.concatenate(rows), np.concatenate(changes), options.most, steered=True)


def rows_of(take: Take, steers: Sequence[Steer], family: GaitFamily) -> tuple[Array, Array]:
    """Rows for `fit_increments` of a take that was steered so, without the first two cycles, which the start still moves."""
    moved = increments(cycle_poses(take, family.start_seconds, family.period, len(steers)))
    turns, sides = np.array([[u.turn, u.side] for u in steers]).T
    return np.column_stack([np.ones(len(turns) - 1), turns[1:], turns[:-1], sides[1:]])[1:], moved[2:]


def increments(poses: Array) -> Array:
    """Increments (N, 3) between poses (N + 1, 3): ahead and aside [m] in the frame at each cycle's beginning, and heading change
    [rad]."""
    step, yaw = np.diff(poses, axis=0), poses[:-1, 2]
    ahead = np.cos(yaw) * step[:, 0] + np.sin(yaw) * step[:, 1]
    aside = -np.sin(yaw) * step[:, 0] + np.cos(yaw) * step[:, 1]
    return np.column_stack([ahead, aside, np.arctan2(np.sin(step[:, 2]), np.cos(step[:, 2]))])


def fit_increments(A: Array, changes: Array, most: float, steered: bool = False) -> StepMap:
    """Least squares: A (N, 4) of ones, turns and the turns before [rad], and sideways strides [m]; changes (N, 3) as `increments`
    gives them. steered: InputError where the largest turn changes the heading by less than its scatter."""
    here = A[:, [0, 1, 3]]
    turning, *_ = np.linalg.lstsq(A, changes[:, 2], rcond=None)
    side, *_ = np.linalg.lstsq(here, changes[:, 1], rcond=None)
    left = float(np.std(changes[:, 2] - A @ turning, ddof=4)), float(np.std(changes[:, 1] - here @ side, ddof=3))
    gain = float(turning[1])
    if steered and abs(gain) * most < left[0]:
        turns, scatter = np.rad2deg(abs(gain) * most), np.rad2deg(left[0])
        raise InputError(None, f"steering by {most:g} rad turns this gait by {turns:.1f} deg a cycle, less than its scatter "
                               f"({scatter:.1f} deg); it cannot be steered")
    ahead = float(changes[:, 0].mean())
    return StepMap(float(turning[0]), gain, float(turning[2]), ahead, float(side[0]), float(side[1]), left, most,
                   float(side[2]), float(turning[3]))


def fell(take: Take) -> bool:
    """Whether the base was ever farther than 45 deg from upright."""
    assert take.quat_WB is not None
    x, y = take.quat_WB[:, 1], take.quat_WB[:, 2]
    return bool(np.min(1 - 2 * (x**2 + y**2)) < np.cos(np.radians(45)))
