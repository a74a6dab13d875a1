"""Writes the session and the servo constants of a new robot, filled in from its description."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import yaml

from workbench.files import InputError
from workbench.files.reading import write_together
from workbench.files.resources import resource_dir
from workbench.files.yaml_file import read_yaml
from workbench.recording.formats.read import read_recording, recording_of_take
from workbench.recording.take_from import named_by_model
from workbench.robot import RobotModel
from workbench.robot.servo_profile_file import servo_profile, servo_profiles

_KG_CM = 0.0980665
"""One kg cm [N m]."""
_MOVES_FULL = math.radians(15.0)
"""Error [rad] at which a hobby servo is assumed to reach full duty, to within a factor of 2."""


@dataclass(frozen=True)
class NewRobot:
    """The result of `new_robot`. files: paths written. guessed: assumptions made from the description, a line each. missing:
    facts that only the owner knows, a line each."""

    files: tuple[Path, ...]
    guessed: tuple[str, ...]
    missing: tuple[str, ...]


@cache
def servo_types() -> Mapping[str, Mapping[str, Any]]:
    """Starting values by servo, of data/servo_types.yaml."""
    content = read_yaml(resource_dir("data") / "servo_types.yaml")
    types: Mapping[str, Mapping[str, Any]] = content["types"]
    return types


def known_servos() -> tuple[str, ...]:
    """Names that `new_robot` accepts for its servo."""
    return tuple(sorted({*servo_types(), *servo_profiles()}))


def new_robot(description: str | Path, servo: str, out: str | Path, takes: Sequence[str | Path] = (),
              base: Literal["free", "fixed"] | None = None, packages: Mapping[str, str] | None = None) -> NewRobot:
    """Writes session.yaml and servo.yaml into `out` for a robot described by an SDF or URDF.

    servo: its type, one of `known_servos`. takes: recordings of it. base: whether the robot was free or fixed in them; None:
    as the description says. packages: as of RobotModel. InputError where the description or a take cannot be read, a take is
    another robot's, the servo is unknown, or one of the files is already there.
    """
    out = Path(out)
    for name in ("session.yaml", "servo.yaml"):
        if (out / name).exists():
            raise InputError(out / name, "is already there; choose another folder with --out, or remove it")
    model = RobotModel(str(description), packages=dict(packages or {}))
    k = model.kinematics
    if not k.joints:
        raise InputError(description, "no joint that turns; expected a robot with servos")
    values, source, travel = _constants(servo)
    _check_takes(takes, model)
    held = base == "fixed" or (base is None and k.fixed_to_world)
    guessed = [f"base link: {k.root}{' (fixed to the world)' if k.fixed_to_world else ''}",
               f"joints: {', '.join(k.joints)}", f"servo.yaml: {servo}, {source}"]
    feet = [] if held else list(model.foot_links.values())
    if feet:
        guessed.append(f"feet: {', '.join(feet)}")
    missing = [*_ranges(model, travel),
               "supply_voltage: measure it at the servo while it works, and write it into servo.yaml",
               "proportional_gain, coulomb_friction, reflected_inertia are guesses: docs/record.md shows how to measure them"]
    if not takes:
        missing.append("takes: record some (docs/record.md) and list them in session.yaml")
    missing.append("bus_ids: the servos' numbers, if the workbench is to move the robot")
    session = _session(description, out, k.root, feet, takes, held, packages or {}, k.joints)
    paths = write_together(out, {"session.yaml": session, "servo.yaml": _servo_yaml(servo, source, values)})
    return NewRobot(tuple(paths), tuple(guessed), tuple(missing))


def _check_takes(takes: Sequence[str | Path], model: RobotModel) -> None:
    """InputError for a take that is missing or no recording, or a log of joints that the robot does not have."""
    for path in takes:
        recording = read_recording(recording_of_take(Path(path), Path(path).stem))
        if recording.sensing == "encoders":
            named_by_model(recording, model)


def _constants(servo: str) -> tuple[dict[str, Any], str, float]:
    """Constants for servo.yaml, where they come from, and how far the servo turns in all [rad]."""
    named = {_plain(name): name for name in servo_types()}
    if _plain(servo) in named:
        return _from_sheet(servo_types()[named[_plain(servo)]])
    try:
        profile = servo_profile(servo)
    except InputError:
        raise InputError(None, f"unknown servo '{servo}'; expected one of {', '.join(known_servos())} (or write servo.yaml by "
                               "hand: docs/formats.md, section 4)") from None
    values = {key: {"value": n.value, "sd": n.sd} if n.sd else n.value for key, n in profile.nominal.items()}
    return values, f"from the profile of {profile.name}", profile.span


def _from_sheet(sheet: Mapping[str, Any]) -> tuple[dict[str, Any], str, float]:
    (kg_cm, rated), (seconds, at) = sheet["stall"], sheet["no_load"]
    stall, speed = kg_cm * _KG_CM, math.pi / 3 / seconds * rated / at
    friction = 0.03 * stall
    values = {
        "stall_torque": round(stall, 3), "no_load_speed": round(speed, 3), "rated_voltage": rated, "supply_voltage": rated,
        "coulomb_friction": _with_sd(friction, 1.0), "viscous_friction": _with_sd(0.01 * stall, 1.0),
        "reflected_inertia": _with_sd(0.0035 * stall, 1.0), "proportional_gain": _with_sd(1 / _MOVES_FULL, 0.7),
        "torque_tolerance": 0.5, "back_emf_tolerance": 0.5}
    return values, str(sheet["source"]), math.radians(sheet["range"])


def _with_sd(value: float, share: float) -> dict[str, float]:
    return {"value": float(f"{value:.3g}"), "sd": float(f"{share * value:.2g}")}


def _plain(name: str) -> str:
    return "".join(c for c in name.lower() if c.isalnum())


def _ranges(model: RobotModel, travel: float) -> list[str]:
    """Joints for which the description allows more travel than the servo has, or states no limit."""
    frames, out = model.kinematics.frames, []
    free = [j for j in model.joints if not math.isfinite(frames[j].upper - frames[j].lower)]
    far = [j for j in model.joints if j not in free and max(abs(frames[j].lower), abs(frames[j].upper)) > travel / 2 + 0.01]
    most = math.degrees(travel / 2)
    if free:
        out.append(f"limits of {', '.join(free)}: the description has none; this servo goes to {most:.0f} deg on each side")
    if far:
        out.append(f"limits of {', '.join(far)}: wider in the description than this servo's {most:.0f} deg on each side")
    return out


def _servo_yaml(servo: str, source: str, values: Mapping[str, Any]) -> str:
    lines = [f"# {servo}: {source}", f"model: {servo}"]
    for key, value in values.items():
        text = f"{{value: {value['value']:.6g}, sd: {value['sd']:.3g}}}" if isinstance(value, dict) else f"{value:.6g}"
        lines.append(f"{key}: {text}")
    return "\n".join(lines) + "\n"


def _session(description: str | Path, out: Path, root: str, feet: Sequence[str], takes: Sequence[str | Path], held: bool,
             packages: Mapping[str, str], joints: Sequence[str]) -> str:
    name = str(description)
    model = name if name.startswith("package://") else _relative(name, out)
    lines = ["format: 1", "robot:", f"  model: {_quote(model)}", f"  base: {_quote(root)}", "  servos: servo.yaml"]
    if feet:
        lines.append(f"  feet: [{', '.join(map(_quote, feet))}]")
    if packages:
        found = (f"{_quote(n)}: {_quote(_relative(d, out))}" for n, d in packages.items())
        lines.append("  packages: {" + ", ".join(found) + "}")
    lines.append("  # bus_ids: {" + ", ".join(f"{joint}: ?" for joint in joints) + "}")
    base = "fixed" if held else "free"
    if takes:
        lines.append("takes:")
        stems = [Path(path).stem for path in takes]
        for k, path in enumerate(takes):
            name = stems[k] if stems.index(stems[k]) == k else f"{stems[k]}_{k + 1}"
            lines += [f"- name: {_quote(name)}", f"  recording: {_quote(_relative(path, out))}", f"  base: {base}"]
    else:
        lines += ["# list your recordings here, for instance", "# takes:", "# - name: slow", "#   recording: takes/slow.csv",
                  f"#   base: {base}          # fixed: on a stand or a table; free: it walks"]
    return "\n".join(lines) + "\n"


def _relative(path: str | Path, out: Path) -> str:
    return Path(os.path.relpath(Path(path).resolve(), out.resolve())).as_posix()


def _quote(text: str) -> str:
    plain = all(c.isalnum() or c in "_./-" for c in text) and text[:1].isalpha() and yaml.safe_load(text) == text  # not null, yes
    return text if plain else '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
