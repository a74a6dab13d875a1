"""Recognises a file by its content, and lists its problems."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.files import InputError
from workbench.files.errors import UnknownFolderError
from workbench.files.listing import list_names
from workbench.files.reading import read_json, read_text, regular_file
from workbench.files.tables import is_binary, plain_head
from workbench.files.yaml_file import read_yaml
from workbench.recording.servo_log.goal_stamps import STAMPS
from workbench.robot import ROBOTS, RobotModel, ServoConstants, load_servo_constants
from workbench.robot.servo_profile_file import servo_profile
from workbench.robot.servo_units import unknown_family

if TYPE_CHECKING:
    from workbench.compare.session import Session
    from workbench.motion import Motion

_LISTED = 20
"""Maximum number of names in one line of text; the JSON lists them all."""
_SAID = ("Format Version", "Export Frame Rate", "Total Exported Frames", "Length Units", STAMPS)
"""Metadata of a Motive header that other fields of the inspection already state."""
_RESULTS = {"findings": ("verdict", "findings"), "comparison": ("takes", "joints_by_error"), "certificate": ("claim", "margins"),
            "bench": ("figures",)}
"""JSON files that the workbench writes, by their keys."""


@dataclass(frozen=True)
class Inspection:
    """Description of a file.

    rate [Hz], frames and duration [s] where it has a clock. gaps: name -> share of frames not seen, of the assets, markers or
    channels that have any; share_of_gaps: over all of them. details: further facts about its kind. unusable: why other verbs
    would refuse a session; empty if they would not.
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
    unusable: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Plain types, for JSON."""
        return {
            "file": self.file, "kind": self.kind, "version": self.version, "units": self.units, "rate": self.rate,
            "frames": self.frames, "duration": self.duration, "assets": list(self.assets),
            "markers": list(self.markers), "joints": list(self.joints), "share_of_gaps": self.share_of_gaps,
            "gaps": dict(self.gaps), "details": dict(self.details), "problems": list(self.problems)}

    def as_text(self) -> str:
        """Readable text: one line per fact, problems last."""
        lines = {
            "kind": self.kind, "version": self.version, "units": self.units,
            "rate": None if self.rate is None else f"{self.rate:g} Hz", "frames": self.frames,
            "duration": None if self.duration is None else f"{self.duration:.3f} s",
            "assets": _names(self.assets), "markers": _names(self.markers), "joints": _names(self.joints),
            "gaps": None if self.share_of_gaps is None else f"{100 * self.share_of_gaps:.2f} %",
            **{f"  {name}": f"{100 * share:.2f} %" for name, share in list(self.gaps.items())[:_LISTED]},
            **{key: (_names(value) or "none") if isinstance(value, list) else value for key, value in self.details.items()}}
        shown = {_line(key): _line(str(value)) for key, value in lines.items() if value not in (None, "")}
        width = max(map(len, shown))
        out = [_line(self.file)] + [f"  {key:<{width}}  {value}" for key, value in shown.items()]
        return "\n".join(out + ([f"  problem: {_line(p)}" for p in self.problems] or ["  no problems"]))


def inspect_file(file: str | Path, packages: Mapping[str, str] | None = None) -> Inspection:
    """Identifies and checks `file`; InputError if it cannot be read or is of no known kind. packages: as of RobotModel."""
    name = str(file)
    path = Path(file)
    if name.startswith("package://"):
        return _model(name, packages)
    if name in ROBOTS and not path.exists():  # as --model names it
        return _model(f"package://{name}/{name}.sdf", packages)
    if path.is_dir():
        return _folder(path)
    whole = path if path.exists() else Path(name.partition("#")[0])  # FILE.mtn#PAGE, FILE.npz#PROGRAMME
    if whole.is_dir():
        return _recording(path)
    if not whole.exists():
        raise InputError(path, "file not found")
    regular_file(whole)
    read = _reader(whole, part=whole != path)
    return _model(name, packages) if read is None else read(path)


def _folder(path: Path) -> Inspection:
    """Firmware tables, a session, a recording that is a folder, or the results of a verb."""
    if (path / "session.yaml").is_file():
        return _session(path / "session.yaml")
    if (path / "pos.txt").is_file():
        return _firmware_tables(path)
    results = [name for name in ("findings.json", "comparison.json", "certificate.json", "rollout.csv", "inverse_dynamics.csv")
               if (path / name).is_file()]
    if results:
        return replace(inspect_file(path / results[0]), file=str(path))
    try:
        return _recording(path)
    except UnknownFolderError:
        raise InputError(path, "expected a session (session.yaml), firmware tables (pos.txt), results of the workbench, or a "
                               "recording that is a folder (state_motor.csv, meta/info.json); found none of these") from None


def _reader(path: Path, part: bool) -> Callable[[Path], Inspection] | None:
    """The function that inspects files of this kind, or the named `part` of one; None for a robot's description."""
    suffix = path.suffix.lower()
    if suffix in (".npz", ".parquet"):
        return _recording
    if suffix == ".json":
        return _json
    if suffix in (".yaml", ".yml"):
        return _yaml
    if suffix in (".sdf", ".urdf"):
        return None
    if suffix == ".mtn":
        return _motion if part else _motion_file
    from workbench.recording.formats.file_kind import file_kind

    head = plain_head(path)
    if is_binary(head):
        return _figure if head.startswith(b"\x89PNG") else _recording
    first = next((line for line in head.decode("utf-8-sig", "replace").splitlines() if line.strip()), "").strip()
    if first.lower().startswith(("<!doctype html", "<html")):
        return _page
    if first.startswith("<"):
        return None
    if first.startswith("# joints:"):
        return lambda p: _firmware_tables(p.parent)
    if first.startswith("# workbench inverse dynamics"):
        return _inverse_dynamics
    return {"rollout": _rollout, "motion": _motion, "recording": _recording}[file_kind(path)]


