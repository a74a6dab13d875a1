"""The growing lag (thesis, 7.2.1): rounded milliseconds, or what else?"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from studies.riddles.apart import Apart, Growth, Number, apart, growth, lag_over_time, number
from studies.riddles.cameras import RATE, record
from studies.riddles.hypotheses import Hypothesis, Progress, Run, Setting, run_all, walk
from workbench.motion import Commands, Motion, interpolate_motion
from workbench.recording.take import Take
from workbench.robot import EffectSpec, RobotModel

Array = NDArray[np.float64]

ROUNDED, EXACT, UP, PACKET, CLOCK = "rounded", "not rounded", "rounded up", "loss per pose", "slow clock"
WEAK, SAG, FADE = "weak supply", "sagging supply", "warming motors"
SYNC_WRITE = 83 * 10 / 1e6
"""Time on the bus of one Sync Write of goal and speed to 15 servos [s]: 83 bytes of ten bits at 1 Mbit/s."""
SECONDS, SHORT = 30.0, 6.0
CYCLES = 65
SLOWER = 2.0
"""How much longer each dwell is in the recording that decides."""
FINE = 2.5e-4


def with_dwells(commands: Commands, dwells: Array) -> Commands:
    """The commands with other dwells (P,) [s] of the poses."""
    ends = np.cumsum(dwells[commands.poses])
    return replace(commands, times=np.concatenate([[0.0], ends[:-1]]), end=float(ends[-1]))


def exact_dwells(motion: Motion) -> Array:
    """Dwells (P,) [s] of the poses before they are rounded."""
    return np.asarray(np.diff(motion.times), dtype=float)


def rounding_errors(motion: Motion, cycles: int) -> tuple[Array, Array]:
    """For so many cycles: when each pose is due (K,) [s], and by how much later the firmware's rounded dwells bring it [s]."""
    due = np.concatenate([[0.0], np.cumsum(np.tile(exact_dwells(motion), cycles))])
    commands = motion.commands(cycles)
    return due, np.append(commands.times, commands.end) - due


def hypotheses(motion: Motion) -> list[Hypothesis]:
    """What may lie behind a lag that grows."""
    exact = exact_dwells(motion)
    up = np.ceil(exact * 1e3 - 1e-6) / 1e3
    ratio = 1 + len(exact) * SYNC_WRITE / motion.duration
    return [
        Hypothesis(ROUNDED, "The poses' dwells are rounded to milliseconds, as in figure 3.4: 140, 103, 94, 131.", floors=True),
        Hypothesis(EXACT, "The dwells are not rounded: 140.4, 103.2, 93.6, 130.8 ms.", sends=lambda c: with_dwells(c, exact)),
        Hypothesis(UP, "Every dwell is rounded up: 141, 104, 94, 131. Half a millisecond a pose on average, the most that "
                       "rounding to the nearest could do to any walk.", sends=lambda c: with_dwells(c, up)),
        Hypothesis(PACKET, f"Each pose takes {1e3 * SYNC_WRITE:.2f} ms longer: the time of its packet on the bus (83 bytes at "
                           "1 Mbit/s), if the program waits until it is sent and then for the whole dwell.",
                   (EffectSpec("timing_drift", (), {"per_pose": SYNC_WRITE}),)),
        Hypothesis(CLOCK, f"The controller's or the cameras' clock is off by {1e2 * (ratio - 1):.2f} %: as much lag.",
                   (EffectSpec("clock_rate", (), {"ratio": ratio}),)),
        Hypothesis(WEAK, "The supply has 8 V all the time in place of its nominal voltage.",
                   (EffectSpec("supply_voltage", (), {"voltage": 8.0}),)),
        Hypothesis(SAG, "The supply drops by 0.5 V for each servo at full duty.", (EffectSpec("supply_sag", (), {"drop": 0.5}),)),
        Hypothesis(FADE, "The motors lose 2 % of their torque a second as they warm.",
                   (EffectSpec("thermal_fade", (), {"rate": 0.02}),)),
    ]


