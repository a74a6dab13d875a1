"""A small arm with one joint that differs from what its description says, and a log of it: what fits are timed on."""

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
"""The joint that differs."""
EXTRA = 0.05, 0.04
"""Of its Coulomb friction [N m] and viscous friction [N m s/rad] beyond nominal."""
PERIOD = 0.01
"""Between rows of the log [s]."""
COUNT = float(np.deg2rad(0.088))
"""To which servos tell angles [rad]."""
NOISE = float(np.deg2rad(0.05))
"""Standard deviation before that [rad]."""
TRUE_STEP = 1e-4
"""Of a rollout that is recorded, where the engine is quick enough [s]."""
PLAYED_STEP = 2.5e-4
"""Of one of the station [s]."""
SERVO = {"stall_torque": 1.5, "no_load_speed": 6.18, "rated_voltage": 12.0, "supply_voltage": 11.1, "coulomb_friction": 0.06,
         "viscous_friction": 0.01, "reflected_inertia": 6.5e-3, "proportional_gain": 5.0}
"""A proportional law, which MuJoCo's actuators can be without a rest."""


def _link(name: str, z: float) -> str:
    return (f'<link name="{name}"><pose>0 0 {z} 0 0 0</pose><inertial><pose>0 0 0.04 0 0 0</pose><mass>0.1</mass><inertia>'
            "<ixx>1e-4</ixx><iyy>1e-4</iyy><izz>2e-5</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>")


def arm_sdf(fixed: bool = False) -> str:
    """trunk, upper, middle, lower upwards on the joints one (y), two (y), three (x); welded to the world if `fixed`."""
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
    """What a servo bus tells: times (N,) [s], goals and angles (N, n) [rad] of JOINTS."""

    time: Array
    goals: Array
    angles: Array

    @property
    def commands(self) -> Commands:
        """The goals as what went out on the bus."""
        return commands_of_rows(self.time, JOINTS, self.goals, np.ones(self.goals.shape, dtype=bool))


def arm(folder: Path) -> RobotModel:
    """The nominal arm, its description written into a folder."""
    (folder / "arm.sdf").write_text(arm_sdf(), encoding="utf-8")
    (folder / "servo.yaml").write_text(yaml.safe_dump(SERVO), encoding="utf-8")
    (folder / "log.csv").write_text("time,goal.one\n0,0\n1,0\n", encoding="utf-8")
    return _session(folder).model


def session(folder: Path, log: Log) -> Session:
    """The arm's session in that folder with one log."""
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
    """Slow and quick swings of every joint from rest in neutral, so that Coulomb and viscous friction show apart; angles are
    still zero."""
    time = np.asarray(PERIOD * np.arange(round(duration / PERIOD) + 1), dtype=np.float64)
    begins = np.clip(time / 0.3, 0, 1)
    columns = [begins * (a * np.sin(2 * np.pi * f * time) + 0.3 * a * np.sin(2 * np.pi * 3.1 * f * time))
               for a, f in ((0.35, 0.55), (0.4, 0.8), (0.5, 0.65))]
    return Log(time, np.column_stack(columns), np.zeros((len(time), len(JOINTS))))


def played(model: RobotModel, log: Log, effects: tuple[EffectSpec, ...]) -> Array:
    """Angles (N, n) [rad] of the arm with these effects at the log's times, in small steps."""
    for effect in effects:
        model = model.with_effect(effect)
    config = SimulationConfig(base="fixed", contact_period=0, time_step=PLAYED_STEP)
    take = Simulation(model, config).run(log.commands, float(log.time[-1]) + 2e-3, 0.1)
    return np.column_stack([np.interp(log.time, take.time, take.q[:, take.column(j)]) for j in JOINTS])


def measured(log: Log, angles: Array, seed: int) -> Log:
    """With angles (N, n) [rad] as servos tell them: noise, in whole counts."""
    noisy = angles + np.random.default_rng(seed).normal(0.0, NOISE, angles.shape)
    return Log(log.time, log.goals, COUNT * np.round(noisy / COUNT))


def frictions() -> tuple[EffectSpec, EffectSpec]:
    """What is odd about the joint ODD."""
    return (EffectSpec("coulomb_friction", (ODD,), {"torque": EXTRA[0]}),
            EffectSpec("viscous_friction", (ODD,), {"coefficient": EXTRA[1]}))
