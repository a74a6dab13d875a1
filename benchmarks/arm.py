"""The robot and the servo log on which fits are timed: a small arm, one joint of which differs from its description."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from workbench.compare.session import Session, load_session
from workbench.motion.commands import Commands
from workbench.recording import write_joint_log
from workbench.recording.formats.log_commands import commands_of_rows
from workbench.robot import EffectSpec, RobotModel
from workbench.simulation import Simulation, SimulationConfig
from workbench.types import Array

JOINTS = ("one", "three", "two")
ODD = "two"
"""The joint whose friction differs from the description."""
EXTRA = 0.05, 0.04
"""Coulomb friction [N m] and viscous friction [N m s/rad] that ODD has in addition to the nominal ones."""
PERIOD = 0.01
"""Time between two rows of the log [s]."""
COUNT = float(np.deg2rad(0.088))
"""Resolution of the servos' angle sensors [rad]."""
NOISE = float(np.deg2rad(0.05))
"""Standard deviation of the angle noise, before rounding to counts [rad]."""
TRUE_STEP = 1e-4
"""Time step of a recorded rollout in MuJoCo, which is fast enough for so small a step [s]."""
PLAYED_STEP = 2.5e-4
"""Time step of a recorded rollout in the station [s]."""
SERVO = {"stall_torque": 1.5, "no_load_speed": 6.18, "rated_voltage": 12.0, "supply_voltage": 11.1, "coulomb_friction": 0.06,
         "viscous_friction": 0.01, "reflected_inertia": 6.5e-3, "proportional_gain": 5.0}
"""A purely proportional law, which MuJoCo's actuators reproduce exactly."""


def _link(name: str, z: float) -> str:
    return (f'<link name="{name}"><pose>0 0 {z} 0 0 0</pose><inertial><pose>0 0 0.04 0 0 0</pose><mass>0.1</mass><inertia>'
            "<ixx>1e-4</ixx><iyy>1e-4</iyy><izz>2e-5</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>")


def arm_sdf(fixed: bool = False) -> str:
    """SDF of the links trunk, upper, middle and lower, stacked upwards on the joints one (about y), two (y) and three (x);
    the trunk is welded to the world if `fixed`."""
    links = "".join(_link(n, z) for n, z in (("trunk", 0.1), ("upper", 0.2), ("middle", 0.28), ("lower", 0.36)))
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent>{parent}</parent><child>{child}</child><axis><xyz>{axis}</xyz><limit>'
        "<lower>-2.6</lower><upper>2.6</upper><effort>1.5</effort></limit></axis></joint>"
        for name, parent, child, axis in (("one", "trunk", "upper", "0 1 0"), ("two", "upper", "middle", "0 1 0"),
                                          ("three", "middle", "lower", "1 0 0")))
    weld = '<joint name="mount" type="fixed"><parent>world</parent><child>trunk</child></joint>' if fixed else ""
    return f'<?xml version="1.0"?><sdf version="1.7"><model name="arm">{links}{weld}{joints}</model></sdf>'


@dataclass(frozen=True)
class Log:
    """A log of the servo bus: times (N,) [s], goals and measured angles (N, n) [rad] of JOINTS."""

    time: Array
    goals: Array
    angles: Array

    @property
    def commands(self) -> Commands:
        """The goals as commands that were sent on the bus."""
        return commands_of_rows(self.time, JOINTS, self.goals, np.ones(self.goals.shape, dtype=bool))


def arm(folder: Path) -> RobotModel:
    """The nominal arm; its description is written into `folder`."""
    (folder / "arm.sdf").write_text(arm_sdf(), encoding="utf-8")
    (folder / "servo.yaml").write_text(yaml.safe_dump(SERVO), encoding="utf-8")
    (folder / "log.csv").write_text("time,goal.one\n0,0\n1,0\n", encoding="utf-8")
    return _session(folder).model


def session(folder: Path, log: Log) -> Session:
    """The session of the arm in `folder`, with this log as its only take."""
    channels = {f"{kind}.{j}": values[:, i] for kind, values in (("goal", log.goals), ("position", log.angles))
                for i, j in enumerate(JOINTS)}
    write_joint_log(folder / "log.csv", log.time, channels)
    return _session(folder)


def _session(folder: Path) -> Session:
    content = {"format": 1, "robot": {"model": "arm.sdf", "base": "trunk", "servos": "servo.yaml"},
               "takes": [{"name": "log", "recording": "log.csv", "base": "fixed"}]}
    (folder / "session.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    return load_session(folder / "session.yaml")


def goals(duration: float) -> Log:
    """Slow and fast swings of every joint from rest in neutral, so that Coulomb and viscous friction can be told apart. The
    angles are zeros, to be filled in by `measured`."""
    time = np.asarray(PERIOD * np.arange(round(duration / PERIOD) + 1), dtype=np.float64)
    begins = np.clip(time / 0.3, 0, 1)
    columns = [begins * (a * np.sin(2 * np.pi * f * time) + 0.3 * a * np.sin(2 * np.pi * 3.1 * f * time))
               for a, f in ((0.35, 0.55), (0.4, 0.8), (0.5, 0.65))]
    return Log(time, np.column_stack(columns), np.zeros((len(time), len(JOINTS))))


def played(model: RobotModel, log: Log, effects: tuple[EffectSpec, ...]) -> Array:
    """Angles (N, n) [rad] at the log's times of the arm with these effects, simulated in steps of PLAYED_STEP."""
    for effect in effects:
        model = model.with_effect(effect)
    config = SimulationConfig(base="fixed", contact_period=0, time_step=PLAYED_STEP)
    take = Simulation(model, config).run(log.commands, float(log.time[-1]) + 2e-3, 0.1)
    return np.column_stack([np.interp(log.time, take.time, take.q[:, take.column(j)]) for j in JOINTS])


def measured(log: Log, angles: Array, seed: int) -> Log:
    """The log with angles (N, n) [rad] as servos report them: noisy, and rounded to whole counts."""
    noisy = angles + np.random.default_rng(seed).normal(0.0, NOISE, angles.shape)
    return Log(log.time, log.goals, COUNT * np.round(noisy / COUNT))


def frictions() -> tuple[EffectSpec, EffectSpec]:
    """The effects that give ODD its additional friction."""
    return (EffectSpec("coulomb_friction", (ODD,), {"torque": EXTRA[0]}),
            EffectSpec("viscous_friction", (ODD,), {"coefficient": EXTRA[1]}))
