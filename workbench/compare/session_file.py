"""Writing a session: a robot, and what was recorded of it in one go."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from workbench.robot import RobotModel
from workbench.robot.files import write_whole
from workbench.robot.yaml_file import yaml_text


def write_session(folder: Path, model: RobotModel, takes: Sequence[Mapping[str, Any]], registers: str | None = None) -> Path:
    """Writes session.yaml (docs/formats.md, section 1), whole or not at all. takes: as they stand there, files relative to the
    folder; registers: the file's name. The model's effects are left out: the robot is taken for the nominal one."""
    description = model.description if model.description.startswith("package://") else str(model.path)
    robot: dict[str, Any] = {"model": description, "base": model.base}
    if model.servos:
        robot["servos"] = {j: s.written() for j, s in model.servos.items()}
    if model.rigid_bodies:
        robot["rigid_bodies"] = dict(model.rigid_bodies)
    if model.bus_ids:
        robot["bus_ids"] = dict(model.bus_ids)
    content: dict[str, Any] = {"format": 1, "robot": robot}
    ground = {k: v for k, v in asdict(model.ground).items() if v is not None}
    if ground:
        content["ground"] = ground
    if registers is not None:
        content["registers"] = registers
    return write_whole(folder / "session.yaml", yaml_text(content | {"takes": [dict(take) for take in takes]}))