def _recording(path: Path) -> Inspection:
    from workbench.inspect.problems import recording_problems
    from workbench.motion.trajectory import is_bag, trajectories
    from workbench.recording.formats.read import read_recording

    try:
        r = read_recording(path)
    except InputError:
        if is_bag(path) and trajectories(path):
            return _motion(path)
        raise
    missing = {name: np.isnan(body.p).any(axis=1) for name, body in r.rigid_bodies.items()}
    missing |= {name: np.isnan(p).any(axis=1) for name, p in r.markers.items()}
    missing |= {name: np.isnan(values) for name, values in r.channels.items()}
    metadata: dict[str, Any] = {k: v for k, v in r.metadata.items() if v and k not in _SAID}
    if r.notes:
        metadata["logged"] = "; ".join(r.notes)
    return Inspection(
        str(path), r.kind, r.version or None, r.units or None, _finite(r.rate), len(r.time), _duration(r.time),
        tuple(r.rigid_bodies), tuple(r.markers), r.joints, *_gaps(missing), details=metadata,
        problems=tuple(recording_problems(path, r)))


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
    from workbench.inspect.problems import motion_problems
    from workbench.motion import load_motion

    motion = load_motion(path)
    degrees = np.rad2deg(motion.angles)
    return Inspection(
        str(path), "motion", units="deg, s", duration=motion.seconds(1), joints=motion.joints,
        details={"poses": len(motion.times) - 1, **_sections(motion), "largest angle": f"{np.abs(degrees).max():.1f} deg"},
        problems=tuple(motion_problems(motion)))


def _sections(motion: Motion) -> dict[str, object]:
    out: dict[str, object] = {}
    if motion.start or motion.stop:
        loop = len(motion.times) - 1 - motion.start - motion.stop
        out["sections"] = f"start {motion.start}, loop {loop}, stop {motion.stop} poses"
    return out | ({} if motion.cycles is None else {"cycles": motion.cycles})


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
    from workbench.device.tables.firmware_tables import read_tables

    table = read_tables(folder)
    return Inspection(
        str(folder), "firmware_tables", units="counts, ms", duration=float(table.dwells_ms.sum()) / 1000,
        joints=table.joints, details={"poses": len(table), "servos": ", ".join(u.family for u in table.families)})


def _model(name: str, packages: Mapping[str, str] | None = None) -> Inspection:
    """A robot's description, built as `simulate` builds it."""
    from workbench.simulation import MakeStation, SimulationConfig

    model = RobotModel(description=name, packages=packages or {})
    kinematics = model.kinematics
    model = replace(model, base=kinematics.root)
    problems = list(model.problems)
    try:
        if kinematics.joints:
            MakeStation(model, SimulationConfig(base="fixed" if kinematics.fixed_to_world else "free"))
        else:
            problems.append("no joint that turns: nothing for a servo to move")
    except (RuntimeError, ValueError) as e:
        text = e.problem if isinstance(e, InputError) else " ".join(str(e).split())[:300]
        problems.append(f"cannot be simulated: {text}")
    source = model.source
    version = re.search(r"""<sdf[^>]*version=["']([^"']+)""", read_text(source.source)) if source.source == source.path else None
    return Inspection(
        name, "model", f"SDF {version[1]}" if version else source.source.suffix.lstrip(".").upper(), "m, kg, rad",
        joints=kinematics.joints,
        details={"links": list(kinematics.links), "root": kinematics.root,
                 "mass": f"{kinematics.mass:.4f} kg",
                 "base": "fixed to the world" if kinematics.fixed_to_world else "free",
                 "for Drake": "; ".join(source.notes)}, problems=tuple(problems))


