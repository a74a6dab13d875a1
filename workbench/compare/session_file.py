"""Writes a session: a robot, and the recordings of one run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from workbench.files.reading import write_whole
from workbench.files.yaml_file import yaml_text
from workbench.robot import RobotModel
from workbench.robot.model_file import robot_content


def write_session(folder: Path, model: RobotModel, takes: Sequence[Mapping[str, Any]], registers: str | None = None) -> Path:
    """Writes session.yaml (docs/formats.md, section 1), whole or not at all. takes: as in session.yaml, with files relative to
    the folder; registers: the file's name. The model's effects are omitted: the session describes the nominal robot."""
    content = {"format": 1} | robot_content(model, folder)
    if registers is not None:
        content["registers"] = registers
    return write_whole(folder / "session.yaml", yaml_text(content | {"takes": [dict(take) for take in takes]}))
