"""Did every servo get another's speed? In figure 3.4 goals stand in the order of bus IDs, speeds in that of names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from studies.common import COORDINATES
from studies.riddles.apart import Apart, Number, apart, end_of, number
from studies.riddles.cameras import record
from studies.riddles.hypotheses import Hypothesis, Progress, Run, Setting, run_all, walk
from workbench.effects.apply import played
from workbench.motion import Commands, Motion
from workbench.recording.take import Take
from workbench.robot import BUS_IDS, SPEED_UNIT, EffectSpec, Ground, RobotModel

Array = NDArray[np.float64]

RIGHT, ORDER, GOALS, QUICK, ONCE, WEAK = ("right order", "speeds misplaced", "goals misplaced", "unit of 114/1023", "no speeds",
                                          "weak supply")
SECONDS = 6.0
TABLE_UNIT = 114 / 1023 * 6 * np.pi / 180
"""What the thesis's equation 3.4 takes a count of speed to be [rad/s]; the servo's own is SPEED_UNIT."""
FRICTIONS = (0.3, 0.5, 0.7, 1.0)
CONTACTS = ("point", "hydroelastic")
SWEPT, SWEEP, SWEEP_COUNTS = "flb", np.radians(60.0), 20
"""The sweep that tells ramps 0.4 % apart: joint, angle to each side [rad], and moving speed, a whole count so that no rounding
enters."""
SURE = 5.0


def misplaced_goals(commands: Commands) -> Commands:
    """The servo with the k-th bus ID gets the goal of the k-th name, and its own speed."""
    by_id, by_name = sorted(commands.joints, key=lambda j: BUS_IDS[j]), sorted(commands.joints)
    goals = commands.goals.copy()
    for servo, name in zip(by_id, by_name):
        goals[:, commands.column(servo)] = commands.goals[:, commands.column(name)]
    return replace(commands, goals=goals)


def hypotheses() -> list[Hypothesis]:
    """Right order, wrong orders, and what else makes servos too fast or too slow."""
    ratio = TABLE_UNIT / SPEED_UNIT
    return [
        Hypothesis(RIGHT, "Each servo gets its own goal and speed.", floors=True),
        Hypothesis(ORDER, "One loop reads figure 3.4 as it stands: goals right, the k-th bus ID gets the speed of the k-th name.",
                   (EffectSpec("speed_order"),), floors=True),
        Hypothesis(GOALS, "The loop goes by names: speeds right, every servo gets another's goal.", sends=misplaced_goals),
        Hypothesis(QUICK, f"The servo's unit of speed is that of equation 3.4, {100 * (ratio - 1):.2f} % more than 0.111 rpm.",
                   sends=lambda c: replace(c, speeds=c.speeds * ratio)),
        Hypothesis(ONCE, "No speeds arrive: every servo goes as fast as it can.",
                   sends=lambda c: replace(c, speeds=0 * c.speeds)),
        Hypothesis(WEAK, "Order right, but the supply has 8 V, and servos fall behind their ramps.",
                   (EffectSpec("supply_voltage", (), {"voltage": 8.0}),)),
    ]


@dataclass(frozen=True)
class Sweep:
    """Slope of the recorded sweep over that of the simulated one in the right order, and its standard error."""

    ratio: float
    sigma: float


@dataclass(frozen=True)
class Result:
    """All of it. pairs: (recorded, simulated) -> how far apart. sure_after: joint -> time [s] from the first command after
    which a recording of ORDER leaves the simulation of RIGHT by SURE noises for three frames. ends: hypothesis -> coordinate ->
    where the body ends. given: speed that each servo gets over its own, mean of the poses (joints that get none of their own left
    out). swing: hypothesis -> joint -> recorded swing over commanded swing. elsewhere: (hypothesis, friction, contact) -> x, z,
    heading."""

    runs: Mapping[str, Run]
    pairs: Mapping[tuple[str, str], Apart]
    sure_after: Mapping[str, float]
    ends: Mapping[str, Mapping[str, Number]]
    given: Mapping[str, float]
    swing: Mapping[str, Mapping[str, float]]
    elsewhere: Mapping[tuple[str, float, str], tuple[float, float, float]]
    sweep: Mapping[str, Sweep]
    seconds: float


def measure(model: RobotModel, quick: bool, progress: Progress) -> Result:
    """All runs and what is read off their recordings."""
    seconds = 1.0 if quick else SECONDS
    setting = Setting(seconds, walk())
    named = hypotheses()
    runs = run_all(named, model, setting, progress, floors=not quick)
    progress("recording", None)
    pairs = {(a, b): apart(runs[a], runs[b], model, seconds) for b in (RIGHT, ORDER) for a in runs}
    ends = {n: {c: number(r, end_of(COORDINATES.index(c), seconds)) for c in ("x", "z", "ry")} for n, r in runs.items()}
    swing = {n: _swing(pairs[n, RIGHT].recorded.take, setting.motion) for n in runs}
    elsewhere = {}
    for contact in CONTACTS[:1] if quick else CONTACTS:
        for friction in FRICTIONS[:1] if quick else FRICTIONS:
            other = replace(model, ground=Ground(friction=friction, stiffness=model.ground.stiffness))
            both = [h for h in named if h.name in (RIGHT, ORDER)]
            for n, r in run_all(both, other, replace(setting, contact=contact), progress, False).items():
                x, z, turn = (end_of(COORDINATES.index(c), seconds)(r.take) for c in ("x", "z", "ry"))
                elsewhere[n, friction, contact] = x, z, turn
    return Result(runs, pairs, _sure_after(pairs[ORDER, RIGHT]), ends, _given(setting.motion, model), swing, elsewhere,
                  sweep(model, [h for h in named if h.name in (RIGHT, QUICK)], progress), seconds)


def _sure_after(found: Apart) -> dict[str, float]:
    recorded, simulated = found.compared.recorded, found.compared.simulated
    clock = recorded.since_start
    out = {}
    for joint, channel in found.compared.joints.items():
        off = np.abs(recorded.q[:, recorded.column(joint)] - simulated.q[:, simulated.column(joint)]) > SURE * channel.noise
        held = np.flatnonzero(off[:-2] & off[1:-1] & off[2:] & (clock[:-2] >= 0))
        if len(held):
            out[joint] = float(clock[held[0] + 2])
    return out


def _given(motion: Motion, model: RobotModel) -> dict[str, float]:
    own = motion.commands(1)
    other = played(own, model.with_effect(EffectSpec("speed_order")))
    given, needed = other.speeds.mean(axis=0), own.speeds.mean(axis=0)
    return {j: float(given[i] / needed[i]) for i, j in enumerate(own.joints) if needed[i]}


def _swing(take: Take, motion: Motion) -> dict[str, float]:
    """Peak to peak of each joint's angle over that of its goals; the middle one of the cycles after the first. A joint that was
    not seen for a whole cycle is left out."""
    clock = take.since_start
    cycles = range(1, int(clock[-1] / motion.duration))
    out = {}
    for i, joint in enumerate(take.joints):
        goals = np.ptp(motion.angles[:, motion.joints.index(joint)])
        q = take.q[:, i]
        parts = [q[(clock >= k * motion.duration) & (clock < (k + 1) * motion.duration)] for k in cycles]
        whole = [np.ptp(p) for p in parts if np.isfinite(p).all()]
        if whole:
            out[joint] = float(np.median(whole) / goals)
    return out


def sweep_motion(model: RobotModel) -> Motion:
    """SWEPT goes to one side, waits, and slowly to the other at a whole count of speed; all others stay in neutral."""
    slow = 2 * SWEEP / (SWEEP_COUNTS * TABLE_UNIT)
    angles = np.zeros((4, len(model.joints)))
    angles[:, model.joints.index(SWEPT)] = 0.0, SWEEP, SWEEP, -SWEEP
    times = np.cumsum([0.0, 1.0, 0.5, slow])
    return Motion("sweep", times, model.joints, angles)


def sweep(model: RobotModel, named: list[Hypothesis], progress: Progress) -> dict[str, Sweep]:
    """Slope of the slow part on the stand, each hypothesis recorded, against the simulation of the right order."""
    motion = sweep_motion(model)
    begin, end = float(motion.times[-2]) + 0.5, float(motion.times[-1]) - 0.5
    setting = Setting(float(motion.times[-1]), motion, 1, base="fixed")
    runs = run_all([replace(h, floors=False) for h in named], model, setting, progress)
    out = {}
    for name, run in runs.items():
        recorded = record(run.take, model, setting.seconds, runs[RIGHT].take)
        simulated = recorded.view(runs[RIGHT].take, model)
        clock = recorded.take.since_start
        use = (clock > begin) & (clock < end)
        y, x = (t.q[use, t.column(SWEPT)] for t in (recorded.take, simulated))
        slope, at = np.polyfit(x, y, 1)
        error = np.std(y - slope * x - at, ddof=2) / (np.std(x) * np.sqrt(len(x)))
        out[name] = Sweep(float(slope), float(error))
    return out
