"""What a file is, told by its content, and what is wrong with it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from workbench.robot import InputError, load_servo_constants, resolve_model
from workbench.robot.files import read_text
from workbench.robot.kinematics import Kinematics
from workbench.robot.yaml_file import read_yaml

_LISTED = 20
"""Names in one line of text; JSON has them all."""
_SAID = ("Format Version", "Export Frame Rate", "Total Exported Frames", "Length Units")
"""Of a Motive header: what other fields of the inspection say."""


@dataclass(frozen=True)
class Inspection:
    """What a file is.

    rate [Hz], frames and duration [s] where it has a clock. gaps: name -> share of frames not seen, of the assets,
    markers or channels that have any; share_of_gaps: over all of them. details: what else its kind has to say.
    """

    file: str
    kind: str
    version: str | None = None
    units: str | None = None
    rate: float | None = None
    frames: int | None = None
    duration: float | None = None
    assets: tuple[str, ...] = ()
    markers: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    share_of_gaps: float | None = None
    gaps: Mapping[str, float] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)
    problems: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Plain types, for JSON."""
        return {
            "file": self.file, "kind": self.kind, "version": self.version, "units": self.units, "rate": self.rate,
            "frames": self.frames, "duration": self.duration, "assets": list(self.assets),
            "markers": list(self.markers), "joints": list(self.joints), "share_of_gaps": self.share_of_gaps,
            "gaps": dict(self.gaps), "details": dict(self.details), "problems": list(self.problems)}

    def as_text(self) -> str:
        """For a person: one line for each thing there is to say, the problems last."""
        lines = {
            "kind": self.kind, "version": self.version, "units": self.units,
            "rate": None if self.rate is None else f"{self.rate:g} Hz", "frames": self.frames,
            "duration": None if self.duration is None else f"{self.duration:.3f} s",
            "assets": _names(self.assets), "markers": _names(self.markers), "joints": _names(self.joints),
            "gaps": None if self.share_of_gaps is None else f"{100 * self.share_of_gaps:.2f} %",
            **{f"  {name}": f"{100 * share:.2f} %" for name, share in list(self.gaps.items())[:_LISTED]},
            **{key: _names(value) if isinstance(value, list) else value for key, value in self.details.items()}}
        said = {key: str(value) for key, value in lines.items() if value not in (None, "")}
        width = max(map(len, said))
        out = [self.file] + [f"  {key:<{width}}  {value}" for key, value in said.items()]
        return "\n".join(out + ([f"  problem: {p}" for p in self.problems] or ["  no problems"]))


def inspect_file(file: str | Path) -> Inspection:
    """Tells what `file` is; InputError where it cannot be read or is of no known kind."""
    name = str(file)
    path = Path(file)
    if name.startswith("package://"):
        return _model(name)
    if path.is_dir():
        return _firmware_tables(path) if (path / "pos.txt").is_file() else _recording(path)
    whole = path if path.is_file() else Path(name.partition("#")[0])  # FILE.mtn#PAGE, FILE.npz#PROGRAMME
    if not whole.is_file():
        raise InputError(path, "file not found")
    return _reader(whole, part=whole != path)(path)


def _reader(path: Path, part: bool) -> Callable[[Path], Inspection]:
    """The function that knows files of this kind, or the `part` of one that is named."""
    suffix = path.suffix.lower()
    if suffix in (".npz", ".json"):
        return _recording
    if suffix in (".yaml", ".yml"):
        return _yaml
    if suffix == ".mtn":
        return _motion if part else _motion_file
    from workbench.recording.formats.file_kind import file_kind

    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        first = next((line for line in stream if line.strip()), "").strip()
    if first.startswith("<"):
        return lambda p: _model(str(p))
    if first.startswith("# joints:"):
        return lambda p: _firmware_tables(p.parent)
    return {"rollout": _rollout, "motion": _motion, "recording": _recording}[file_kind(path)]


def _recording(path: Path) -> Inspection:
    from workbench.recording.formats.read import read_recording
    from workbench.recording.mocap.mending import mend
    from workbench.recording.mocap.tracks import tracks_of

    r = read_recording(path)
    found = mend(tracks_of(r)).problems if r.rigid_bodies else ()
    missing = {name: np.isnan(body.p).any(axis=1) for name, body in r.rigid_bodies.items()}
    missing |= {name: np.isnan(p).any(axis=1) for name, p in r.markers.items()}
    missing |= {name: np.isnan(values) for name, values in r.channels.items()}
    joints = tuple(dict.fromkeys(c.partition(".")[2] for c in r.channels if "." in c))
    metadata = {k: v for k, v in r.metadata.items() if v and k not in _SAID}
    return Inspection(
        str(path), r.kind, r.version or None, r.units or None, _finite(r.rate), len(r.time), _duration(r.time),
        tuple(r.rigid_bodies), tuple(r.markers), joints, *_gaps(missing), details=metadata,
        problems=tuple(dict.fromkeys((*r.problems, *found))))


