"""What reaches the servos, and when: effects on commands (docs/formats.md, section 7)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from studies.other_engine.hidden.values import number
from workbench.motion.commands import Commands
from workbench.robot import EffectSpec, RobotModel
from workbench.types import Array

Change = Callable[[Commands, EffectSpec, RobotModel, np.random.Generator], Commands]


def command_delay(sent: Commands, spec: EffectSpec, model: RobotModel, rng: np.random.Generator) -> Commands:
    """All joints, or some, hear everything `delay` later."""
    late = {j: number(spec, "delay") for j in spec.where or sent.joints}
    return _heard(sent, [sent.times + late.get(j, 0.0) for j in sent.joints], sent.end + max(late.values()))


def timing_drift(sent: Commands, spec: EffectSpec, model: RobotModel, rng: np.random.Generator) -> Commands:
    """Each pose holds the next one up by `per_pose`."""
    lost = number(spec, "per_pose")
    return replace(sent, times=sent.times + lost * np.arange(len(sent.times)), end=sent.end + lost * len(sent.times))


def clock_rate(sent: Commands, spec: EffectSpec, model: RobotModel, rng: np.random.Generator) -> Commands:
    """The sender's clock is off, not the recorder's and not the servos': goals come at ratio times their time."""
    ratio = number(spec, "ratio")
    return replace(sent, times=ratio * sent.times, end=ratio * sent.end)


def dropped_command(sent: Commands, spec: EffectSpec, model: RobotModel, rng: np.random.Generator) -> Commands:
    """A servo that misses a pose continues to its last goal at its last speed; before its first it stays in neutral."""
    goals, speeds = sent.goals.copy(), sent.speeds.copy()
    for joint in spec.where:
        c = sent.column(joint)
        goal, speed = 0.0, 0.0
        for k, heard in enumerate(rng.uniform(size=len(sent.times)) >= number(spec, "probability")):
            if heard:
                goal, speed = goals[k, c], speeds[k, c]
            goals[k, c], speeds[k, c] = goal, speed
    return replace(sent, goals=goals, speeds=speeds)


def speed_order(sent: Commands, spec: EffectSpec, model: RobotModel, rng: np.random.Generator) -> Commands:
    """The speeds in the order of names go out to the servos in the order of bus IDs."""
    speeds = np.empty_like(sent.speeds)
    for name, gets in zip(sorted(sent.joints), sorted(sent.joints, key=lambda j: model.bus_ids[j])):
        speeds[:, sent.column(gets)] = sent.speeds[:, sent.column(name)]
    return replace(sent, speeds=speeds)


COMMANDS: dict[str, Change] = {
    "command_delay": command_delay, "timing_drift": timing_drift, "clock_rate": clock_rate,
    "dropped_command": dropped_command, "speed_order": speed_order,
}


def _heard(sent: Commands, times: list[Array], end: float) -> Commands:
    """The commands where each joint hears them at times of its own (K,) [s]."""
    instants: Array = np.unique(np.round(np.concatenate(times), 9)).astype(float)
    instants = instants[np.diff(instants, prepend=-np.inf) > 1e-7]
    n = len(sent.joints)
    goals, speeds = np.zeros((len(instants), n)), np.zeros((len(instants), n))
    enabled = np.ones((len(instants), n), dtype=bool)
    for c, mine in enumerate(times):
        last = np.searchsorted(mine, instants + 1e-6) - 1
        known = last >= 0
        goals[known, c], speeds[known, c] = sent.goals[last[known], c], sent.speeds[last[known], c]
        enabled[known, c] = sent.enabled[last[known], c]
    poses = sent.poses[np.maximum(np.searchsorted(sent.times, instants + 1e-6) - 1, 0)]
    return Commands(instants, sent.joints, goals, speeds, enabled, end, poses)
