"""The session file: one robot, one day of recordings (docs/formats.md, section 1)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from workbench.compare.options import FILES
from workbench.effects.known_load import FURTHEST, MOST_MASS, KnownLoad
from workbench.files import InputError
from workbench.files.yaml_file import Fields, top_of
from workbench.motion import load_motion
from workbench.motion.commands import Commands
from workbench.motion.table import MOST_CYCLES
from workbench.recording.formats.read import recording_of_take
from workbench.robot import RobotModel
from workbench.robot.robot_section import read_model
from workbench.robot.servo_registers import ServoRegisters, load_registers

Base = Literal["free", "fixed"]


@dataclass(frozen=True)
class TakeSpec:
    """One take of a session: its commands and its recording.

    motion: pose table, played `cycles` times (None: as often as its file says, else once); None where the recording carries its
    own commands. starts_at: recording time of the first command [s]; None: estimate it. servos: constants that differ in this
    take. load: a known weight that hangs on the robot in it. use: "fit", "validate" or None.
    """

    name: str
    recording: Path
    motion: Path | None = None
    cycles: int | None = None
    base: Base = "free"
    starts_at: float | None = None
    servos: Mapping[str, float] = field(default_factory=dict)
    use: Literal["fit", "validate"] | None = None
    load: KnownLoad | None = None

    def robot(self, model: RobotModel) -> RobotModel:
        """The model as it was in this take."""
        return _as_it_was(model, self)

    @property
    def conditions(self) -> str:
        """A key that is equal for takes in which the robot was the same."""
        return repr((sorted(self.servos.items()), self.load))

    def commands(self, model: RobotModel) -> Commands | None:
        """The commands sent on the bus; None if only the recording holds them."""
        return None if self.motion is None else load_motion(self.motion, model).commands(self.cycles)


@dataclass(frozen=True)
class PredictSpec:
    """A take to be predicted: a captured one (`motion`, `start` file, `starts_at` [s], `frames`), or a log (`commands`)."""

    name: str
    motion: Path | None = None
    cycles: int | None = None
    commands: Path | None = None
    start: Path | None = None
    starts_at: float | None = None
    frames: int | None = None
    base: Base = "free"
    servos: Mapping[str, float] = field(default_factory=dict)
    load: KnownLoad | None = None


def _as_it_was(model: RobotModel, entry: TakeSpec | PredictSpec) -> RobotModel:
    changed = model.with_servos(entry.servos)
    return changed if entry.load is None else entry.load.on(changed)


@dataclass(frozen=True)
class Session:
    """One robot, one day of recordings. model: the nominal robot. registers: contents of its servos' registers, if they were
    read. yaw: of the robot's first heading in the capture's axes, positive to the left [rad]; None: found from the takes. All
    files named exist; all names fit the model."""

    path: Path
    model: RobotModel
    takes: tuple[TakeSpec, ...] = ()
    predict: tuple[PredictSpec, ...] = ()
    registers: ServoRegisters | None = None
    yaw: float | None = None

    def model_of(self, take: TakeSpec | PredictSpec, model: RobotModel | None = None) -> RobotModel:
        """The robot as it was in one take: the session's (or another `model`) with the take's `servos` and `load` applied."""
        return _as_it_was(model or self.model, take)

    def with_model(self, model: RobotModel) -> Session:
        """The same recordings with another model of the robot; InputError if it is a different robot."""
        model.check_build(self.model, f"the robot in {self.path}")
        return replace(self, model=model)


def load_session(path: str | Path) -> Session:
    """Reads a `session.yaml`, or the one in a folder.

    InputError names the file, the key and the expected value: an unknown key anywhere, a missing file, a wrong type, a
    joint or link that the model lacks, a base that cannot float where a take says free, a motion that cannot be played.
    """
    path = Path(path)
    if path.is_dir():
        if not (path / "session.yaml").exists():
            raise InputError(path, "expected a session file; this folder holds no session.yaml")
        path /= "session.yaml"
    top = top_of(path, "robot", "ground", "takes", "predict", "registers", "yaw")
    model = read_model(top)
    takes = tuple(_take(f, model) for f in top.sequence("takes"))
    predict = tuple(_predict(f, model) for f in top.sequence("predict"))
    registers = top.file("registers")
    yaw = top.number("yaw", least=-360, most=360)
    top.done()
    for key, entries in (("takes", takes), ("predict", predict)):
        names = [e.name for e in entries]
        for i, name in enumerate(names):
            if name in names[:i]:
                raise top.error(f"{key}[{i}].name", f"duplicate name '{name}'")
    if not takes and not predict:
        raise top.error("takes", "expected at least one take")
    model = model.with_held(all(base == "fixed" for base in [*(t.base for t in takes), *(p.base for p in predict)]))
    return Session(path, model, takes, predict, registers=None if registers is None else load_registers(registers, model),
                   yaw=None if yaw is None else math.radians(yaw))


def _take(f: Fields, model: RobotModel) -> TakeSpec:
    f.only("name", "recording", "motion", "cycles", "base", "starts_at", "servos", "use", "load")
    name = _entry_name(f)
    use = f.text("use", choices=("fit", "validate"))
    take = TakeSpec(
        name=name, recording=_recording(f, name), motion=f.file("motion"),
        cycles=f.whole("cycles", None, least=1, most=MOST_CYCLES), base=_base(f, model),
        starts_at=f.number("starts_at", least=0, most=FILES.most_seconds),
        servos=_changes(f, model), use=use, load=_load(f, model),  # type: ignore[arg-type]
    )
    f.done()
    take.commands(model)  # a motion that the robot cannot play is the session's error, not a damaged take
    return take


def _recording(f: Fields, take: str) -> Path:
    written = f.required("recording", f.text("recording"))
    try:
        return recording_of_take(f.path.parent / written, take)
    except InputError as e:
        raise f.error("recording", e.problem) from None


def _predict(f: Fields, model: RobotModel) -> PredictSpec:
    f.only("name", "motion", "cycles", "commands", "start", "starts_at", "frames", "base", "servos", "load")
    spec = PredictSpec(
        name=_entry_name(f), motion=f.file("motion"), cycles=f.whole("cycles", None, least=1, most=MOST_CYCLES),
        commands=f.file("commands"), start=f.file("start"), starts_at=f.number("starts_at", least=0, most=FILES.most_seconds),
        frames=f.whole("frames", least=1, most=FILES.most_frames),
        base=_base(f, model), servos=_changes(f, model), load=_load(f, model),
    )
    f.done()
    if (spec.motion is None) == (spec.commands is None):
        raise f.error("motion", "expected either motion (with start, starts_at, frames) or commands")
    if spec.motion is not None:
        for key in ("start", "starts_at", "frames"):
            f.required(key, getattr(spec, key))
        load_motion(spec.motion, model)
    return spec


def _entry_name(f: Fields) -> str:
    name = str(f.required("name", f.text("name")))
    if name != Path(name).name or name in (".", "..") or len(name.encode()) > FILES.longest_name or not name.isprintable():
        raise f.error("name", f"expected a name that can be a file's, of at most {FILES.longest_name} bytes, got {name[:40]!r}")
    return name


def _base(f: Fields, model: RobotModel) -> Base:
    """"free" or "fixed"; as is usual for the robot if the take does not say."""
    given = f.text("base", choices=("free", "fixed"))
    base: Base = model.usual_base if given is None else "fixed" if given == "fixed" else "free"
    try:
        model.check_base(floating=base == "free")
    except InputError as e:
        raise f.error("base", f"'{base}', but {e.problem} ({model.description})") from None
    return base


def _load(f: Fields, model: RobotModel) -> KnownLoad | None:
    given = f.mapping("load")
    if given is None:
        return None
    given.only("link", "mass", "at")
    link = given.required("link", given.text("link", choices=tuple(model.kinematics.links)))
    mass = given.required("mass", given.number("mass", least=0, most=MOST_MASS))
    at = given.required("at", given.raw("at"))
    if not isinstance(at, list) or len(at) != 3 or not all(_is_number(x) and abs(x) <= FURTHEST for x in at):
        raise given.error("at", f"expected three numbers of -{FURTHEST:g} to {FURTHEST:g} m in the link's frame, got {at!r}")
    given.done()
    return KnownLoad(link, mass, (float(at[0]), float(at[1]), float(at[2])))


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _changes(f: Fields, model: RobotModel) -> dict[str, float]:
    given = f.mapping("servos")
    if given is None:
        return {}
    changes: dict[str, float] = {}
    for key, value in given.items():
        if not _is_number(value):
            raise given.error(key, f"expected a number, got {value!r}")
        changes[key] = float(value)
    try:
        model.with_servos(changes)
    except ValueError as e:
        raise f.error("servos", str(e)) from None
    return changes
