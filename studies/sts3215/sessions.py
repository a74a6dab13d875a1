"""Sessions of real logs with a known change: the session describes another rig, gain, clock or zero than was recorded.

A pendulum that one Feetech STS3215 swings (kscalelabs/sysid, commit ca1ecb1), on three rigs that its authors weighed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from workbench.files import InputError
from workbench.files.reading import write_whole

Entry = dict[str, Any]
JOINT, ARM = "servo", "arm"
DUTY_PER_UNIT = 0.16489
"""Duty per radian of position error for each unit of the firmware's position gain, as the logs' authors state it."""
GAINS = (8, 16, 32)
SPLITS = {"first": ("lift_and_drop", "sin_sin"), "second": ("sin_time_square", "up_and_down")}
"""Programmes of motion that make one session: every change is asked twice, of logs that have nothing in common."""
SERVO = {"model": "STS3215", "stall_torque": 2.94, "no_load_speed": 4.71, "rated_voltage": 12.0, "supply_voltage": 12.0,
         "coulomb_friction": 0.0528, "viscous_friction": 0.059, "reflected_inertia": 0.0278}
"""Torque and speed of the data sheet at 12 V; friction and reflected inertia as published for the type (Rhoban/bam, M1);
the rest of the law comes from the family's profile, data/servos/sts3215.yaml, as in any session that leaves it out."""
SDF = """<?xml version="1.0"?>
<sdf version="1.9"><model name="sts3215_rig">
<link name="stand"/>
<link name="{arm}"><inertial><pose>0 0 {z} 0 0 0</pose><mass>{mass}</mass>
<inertia><ixx>{about_centre}</ixx><iyy>{about_centre}</iyy><izz>1e-5</izz></inertia></inertial></link>
<joint name="fixed" type="fixed"><parent>world</parent><child>stand</child></joint>
<joint name="{joint}" type="revolute"><parent>stand</parent><child>{arm}</child><axis><xyz>0 1 0</xyz>
<limit><lower>-6.3</lower><upper>6.3</upper></limit></axis></joint>
</model></sdf>
"""


@dataclass(frozen=True)
class Rig:
    """As weighed. mass [kg] at arm [m]; inertia about the axis [kg m^2]; moment: of gravity, arm level [N m]."""

    name: str
    mass: float
    arm: float
    inertia: float
    moment: float

    @property
    def sdf(self) -> str:
        """Its description: a point mass on an arm whose own mass makes up the moment."""
        along = self.moment / 9.81 - self.mass * self.arm
        mass = self.mass + along / (self.arm / 2)
        z = self.moment / 9.81 / mass
        return SDF.format(arm=ARM, joint=JOINT, mass=mass, z=-z, about_centre=self.inertia - mass * z * z)


RIGS = {r.name: r for r in (Rig("arm150_0.741kg", 0.741, 0.150, 0.018793, 1.12685),
                            Rig("arm150_0.969kg", 0.969, 0.150, 0.024550, 1.46192),
                            Rig("arm100_0.741kg", 0.741, 0.100, 0.009273, 0.74437))}


@dataclass(frozen=True)
class Case:
    """One session. recorded: rig and repetition of the logs; told: the rig that the session describes. gain: by which the told
    gain is larger than the servo's; edit: applied to a log's rows. effects: names that describe the change rightly; size: of the
    first number of the first of them, in the unit of docs/formats.md; moment: instead of a size, the true gravity over torque
    relative to the described rig; within: share of the size, or of the change of `moment`, within which an answer is right.
    loaded: a heavier rig whose logs are in the session too, with the weight that it carries more declared as `load:`."""

    name: str
    recorded: str
    repetition: int = 1
    told: str = "arm150_0.741kg"
    gain: float = 1.0
    edit: Callable[[list[Entry]], list[Entry]] | None = None
    effects: tuple[str, ...] = ()
    size: float = 0.0
    moment: float | None = None
    within: float = 0.05
    gains: Sequence[int] = GAINS
    programmes: Sequence[str] = SPLITS["first"]
    loaded: str | None = None


