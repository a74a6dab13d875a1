"""The rig as a session: its SDF, the published M1 as nominal servo, and the recorded logs as takes.

A point mass on a rigid arm hangs from one XL-330 (Rhoban/bam, commit af22604); q = 0 hanging down. Duty per radian and gain unit
as in data/README.md: PWM = kp (goal - q) 4096/(2 pi)/256, full at 885.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from workbench.files import InputError
from workbench.files.reading import write_whole
from workbench.recording import read_recording, write_joint_log
from workbench.recording.recording import Recording
from workbench.types import Array

DUTY_PER_UNIT = 4096 / (2 * np.pi) / 256 / 885
"""Duty per radian of position error, for each unit of the firmware's position gain."""
JOINT, ARM = "servo", "arm"
SDF = """<?xml version="1.0"?>
<sdf version="1.9"><model name="xl330_rig">
<link name="stand"/>
<link name="{arm}"><inertial><pose>0 0 {z} 0 0 0</pose><mass>{mass}</mass>
<inertia><ixx>1e-9</ixx><iyy>1e-9</iyy><izz>1e-9</izz></inertia></inertial></link>
<joint name="fixed" type="fixed"><parent>world</parent><child>stand</child></joint>
<joint name="{joint}" type="revolute"><parent>stand</parent><child>{arm}</child><axis><xyz>0 1 0</xyz>
<limit><lower>-6.3</lower><upper>6.3</upper></limit></axis></joint>
</model></sdf>
"""


@dataclass(frozen=True)
class Log:
    """One recorded log. gain: the firmware's position gain; programme: its command."""

    path: Path
    gain: int
    programme: str
    mass: float
    length: float
    supply: float

    @property
    def name(self) -> str:
        return f"{self.programme}_{self.gain}"

    def read(self) -> Recording:
        """Contents of the file."""
        return read_recording(self.path)


def find_logs(folder: Path) -> list[Log]:
    """The logs of a folder, by gain and programme; InputError where there is none."""
    logs = []
    for path in sorted(folder.glob("*.json")):
        m = read_recording(path).metadata
        logs.append(Log(path, int(m["kp"]), m["trajectory"], float(m["mass"]), float(m["length"]), float(m["vin"])))
    if not logs:
        raise InputError(folder, "expected BAM logs of the rig, *.json")
    return sorted(logs, key=lambda log: (log.gain, log.programme))


def published(folder: Path, model: str) -> dict[str, float]:
    """Parameters of a published friction model, "m1" to "m6"; SI."""
    content = json.loads((folder / "published_parameters" / f"{model}.json").read_text())
    return {k: float(v) for k, v in content.items() if isinstance(v, (int, float))}


def nominal_servo(m1: Mapping[str, float], supply: float, gain: int = 400) -> dict[str, float | str]:
    """M1 in the words of `servo.yaml` (docs/formats.md, section 4). Its offset of the arm is no servo's constant."""
    return {
        "model": "XL-330", "stall_torque": m1["kt"] * supply / m1["R"], "no_load_speed": supply / m1["kt"],
        "rated_voltage": supply, "supply_voltage": supply, "coulomb_friction": m1["friction_base"],
        "viscous_friction": m1["friction_viscous"], "reflected_inertia": m1["armature"],
        "proportional_gain": gain * DUTY_PER_UNIT}


def write_session(folder: Path, logs: Sequence[Log], m1: Mapping[str, float], validate: Iterable[int] = (),
                  predict: Sequence[Log] = ()) -> Path:
    """Writes robot.sdf, servo.yaml and session.yaml; returns the latter. Takes at the gains in `validate` are for validation
    alone; of the logs in `predict` only commands and first state are given."""
    rig, folder = logs[0], folder.resolve()
    if any((log.mass, log.length, log.supply) != (rig.mass, rig.length, rig.supply) for log in [*logs, *predict]):
        raise InputError(rig.path.parent, "expected logs of one rig: mass, length and supply differ")
    write_whole(folder / "robot.sdf", SDF.format(arm=ARM, joint=JOINT, mass=rig.mass, z=-rig.length))
    write_whole(folder / "servo.yaml", yaml.safe_dump(nominal_servo(m1, rig.supply), sort_keys=False))
    held = set(validate)
    takes = [{"name": log.name, "recording": str(log.path), "base": "fixed",
              "servos": {"proportional_gain": log.gain * DUTY_PER_UNIT}}
             | ({"use": "validate" if log.gain in held else "fit"} if held else {}) for log in logs]
    content: dict[str, object] = {
        "format": 1, "robot": {"model": "robot.sdf", "base": "stand", "servos": "servo.yaml"}, "takes": takes}
    if predict:
        content["predict"] = [
            {"name": log.name, "commands": str(write_commands(folder / "predict" / f"{log.name}.csv", log).relative_to(folder)),
             "base": "fixed", "servos": {"proportional_gain": log.gain * DUTY_PER_UNIT}} for log in predict]
    return write_whole(folder / "session.yaml", yaml.safe_dump(content, sort_keys=False))


def write_commands(path: Path, log: Log) -> Path:
    """A log's goals and torque enables as commands of a prediction, with its position and velocity in the first row alone."""
    recording = log.read()
    channels = {name: values for name, values in _named(recording).items() if name.startswith(("goal.", "enabled."))}
    for name in ("position", "velocity"):
        first = np.full(len(recording.time), np.nan)
        first[0] = _named(recording)[f"{name}.{JOINT}"][0]
        channels[f"{name}.{JOINT}"] = first
    path.parent.mkdir(parents=True, exist_ok=True)
    return write_joint_log(path, recording.time, channels)


def _named(recording: Recording) -> dict[str, Array]:
    return {f"{name.partition('.')[0]}.{JOINT}" if "." in name else name: c for name, c in recording.channels.items()}


def full_duty(logs: Sequence[Log]) -> tuple[float, float, int]:
    """Supply voltage in the logs [V]: median while the motor is idle, median while it is stalled at full duty, and rows of the
    latter."""
    idle: list[Array] = []
    full: list[Array] = []
    for log in logs:
        channels = {name.partition(".")[0]: c for name, c in log.read().channels.items()}
        duty = np.abs(channels["duty"])
        idle.append(channels["voltage"][duty < 0.02])
        full.append(channels["voltage"][(duty > 0.98) & (np.abs(channels["velocity"]) < 0.3)])
    return float(np.median(np.concatenate(idle))), float(np.median(np.concatenate(full))), sum(len(f) for f in full)
