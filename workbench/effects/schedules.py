"""Changes command schedules so that joints get their poses at different times."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.cache import Cache
from workbench.motion.commands import Commands
from workbench.types import Array

LOOP = 2e-3
"""Uncertainty of the delay between a command's time stamp and its use in the servo's loop [s]. Simulators and firmwares differ by
this much, so every model may start this much sooner or later, and no delay is known better."""

SAME = 1e-9
"""Instants at most this far apart are treated as one [s]."""


def without_poses(commands: Commands, column: int, missed: Iterable[int]) -> Commands:
    """The commands without some poses of one joint, which keeps its previous goal and speed."""
    goals, speeds = commands.goals.copy(), commands.speeds.copy()
    for k in sorted(missed):
        goals[k, column] = goals[k - 1, column] if k else 0.0
        speeds[k, column] = speeds[k - 1, column] if k else 0.0
    return replace(commands, goals=goals, speeds=speeds)


def delay_commands(commands: Commands, columns: Iterable[int], late: float, switched: bool = True) -> Commands:
    """The commands of some columns `late` seconds later; until its next command, a joint keeps its last one. Before the first
    command it is in neutral or, if commands had begun before, at the goal of the first. switched: whether switching the servo on
    and off is delayed, too."""
    columns = list(columns)
    if not late:
        return commands
    switched |= bool((commands.enabled[:, columns] == commands.enabled[:1, columns]).all())
    if len(columns) == len(commands.joints) and switched:
        later = replace(commands, times=commands.times + late, end=commands.end + late)
        return _since(later, commands.times[0]) if commands.begun and late > 0 else later
    own = [commands.goals[:, columns], commands.speeds[:, columns], commands.enabled[:, columns]]
    changes = np.zeros(len(commands.times), dtype=bool)  # otherwise the number of instants doubles with each joint
    for values, neutral in zip(own if switched else own[:2], (0.0, 0.0, True)):
        earlier = values[:1] if commands.begun else np.full_like(values[:1], neutral)
        changes |= (values != np.vstack([earlier, values[:-1]])).any(axis=1)
    changes[:1] |= late < 0
    times = np.union1d(commands.times, commands.times[changes] + late)
    times = times[np.diff(times, prepend=-np.inf) > SAME]
    now, before = (np.searchsorted(commands.times, times - s + SAME, side="right") - 1 for s in (0.0, late))
    first, shifted = np.maximum(now, 0), np.maximum(before, 0)
    waiting = slice(0, 0 if commands.begun else None)  # of the rows before a first command: in neutral
    neutral_now, neutral_before = np.flatnonzero(now < 0)[waiting], np.flatnonzero(before < 0)[waiting]

    def hold(rows: np.ndarray, neutral: float, delayed: bool = True) -> np.ndarray:
        out = rows[first]
        out[neutral_now] = neutral
        if delayed:
            own = rows[:, columns][shifted]
            own[neutral_before] = neutral
            out[:, columns] = own
        return out

    return Commands(times, commands.joints, hold(commands.goals, 0.0), hold(commands.speeds, 0.0),
                    hold(commands.enabled, True, switched), commands.end + late, commands.poses[first], commands.begun)


class _Sent(NamedTuple):
    """Goals and speeds sent to one joint. times (k,) [s]: of their changes; values (2, k + 1): goals and speeds, first
    those before the first change."""

    times: Array
    values: Array


def delay_each(commands: Commands, late: Array, until: float = math.inf) -> Commands:
    """The commands with the goals and speeds of each joint `late` (n,) seconds later, none negative, as `delay_commands` has
    those of one delay after the other; servos are switched on and off as before. In one pass, since a search delays each of
    a robot's joints by another time in every rollout. until [s]: later commands are not needed."""
    commands, sent = _sent_to_each.get((id(commands), until), lambda: _changes(commands.until(until)), commands)
    heard = [each.times + wait for each, wait in zip(sent, late.tolist())]
    times = np.concatenate([commands.times, *heard])
    times.sort()
    kept = np.ones(len(times), dtype=bool)
    np.greater(times[1:] - times[:-1], SAME, out=kept[1:])
    times = times[kept]
    values = np.empty((2, len(commands.joints), len(times)))
    for i, (each, instants) in enumerate(zip(sent, heard)):
        values[:, i] = each.values.repeat(_lasting(instants, times), axis=1)
    now = np.arange(len(commands.times)).repeat(_lasting(commands.times, times)[1:])
    goals, speeds = (np.ascontiguousarray(v.T) for v in values)
    return Commands(times, commands.joints, goals, speeds, commands.enabled[now], commands.end + float(late.max()),
                    commands.poses[now], commands.begun)


_sent_to_each: Cache[tuple[Commands, list[_Sent]]] = Cache(256)


def _changes(commands: Commands) -> tuple[Commands, list[_Sent]]:
    out = []
    for goals, speeds in zip(commands.goals.T, commands.speeds.T):
        values = np.array([goals, speeds])
        before = values[:, :1] if commands.begun else np.zeros((2, 1))  # in neutral
        rows = np.flatnonzero((np.diff(values, axis=1, prepend=before) != 0).any(axis=0))
        out.append(_Sent(commands.times[rows], np.hstack([before, values[:, rows]])))
    return commands, out


def _lasting(instants: Array, times: Array) -> NDArray[np.int_]:
    """How many of `times` (N,) come before the first of some instants (k,) among them, and from each on until the next: (k + 1,).
    """
    counts = np.empty(len(instants) + 1, dtype=int)
    counts[:-1] = times.searchsorted(instants + SAME, side="right") - 1
    counts[-1] = len(times)
    counts[1:] -= counts[:-1].copy()
    return counts


def _since(commands: Commands, time: float) -> Commands:
    """Commands whose first goals apply from `time` [s] on."""
    rows = np.concatenate([[0], np.arange(len(commands.times))])
    return replace(commands, times=np.concatenate([[time], commands.times]), goals=commands.goals[rows],
                   speeds=commands.speeds[rows], enabled=commands.enabled[rows], poses=commands.poses[rows])