def commands_at(shift: float, rate: float = 1.0) -> Callable[[list[Entry]], list[Entry]]:
    """Goals and the command to let go as if sent `shift` [s] earlier, by a clock that runs `rate` times as fast."""
    def edited(rows: list[Entry]) -> list[Entry]:
        time = np.array([r["timestamp"] for r in rows])
        goal = np.array([r["goal_position"] for r in rows])
        at = time[0] + (time - time[0]) * rate + shift
        enabled = [rows[k]["torque_enable"] for k in np.maximum(np.searchsorted(time, at, side="right") - 1, 0)]
        moved = np.interp(at, time, goal)
        return [r | {"goal_position": float(g), "torque_enable": on} for r, g, on in zip(rows, moved, enabled)]
    return edited


def turned(degrees: float) -> Callable[[list[Entry]], list[Entry]]:
    """Goals and angles of a servo whose horn was set on so far back: both count from the servo's own zero."""
    by = float(np.deg2rad(degrees))
    return lambda rows: [r | {"position": r["position"] + by, "goal_position": r["goal_position"] + by} for r in rows]


CASES = (
    Case("quiet", "arm150_0.741kg"),
    Case("quiet, repeated", "arm150_0.741kg", 2),
    Case("mass", "arm150_0.969kg", effects=("payload", "com_shift"), moment=1.46192 / 1.12685, within=0.2),
    Case("arm", "arm100_0.741kg", effects=("com_shift", "payload"), moment=0.74437 / 1.12685, within=0.2),
    Case("gain", "arm150_0.741kg", 2, gain=2.0, effects=("servo_gain",), size=0.5),
    Case("delay", "arm150_0.741kg", 2, edit=commands_at(0.04), effects=("command_delay",), size=0.04),
    Case("clock", "arm150_0.741kg", 2, edit=commands_at(0.0, 1.01), effects=("clock_rate",), size=1.01, within=0.002),
    Case("zero", "arm150_0.741kg", 2, edit=turned(3.0), effects=("zero_offset", "ground_tilt"), size=-3.0),
    Case("known weight", "arm150_0.741kg", moment=0.40, within=0.2, loaded="arm150_0.969kg"),
)


def is_recorded(data: Path, case: Case) -> bool:
    """Whether the folder holds the logs of a case's programmes; two of the rigs played only those of the first split."""
    rigs = [case.recorded] if case.loaded is None else [case.recorded, case.loaded]
    return all((data / f"{rig}_kp{gain}_{programme}_{case.repetition}.json").exists()
               for rig in rigs for gain in case.gains for programme in case.programmes)


def _takes(folder: Path, data: Path, case: Case, recorded: str, more: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Entries of session.yaml for the logs of a rig; edited logs are written into the folder."""
    takes = []
    for gain in case.gains:
        for programme in case.programmes:
            name = f"{recorded}_kp{gain}_{programme}_{case.repetition}"
            path = data.resolve() / f"{name}.json"
            if not path.exists():
                raise InputError(path, "expected a log of the STS3215 rigs")
            if case.edit is not None:
                content = json.loads(path.read_text())
                path = write_whole(folder / path.name, json.dumps(content | {"entries": case.edit(content["entries"])}))
            takes.append({"name": f"{programme}_{gain}{'_loaded' if more else ''}", "recording": str(path), "base": "fixed",
                          "servos": {"proportional_gain": case.gain * gain * DUTY_PER_UNIT}, **more})
    return takes


def write_session(folder: Path, data: Path, case: Case) -> Path:
    """Writes robot.sdf, servo.yaml, session.yaml and the logs that had to be edited; returns session.yaml."""
    folder = folder.resolve()
    takes = _takes(folder, data, case, case.recorded, {})
    if case.loaded is not None:
        more, told = RIGS[case.loaded], RIGS[case.told]
        mass = more.mass - told.mass
        at = [0.0, 0.0, -round((more.moment - told.moment) / 9.81 / mass, 5)]
        takes += _takes(folder, data, case, case.loaded, {"load": {"link": ARM, "mass": round(mass, 5), "at": at}})
    write_whole(folder / "robot.sdf", RIGS[case.told].sdf)
    servo = SERVO | {"proportional_gain": case.gain * case.gains[-1] * DUTY_PER_UNIT}
    write_whole(folder / "servo.yaml", yaml.safe_dump(servo, sort_keys=False))
    return write_whole(folder / "session.yaml", yaml.safe_dump({
        "format": 1, "robot": {"model": "robot.sdf", "base": "stand", "servos": "servo.yaml"}, "takes": takes}, sort_keys=False))