@dataclass(frozen=True)
class Lagging:
    """One hypothesis recorded. short, long: how its lag grows in the first SHORT and in all SECONDS. track: lag over time.
    doubt: floor and spread of its slope, known where the hypothesis has them. amplitude: how much of its swing in the first
    seconds each joint still has in the last, the smallest."""

    short: Growth
    long: Growth
    track: tuple[Array, Array]
    recorded: Take
    amplitude: float


@dataclass(frozen=True)
class Result:
    """All of it. slower: growth with dwells SLOWER times as long. slope: of the rounded walk in the first SHORT with floor and
    spread [s/s]; over longer they are smaller. pairs: how far a recording of the first is from a simulation of the second. same:
    RMS between rounded and exact dwells at the fine step in SHORT, the worst joint [rad]."""

    motion: Motion
    runs: dict[str, Run]
    lagging: dict[str, Lagging]
    slower: dict[str, Growth]
    slope: Number
    pairs: dict[tuple[str, str], Apart]
    same: float
    seconds: float
    short: float


def measure(model: RobotModel, quick: bool, progress: Progress) -> Result:
    """All runs and what is read off their recordings."""
    motion = walk()
    seconds, short = (4.0, 3.0) if quick else (SECONDS, SHORT)
    setting = Setting(seconds, motion, CYCLES)
    named = hypotheses(motion)
    runs = run_all(named, model, setting, progress, floors=False)
    reference = interpolate_motion(motion, CYCLES + 1, 1e-3, "rest")
    believed = runs[ROUNDED].take
    progress("recording", None)
    lagging = {}
    for name, run in runs.items():
        take = record(run.take, model, seconds, believed).take
        lagging[name] = Lagging(growth(take, reference, motion.duration, short), growth(take, reference, motion.duration),
                                lag_over_time(take, reference, motion.duration), take, _amplitude(take, motion.duration))
    slow = replace(motion, times=motion.times * SLOWER)
    slow_reference = interpolate_motion(slow, CYCLES, 1e-3, "rest")
    timing = [h for h in named if h.name in (ROUNDED, PACKET, CLOCK)]
    slow_runs = run_all([replace(h, floors=False) for h in timing], model, Setting(seconds, slow, CYCLES // 2 + 2), progress)
    slower = {name: growth(record(run.take, model, seconds, slow_runs[ROUNDED].take).take, slow_reference, slow.duration)
              for name, run in slow_runs.items()}

    pairs = {(a, b): apart(runs[a], runs[b], model, seconds) for a, b in ((PACKET, CLOCK), (EXACT, ROUNDED))}
    brief = Setting(short, motion, CYCLES)
    floors = run_all([h for h in named if h.name == ROUNDED], model, brief, progress)[ROUNDED]
    slope = number(floors, lambda t: growth(_filmed(t, short), reference, motion.duration).slope)
    fine = run_all([h for h in named if h.name == EXACT], model, replace(brief, time_step=FINE), progress)[EXACT]
    a, b = (_filmed(t, short).q for t in (floors.finer[-1], fine.take))
    same = float(np.sqrt(np.mean((a - b) ** 2, axis=0)).max())
    return Result(motion, runs, lagging, slower, slope, pairs, same, seconds, short)


def _filmed(take: Take, seconds: float) -> Take:
    """A rollout at the cameras' rate, without noise."""
    return replace(take.resampled(np.arange(0.0, seconds - 2e-3, 1 / RATE)), starts_at=0.0)


def _amplitude(take: Take, cycle: float) -> float:
    """Smallest ratio of a joint's swing in the last three cycles to that in the first three after the first."""
    clock = take.since_start
    first, last = (clock > cycle) & (clock < 4 * cycle), clock > clock[-1] - 3 * cycle
    q = take.q[:, np.nanstd(take.q[clock > 0], axis=0) > np.radians(1.0)]
    return float(np.min(np.nanstd(q[last], axis=0) / np.nanstd(q[first], axis=0)))
