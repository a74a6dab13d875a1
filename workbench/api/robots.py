"""A robot by name or by file."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from workbench.compare.session import load_session
from workbench.effects.apply import resolve
from workbench.files import InputError
from workbench.files.yaml_file import read_yaml
from workbench.robot import ROBOTS, RobotModel, puppy_model, resource_dir
from workbench.robot.model import PUPPY
from workbench.robot.model_file import Posterior
from workbench.robot.model_file import load_model as read_model_file
from workbench.robot.model_file import save_model as write_model_file


def load_model(source: str | PathLike[str], packages: Mapping[str, str] | None = None) -> RobotModel:
    """A robot, with its servos and its diagnosed effects.

    source: "puppy" or another bundled robot, by name; a model.yaml, as `diagnose` writes it; a session.yaml (or its folder),
    whose robot, servos and ground are taken; or an SDF, URDF or package:// URL, with AX-12A servos. packages: folder of each ROS
    package that such a description names. InputError names the file, the key and the expected value, also for an effect that is
    not installed.
    """
    name = fspath(source)
    if name in (PUPPY, "puppy"):
        return puppy_model()
    if name in ROBOTS:
        name = str(resource_dir("data") / name / "model.yaml")
    if Path(name).is_dir():
        return load_session(name).model
    if Path(name).suffix.lower() not in (".yaml", ".yml"):
        return RobotModel(name, packages=packages or {})
    content = read_yaml(name)
    if isinstance(content, dict) and not {"takes", "predict"}.isdisjoint(content):
        return load_session(name).model
    model = read_model_file(name)
    try:
        list(resolve(model))
    except InputError as e:
        raise InputError(name, f"effects: {e.problem}") from None
    return model


def save_model(model: RobotModel, path: str | PathLike[str], posterior: Posterior | None = None,
               provenance: Mapping[str, Any] | None = None) -> Path:
    """Writes model.yaml, whole or not at all; returns its path.

    posterior: of the effects' parameters, provenance: how they were found; both are kept for the reader and do not affect
    simulation. InputError if an effect is unknown, acts on a part that does not exist or has impossible numbers, or if the file
    cannot be written.
    """
    list(resolve(model))
    return write_model_file(model, Path(path), posterior, provenance)
