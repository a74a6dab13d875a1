"""Logs of servos whose laws are not the workbench's: one-joint rigs simulated here by a few lines each, and their sessions.

The hobby servo hears of its goal 50 times a second, in its PWM frame, filters it, and turns no faster than its speed limit. The
bus servo follows a goal that its firmware moves at a limited speed, cuts its duty, and rubs the more the more it carries.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from tests.servo_rig import SDF

STEP = 2e-4  # s
GRAVITY = 9.81  # m/s^2
COUNT = 2 * np.pi / 4096  # rad


@dataclass(frozen=True)
class Maker:
    """A servo: stall torque [N m] and no-load speed [rad/s] at its supply, duty per rad and its limit, time constant of its
    command filter [s], speed of its goal [rad/s], every so often heard of it [s], and so much later [s], friction: dry [N m],
    viscous [N m s/rad], share of the load; inertia [kg m^2]. mass [kg] at length [m] hangs down at zero."""

    stall: float
    no_load: float
    gain: float
    duty: float
    filtered: float
    goal_speed: float
    frame: float
    delay: float
    dry: float
    viscous: float
    load: float
    inertia: float
    mass: float
    length: float


PWM = Maker(stall=2.4, no_load=4.2, gain=9.0, duty=1.0, filtered=0.1, goal_speed=3.75, frame=0.02, delay=0.02, dry=0.09,
            viscous=0.03, load=0.1, inertia=0.012, mass=0.352, length=0.17)
BUS = Maker(stall=4.9, no_load=7.8, gain=11.0, duty=0.9, filtered=0.0, goal_speed=5.0, frame=0.005, delay=0.002, dry=0.12,
            viscous=0.04, load=0.15, inertia=0.02, mass=1.13, length=0.15)


def played(m: Maker, goal: Callable[[float], float], seconds: float, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles [rad] and velocities [rad/s] at the times `rows` [s] of a servo that hears `goal` [rad]."""
    n = round(seconds / STEP)
    q, v, asked, heard, wanted = 0.0, 0.0, 0.0, goal(0.0), goal(0.0)
    angles, speeds = np.empty(n), np.empty(n)
    weight, back = m.mass * GRAVITY * m.length, m.stall / m.no_load
    inertia = m.inertia + m.mass * m.length**2
    next_frame = m.delay
    for k in range(n):
        t = k * STEP
        if t >= next_frame:
            heard, next_frame = goal(t - m.delay), next_frame + m.frame
        wanted += (heard - wanted) * (1.0 if m.filtered == 0 else STEP / m.filtered)
        asked += float(np.clip(wanted - asked, -m.goal_speed * STEP, m.goal_speed * STEP))
        duty = min(max(m.gain * (asked - q), -m.duty), m.duty)
        pull = duty * m.stall - weight * np.sin(q)
        carried = 0.5 * abs(duty * m.stall - back * v + weight * np.sin(q))
        rub = m.dry + m.load * carried
        free = (inertia * v + STEP * pull) / (inertia + STEP * (back + m.viscous))  # velocity without dry friction
        most = STEP * rub / (inertia + STEP * (back + m.viscous))
        v = 0.0 if abs(free) <= most else free - float(np.copysign(most, free))
        q += STEP * v
        angles[k], speeds[k] = q, v
    at = np.minimum(np.round(rows / STEP).astype(int), n - 1)
    return angles[at], speeds[at]


def _sines(t: float) -> float:
    return 0.6 * np.sin(2.1 * t) + 0.35 * np.sin(5.3 * t)


def _steps(t: float) -> float:
    return (0.0, 0.9, -0.5, 0.3, -0.9, 0.6)[int(t / 0.9) % 6]


def _ramps(t: float) -> float:
    return 0.9 * float(2 / np.pi * np.arcsin(np.sin(2 * np.pi * t / 3.0)))


MOVES: dict[str, Callable[[float], float]] = {"sines": _sines, "steps": _steps, "ramps": _ramps}


def _session(folder: Path, m: Maker, servo: dict[str, float | str], takes: list[dict[str, str]]) -> None:
    (folder / "rig.sdf").write_text(SDF.format(length=m.length, mass=m.mass))
    (folder / "servo.yaml").write_text(yaml.safe_dump(servo))
    (folder / "session.yaml").write_text(yaml.safe_dump(
        {"format": 1, "robot": {"model": "rig.sdf", "base": "base", "servos": "servo.yaml"}, "takes": takes}))


def pwm_session(folder: Path, seconds: float = 6.0) -> None:
    """Three joint logs at 50 Hz, angles of 4096 counts a turn with a count of noise; constants as its data sheet has them."""
    takes = []
    rng = np.random.default_rng(5)
    time = np.arange(0.0, seconds, 0.02)
    for name, move in MOVES.items():
        q, _ = played(PWM, move, seconds, time)
        q = np.round((q + rng.normal(0, COUNT, len(q))) / COUNT) * COUNT
        rows = [f"{t:.3f},{np.rad2deg(move(t)):.4f},{np.rad2deg(x):.4f}" for t, x in zip(time, q)]
        (folder / f"{name}.csv").write_text("\n".join(["time,goal.j,position.j", *rows]) + "\n")
        takes.append({"name": name, "recording": f"{name}.csv", "base": "fixed"})
    _session(folder, PWM, {"model": "25 kg servo", "stall_torque": 2.45, "no_load_speed": 6.5, "rated_voltage": 6.8,
                           "supply_voltage": 6.8, "proportional_gain": 9.0, "coulomb_friction": 0.08, "viscous_friction": 0.02,
                           "reflected_inertia": 0.01}, takes)


def bus_session(folder: Path, seconds: float = 6.0) -> None:
    """Three BAM logs at uneven times of about 190 Hz, whose load register was never read."""
    takes = []
    rng = np.random.default_rng(6)
    time = np.cumsum(np.abs(rng.normal(0.0053, 0.0006, round(seconds / 0.0053))))
    for name, move in MOVES.items():
        q, v = played(BUS, move, float(time[-1]) + 0.01, time)
        entries = [{"timestamp": float(t), "position": float(np.round(x / COUNT) * COUNT), "goal_position": float(move(t)),
                    "speed": float(np.round(w / 0.0153) * 0.0153), "load": 0, "input_volts": 12.0, "temp": 31,
                    "torque_enable": True}
                   for t, x, w in zip(time, q, v)]
        log = {"mass": BUS.mass, "length": BUS.length, "kp": 32, "vin": 12.0, "motor": "sts3250", "trajectory": name,
               "entries": entries}
        (folder / f"{name}.json").write_text(json.dumps(log))
        takes.append({"name": name, "recording": f"{name}.json", "base": "fixed"})
    _session(folder, BUS, {"model": "STS3250", "stall_torque": 4.9, "no_load_speed": 7.8, "rated_voltage": 12.0,
                           "supply_voltage": 12.0, "proportional_gain": 11.0, "coulomb_friction": 0.1, "viscous_friction": 0.03,
                           "reflected_inertia": 0.02}, takes)