def _rollout(path: Path) -> Inspection:
    from workbench.recording.formats.rollout_table import load_rollout

    take = load_rollout(path)
    version = read_text(path).partition("\n")[0].rpartition("format ")[2]
    steps = np.diff(take.time)
    even = len(steps) and np.ptp(steps) < 1e-3 * np.median(steps)
    rate = round(1 / float(np.median(steps)), 6) if even else None
    columns = {j: np.isnan(take.q[:, i]) for i, j in enumerate(take.joints)}
    return Inspection(
        str(path), "rollout", version, "m, deg, s, N m", rate, len(take), _duration(take.time), (), (), take.joints,
        *_gaps(columns),
        details={"name": take.name, "source": take.source, "base": take.base, "starts_at": _finite(take.starts_at)},
        problems=take.problems)


def _motion(path: Path) -> Inspection:
    from workbench.motion import load_motion

    motion = load_motion(path)
    problems = [] if motion.closes else ["the last row differs from the first: played in a loop, the motion jumps"]
    try:
        motion.as_table()
    except InputError as e:
        problems.append(e.problem)
    degrees = np.rad2deg(motion.angles)
    return Inspection(
        str(path), "motion", units="deg, s", duration=motion.duration, joints=motion.joints,
        details={"poses": len(motion.times) - 1, "largest angle": f"{np.abs(degrees).max():.1f} deg"},
        problems=tuple(problems))


def _motion_file(path: Path) -> Inspection:
    from workbench.motion import load_mtn

    file = load_mtn(path)
    problems = [] if file.used else ["no page holds a step"]
    return Inspection(
        str(path), "motion_file", file.version, "counts of 300/1023 deg, s",
        details={"bus IDs": [int(i) for i in np.flatnonzero(file.enable)],
                 "pages": [p.name or str(p.number) for p in file.used]},
        problems=tuple(problems))


def _firmware_tables(folder: Path) -> Inspection:
    from workbench.device.firmware_tables import read_tables

    table = read_tables(folder)
    return Inspection(
        str(folder), "firmware_tables", units="counts, ms", duration=float(table.dwells_ms.sum()) / 1000,
        joints=table.joints, details={"poses": len(table)})


def _model(name: str) -> Inspection:
    path = resolve_model(name)
    kinematics = Kinematics.from_file(path)
    version = re.search(r"""<sdf[^>]*version=["']([^"']+)""", read_text(path))
    return Inspection(
        name, "model", f"SDF {version[1]}" if version else path.suffix.lstrip(".").upper(), "m, kg, rad",
        joints=kinematics.joints,
        details={"links": list(kinematics.links), "root": kinematics.root,
                 "mass": f"{kinematics.mass:.4f} kg",
                 "base": "fixed to the world" if kinematics.fixed_to_world else "free"})


def _yaml(path: Path) -> Inspection:
    content = read_yaml(path)
    if not isinstance(content, Mapping):
        raise InputError(path, "expected keys with values")
    if "takes" in content or "predict" in content:
        return _session(path)
    if "effects" in content or "servos" in content:
        return _fitted_model(path, content)
    if "stall_torque" in content:
        law = "proportional_gain" if load_servo_constants(path).proportional_gain is not None else "compliance"
        details = {"model": content.get("model"), "law": law}
        return Inspection(str(path), "servo_constants", units="N m, rad/s, V", details=details)
    raise InputError(path, "expected a session (takes), a model (effects, servos) or servo constants (stall_torque)")


def _session(path: Path) -> Inspection:
    from workbench.compare.session import load_session

    session = load_session(path)
    return Inspection(
        str(path), "session", "1", assets=tuple(session.model.rigid_bodies), joints=session.model.joints,
        details={"model": session.model.description, "base": session.model.base,
                 "takes": [t.name for t in session.takes], "predict": [p.name for p in session.predict]})


def _fitted_model(path: Path, content: Mapping[str, Any]) -> Inspection:
    effects = content.get("effects") or []
    if not isinstance(effects, list) or not all(isinstance(e, Mapping) and "effect" in e for e in effects):
        raise InputError(path, "effects: expected a list of effect, where, parameters")
    named = [" ".join([str(e["effect"]), *map(str, e.get("where") or ())]) for e in effects]
    return Inspection(str(path), "fitted_model", str(content.get("format")), details={"effects": named or ["none"]})


def _gaps(missing: Mapping[str, Any]) -> tuple[float | None, dict[str, float]]:
    shares = {name: float(m.mean()) for name, m in missing.items() if len(m)}
    return (float(np.mean(list(shares.values()))) if shares else None), {n: s for n, s in shares.items() if s > 0}


def _duration(time: Any) -> float | None:
    return float(time[-1] - time[0]) if len(time) else None


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _names(names: tuple[str, ...] | list[Any]) -> str:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return f"{len(names)}: {' '.join(map(str, names[:_LISTED]))}{more}" if names else ""
