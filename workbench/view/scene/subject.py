"""The content of a file to view: a robot, a session, or a take."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from workbench.compare.compare_files import recorded_take
from workbench.compare.session import Base
from workbench.files import InputError
from workbench.files.yaml_file import read_yaml
from workbench.motion import load_motion
from workbench.recording.formats.file_kind import file_kind
from workbench.recording.formats.rollout_table import load_rollout
from workbench.recording.take import Take
from workbench.robot import ROBOTS, RobotModel
from workbench.simulation import Simulation, SimulationConfig
from workbench.simulation.play import play_motion


def subject_of(name: str) -> Literal["model", "session", "take"]:
    """The kind, recognised by the name and, for a YAML file, by its keys. InputError if a YAML file cannot be read."""
    path = Path(name)
    if name in ROBOTS or name.startswith("package://") or path.suffix.lower() in (".sdf", ".urdf", ".xml"):
        return "model"
    if (path / "session.yaml").is_file():
        return "session"
    if path.suffix.lower() in (".yaml", ".yml"):
        content = read_yaml(path)
        return "session" if isinstance(content, dict) and "takes" in content else "model"
    if not path.suffix and not path.exists():
        raise InputError(name, f"not found; expected {', '.join(ROBOTS)}, or a file")
    return "take"


def take_of(name: str, model: RobotModel, base: Base, cycles: int | None, progress: Callable[[str, float | None], None]) -> Take:
    """A rollout as it is, a recording from its first motion on, a motion simulated. InputError names the file and the problem."""
    kind = file_kind(name)
    if kind == "rollout":
        return load_rollout(name)
    if kind == "recording":
        return recorded_take(name, model, base)
    model.check_base(floating=base == "free")
    simulation = Simulation(model, SimulationConfig(base=base))
    motion = load_motion(name, model)
    return play_motion(simulation, motion, motion.often(cycles, 3), progress=lambda done: progress("simulating", done))
