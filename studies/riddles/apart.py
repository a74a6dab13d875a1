"""How far a recording is from what another explanation says it would be, channel by channel, in sigma.

Sigma is the root of noise², numerical floor² and contact spread²: of what a recording and a simulation of one and the same robot
differ by. Noise alone gives 1; the contract's bound for "explained" is 1.3.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.common import body_track
from studies.riddles.cameras import Recorded, record
from studies.riddles.hypotheses import Run
from workbench.compare.comparison import compare_takes
from workbench.compare.metrics import lag, rms
from workbench.compare.results import Channel, TakeComparison
from workbench.motion import Trajectory
from workbench.recording.take import Take
from workbench.robot import RobotModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Apart:
    """A recording of one hypothesis beside the simulation of another. off_axis: joint -> RMS of what its servo does not turn
    [rad], recorded less simulated."""

    recorded: Recorded
    compared: TakeComparison
    off_axis: Mapping[str, Channel]

    def sigma(self, joint: str) -> float:
        """Of a joint's angle."""
        return sigma(self.compared.joints[joint])

    def worst(self) -> str:
        """The joint whose angle is furthest apart."""
        return max(self.compared.joints, key=self.sigma)

    def worst_off_axis(self) -> str:
        """The joint that is furthest apart off its axis."""
        return max(self.off_axis, key=lambda j: sigma(self.off_axis[j]))


def sigma(c: Channel) -> float:
    """Error of a channel over noise, floor and spread together, those that are known."""
    below = math.sqrt(sum(x * x for x in (c.noise, c.floor, c.spread) if math.isfinite(x)))
    return c.error / below if below > 0 else math.nan


def apart(truth: Run, model: Run, nominal: RobotModel, seconds: float, seed: int = 1) -> Apart:
    """Records `truth` and compares the recording with what `model` says; floor and spread are those of `model`."""
    recorded = record(truth.take, nominal, seconds, model.take, seed)
    finer, other = ([recorded.view(t, nominal) for t in takes] for takes in (model.finer, model.other_contact))
    simulated = recorded.view(model.take, nominal)
    compared = compare_takes(recorded.take, simulated, nominal, finer=finer, other_contact=other)
    return Apart(recorded, compared, _off_axis(recorded.take, simulated, finer, other))


def _off_axis(recorded: Take, simulated: Take, finer: list[Take], other: list[Take]) -> dict[str, Channel]:
    assert recorded.off_axis is not None
    out = {}
    use = recorded.since_start >= 0
    rest = recorded.resting
    for i, joint in enumerate(recorded.joints):
        seen = _swing(simulated, joint)
        error = float(rms(np.linalg.norm(recorded.off_axis[use, i] - seen[use], axis=1)))
        noise = float(np.linalg.norm(np.nanstd(recorded.off_axis[rest, i], axis=0)))
        floor, spread = (max((float(rms(np.linalg.norm(_swing(t, joint)[use] - seen[use], axis=1))) for t in takes),
                             default=math.nan) for takes in (finer, other))
        out[joint] = Channel(error, noise, floor, spread)
    return out


def _swing(take: Take, joint: str) -> Array:
    """(N, 3) [rad] off a joint's axis; zero where the robot is built as the model."""
    return np.zeros((len(take), 3)) if take.off_axis is None else np.nan_to_num(take.off_axis[:, take.column(joint)])


@dataclass(frozen=True)
class Number:
    """One number of a run with how far finer steps and the other contact model move it."""

    value: float
    floor: float = math.nan
    spread: float = math.nan

    @property
    def doubt(self) -> float:
        """Floor and spread together."""
        return math.sqrt(sum(x * x for x in (self.floor, self.spread) if math.isfinite(x)))


def number(run: Run, of: Callable[[Take], float]) -> Number:
    """A number of a run."""
    value = of(run.take)
    floor, spread = (max((abs(of(t) - value) for t in takes), default=math.nan) for takes in (run.finer, run.other_contact))
    return Number(value, floor, spread)


def end_of(coordinate: int, seconds: float) -> Callable[[Take], float]:
    """Where the body is after so long, in the thesis's axes (studies.common.COORDINATES)."""
    def end(take: Take) -> float:
        return float(body_track(take, np.linspace(0.0, seconds - 2e-3, 2 + int(seconds / 0.02)))[-1, coordinate])
    return end


def lag_over_time(take: Take, reference: Trajectory, cycle: float, cycles: int = 2) -> tuple[Array, Array]:
    """Middles (W,) [s] of windows of so many `cycle` [s], one window a cycle, and each joint's lag (W, n) [s] in them behind
    `reference`, in the take's order of joints; NaN where a joint does not move."""
    clock = take.since_start
    length = cycles * cycle
    begins = np.arange(0.0, clock[-1] - length - 0.01, cycle)
    middles, out = [], []
    shift = np.zeros(len(take.joints))
    for begin in begins:
        # the window moves with the lag, so that it always holds the same phases of the gait
        at = begin + float(np.median(shift))
        if at + length > clock[-1]:
            break
        near, inside = (clock >= at - 0.25) & (clock < at + length + 0.25), (clock >= at) & (clock < at + length)
        found = _lags(take, near, inside[near], reference, shift)
        shift = np.where(np.isfinite(found), found, float(np.nanmedian(found)))
        middles.append(at + length / 2)
        out.append(found)
    return np.array(middles), np.array(out)


def _lags(take: Take, near: NDArray[np.bool_], inside: NDArray[np.bool_], reference: Trajectory, shift: Array) -> Array:
    """Each joint's lag (n,) [s] in the frames `inside` of those `near`, sought within 0.1 s about `shift` (n,) [s]."""
    since = take.since_start[near]
    asked = np.column_stack([np.interp(since - late, reference.time, reference.q[:, reference.column(j)])
                             for j, late in zip(take.joints, shift)])
    return np.asarray(shift + lag(since, take.q[near], asked, inside, np.full(len(shift), np.radians(0.2)), most=0.1))


@dataclass(frozen=True)
class Growth:
    """A straight line through a lag: slope [s/s], its standard error from the scatter about the line, and the lag at time 0 [s].
    by_joint: each joint's own slope."""

    slope: float
    sigma: float
    at_start: float
    by_joint: Mapping[str, float]


def growth(take: Take, reference: Trajectory, cycle: float, upto: float = math.inf) -> Growth:
    """How a take's lag grows: the median over joints in each window, then a straight line, the first cycle left out."""
    time, late = lag_over_time(take, reference, cycle)
    use = (time > 2 * cycle) & (time < upto)
    time, late = time[use], late[use]
    middle = np.nanmedian(late, axis=1)
    (slope, at), residual = _line(time, middle)
    error = residual / math.sqrt(max(float(np.sum((time - time.mean()) ** 2)), 1e-12)) * math.sqrt(2.0)  # windows overlap by half
    joints = {j: _line(time, late[:, i])[0][0] for i, j in enumerate(take.joints) if np.isfinite(late[:, i]).all()}
    return Growth(slope, error, at, joints)


def _line(x: Array, y: Array) -> tuple[tuple[float, float], float]:
    slope, at = np.polyfit(x, y, 1)
    return (float(slope), float(at)), float(np.std(y - slope * x - at, ddof=min(2, len(x) - 1)))