def _yaml(path: Path) -> Inspection:
    content = read_yaml(path)
    if not isinstance(content, Mapping):
        raise InputError(path, "expected a mapping")
    if "takes" in content or "predict" in content:
        return _session(path)
    if not {"effects", "servos", "robot"}.isdisjoint(content):
        return _fitted_model(path)
    if "stall_torque" in content or "model" in content:
        servo = _nominal(path, content["model"]) if set(content) == {"model"} else load_servo_constants(path)
        law = "proportional_gain" if servo.proportional_gain is not None else "compliance"
        details, unknown = {"model": servo.model, "law": law}, unknown_family(servo.model)
        return Inspection(str(path), "servo_constants", units="N m, rad/s, V", details=details,
                          problems=(*servo.doubts, *([f"{unknown}; simulated, but not sent to a robot"] if unknown else [])))
    raise InputError(path, "expected a session (takes), a model (effects, servos) or servo constants (stall_torque; model)")


def _nominal(path: Path, model: object) -> ServoConstants:
    """Constants of a servo of which the file names only the model."""
    try:
        return servo_profile(str(model)).constants()
    except InputError as e:
        raise InputError(path, f"model: {e.problem}") from None


def _session(path: Path) -> Inspection:
    from workbench.compare.session import load_session
    from workbench.inspect.problems import session_check

    session = load_session(path)
    check = session_check(session)
    problems = [f"{of}: {text}" for of, lines in check.problems.items() for text in lines]
    takes = {t.name for t in session.takes}
    none_left = bool(takes) and takes <= check.damaged_takes and not session.predict
    lost = (check.refused or "").removeprefix(f"{session.path}: ") or ("none of its takes can be used" if none_left else "")
    logged = _describe_logging(session)
    return Inspection(
        str(path), "session", "1", assets=tuple(session.model.rigid_bodies), joints=session.model.joints,
        details={"model": session.model.description, "base": session.model.base,
                 "takes": [t.name for t in session.takes], "predict": [p.name for p in session.predict], **logged},
        problems=tuple(problems), unusable=lost)


def _describe_logging(session: Session) -> dict[str, str]:
    """How servo logs were logged; empty where the takes cannot be read, which is reported as their problem."""
    from workbench.compare.logged import describe_logging, register_laws
    from workbench.compare.session_takes import read_takes

    try:
        takes = read_takes(session)[0]
        logging = describe_logging(takes, register_laws(takes))
    except InputError:
        return {}
    notes = {f"logged: {name}": "; ".join(lines) for name, lines in logging.get("logs", {}).items()}
    return notes | {f"register of {joint}": law for joint, law in logging.get("duty_registers", {}).items()}


def _fitted_model(path: Path) -> Inspection:
    from workbench.inspect.problems import model_problems_of
    from workbench.robot import load_model

    model = load_model(path)
    named = [" ".join([e.effect, *e.where]) for e in model.effects]
    try:
        problems = model_problems_of(model)
    except InputError as e:  # from an effect, which does not know the file
        raise e if e.source else InputError(path, f"effects: {e.problem}") from None
    return Inspection(str(path), "fitted_model", "1", joints=model.joints, details={"effects": named},
                      problems=tuple(problems))


def _json(path: Path) -> Inspection:
    """Results of the workbench by their keys, else a recording."""
    content = read_json(path)
    found = content if isinstance(content, dict) else {}
    for kind, keys in _RESULTS.items():
        if all(key in found for key in keys):
            details = {"verdict": found.get("verdict"), "claim": found.get("claim")}
            for key in ("takes", "findings"):
                if isinstance(found.get(key), list):
                    details[key] = [str(e.get("name") or e.get("effect")) for e in found[key] if isinstance(e, dict)]
            return Inspection(str(path), kind, str(found.get("format", "")) or None, details=details)
    return _recording(path)


def _inverse_dynamics(path: Path) -> Inspection:
    from workbench.dynamics import load_inverse_dynamics

    table = load_inverse_dynamics(path)
    return Inspection(str(path), "inverse_dynamics", "1", "m, deg, s, N, N m", frames=len(table.time), joints=tuple(table.joints),
                      duration=_duration(table.time), problems=tuple(table.problems))


def _page(path: Path) -> Inspection:
    strange = () if path.suffix.lower() in (".html", ".htm") else (
        f"a web page called {path.suffix or 'a file'}: the link of the page was saved, not the file; on "
        "GitHub take the raw file",)
    title = re.search(r"<title>([^<]{0,200})", plain_head(path).decode("utf-8", "replace"))
    return Inspection(str(path), "page", problems=strange,
                      details={"title": title[1].strip() if title else "", "open": "in a web browser"})


def _figure(path: Path) -> Inspection:
    return Inspection(str(path), "figure", details={"open": "in any viewer of pictures"})


def _gaps(missing: Mapping[str, Any]) -> tuple[float | None, dict[str, float]]:
    shares = {name: float(m.mean()) for name, m in missing.items() if len(m)}
    return (float(np.mean(list(shares.values()))) if shares else None), {n: s for n, s in shares.items() if s > 0}


def _duration(time: Any) -> float | None:
    return float(time[-1] - time[0]) if len(time) else None


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _names(names: tuple[str, ...] | list[Any]) -> str:
    return f"{len(names)}: {list_names(list(map(str, names)), _LISTED, ' ')}" if names else ""


def _line(text: str) -> str:
    """The text on one line, whatever characters a file's names contain."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
