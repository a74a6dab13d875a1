"""When things happen in a run, in whole steps: commands, states that the base is put to, rows of the log."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from workbench.motion.commands import Commands
from workbench.simulation.compiled.arrays import Schedule
from workbench.simulation.config import SimulationConfig
from workbench.simulation.steady import BaseStates, JointStates

ROUNDING = 1e-9
"""Seconds by which an instant may miss one of the log's and be that."""


def whole_steps(config: SimulationConfig, seconds: float) -> float:
    """The log's instant that is nearest [s]."""
    return _whole(config.logged_every, seconds)


def _whole(every: float, seconds: float) -> float:
    return round(seconds / every) * every


def schedule_of(config: SimulationConfig, commands: Commands | None, lead: float, duration: float, elapsed: float,
                steadied: BaseStates | None, restarts: JointStates | None = None) -> Schedule:
    """lead: in whole steps of the log. commands: as the servos get them, columns in the model's order.

    Commands and states at or after the end are ignored; of two at one instant the later stays, as in `Simulation`."""
    dt, every = config.time_step, config.logged_every
    end = _on_grid(every, lead + duration)
    at, which = _sent(every, np.zeros(0) if commands is None else lead + commands.times, end)
    states = steadied if restarts is None else restarts
    puts = {} if states is None else {_whole(every, lead + t): k for k, t in enumerate(states.times.tolist())}
    puts = {t: k for t, k in sorted(puts.items()) if t < end}
    steps = np.ceil(at / dt - 1e-6).astype(np.int64)
    late = dt * steps - at
    put = list(puts.values())
    n = 0 if commands is None else len(commands.joints)
    empty = np.zeros((0, n))
    return Schedule(
        dt=dt, steps=math.ceil(end / dt - 1e-6), log_every=max(1, round(every / dt)), begin=lead - elapsed,
        command_step=steps, late=np.where(late > ROUNDING, late, 0.0),
        goal=empty if commands is None else np.ascontiguousarray(commands.goals[which], dtype=float),
        speed=empty if commands is None else np.ascontiguousarray(commands.speeds[which], dtype=float),
        on=empty.astype(bool) if commands is None else np.ascontiguousarray(commands.enabled[which], dtype=bool),
        put_step=np.array([round(t / dt) for t in puts], dtype=np.int64),
        put_quat=_rows(steadied, "quat", put, 4), put_v=_rows(steadied, "v", put, 3), put_w=_rows(steadied, "w", put, 3),
        put_q=_rows(restarts, "q", put, n), put_qdot=_rows(restarts, "v", put, n))


def _sent(every: float, times: np.ndarray, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Instants of commands before the end, in order, and which comes there: of several the last."""
    nearest = np.round(times / every) * every
    at = np.where(np.abs(nearest - times) < ROUNDING, nearest, times)
    order = np.argsort(at, kind="stable")
    last = np.append(np.diff(at[order]) > 0.0, True)[:len(order)]
    kept = order[last & (at[order] < end)]
    return at[kept], kept


@lru_cache(maxsize=16)
def settling(config: SimulationConfig, servos: int) -> Schedule:
    """Nothing but time, before the first command."""
    still = schedule_of(config, None, 0.0, whole_steps(config, config.settle), 0.0, None)
    none = np.zeros((0, servos))
    return still._replace(begin=math.inf, goal=none, speed=none, on=none.astype(bool))


def rows_of(config: SimulationConfig, end: float) -> int:
    """Rows of the log from 0 to the end."""
    return math.floor(_on_grid(config.logged_every, end) / config.logged_every + 1e-6) + 1


def _on_grid(every: float, t: float) -> float:
    nearest = _whole(every, t)
    return nearest if abs(nearest - t) < ROUNDING else t


def _rows(states: BaseStates | JointStates | None, name: str, which: list[int], width: int) -> np.ndarray:
    if states is None:
        return np.zeros((0, width))
    return np.ascontiguousarray(getattr(states, name)[which], dtype=float).reshape(-1, width)
