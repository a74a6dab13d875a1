"""Arguments that several verbs share, and what they stand for."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from workbench.robot import RobotModel

PUPPY = "package://puppy/puppy.sdf"


def add_model(parser: argparse.ArgumentParser, default: str = "the bundled puppy") -> None:
    """--model: which robot; PUPPY where nothing is said. default: what that stands for."""
    parser.add_argument(
        "--model", metavar="FILE", default=PUPPY,
        help="robot: a model.yaml with its effects, an SDF or URDF, or a session.yaml whose robot, servos and ground are taken "
        f"(default: {default})")


def add_out(parser: argparse.ArgumentParser, default: str | None = None) -> None:
    """--out: the folder for results."""
    said = "; is made if need be, other files in it stay"
    parser.add_argument(
        "--out", metavar="DIR", type=_folder, required=default is None, default=default and Path(default),
        help=f"folder for the results{said}" + (f" (default: {default})" if default else ""))


def _folder(text: str) -> Path:
    """A folder's path, for argparse; empty is a shell variable that nobody set, not here."""
    if not text:
        raise argparse.ArgumentTypeError("expected a folder")
    return Path(text)


def load_model(name: str) -> RobotModel:
    """The robot that --model names; its effects are checked at once, so that what is wrong is said of their file."""
    from workbench.compare.session import load_session
    from workbench.effects.apply import resolved
    from workbench.robot import InputError, RobotModel, puppy_model
    from workbench.robot.model_file import load_model as read_model_file
    from workbench.robot.yaml_file import read_yaml

    if name == PUPPY:
        return puppy_model()
    if Path(name).suffix.lower() in (".yaml", ".yml"):
        content = read_yaml(name)
        if isinstance(content, dict) and not {"takes", "predict"}.isdisjoint(content):
            return load_session(name).model
        model = read_model_file(name)
        try:
            list(resolved(model))
        except InputError as e:
            raise InputError(name, f"effects: {e.problem}") from None
        return model
    return RobotModel(name)


def positive(text: str) -> int:
    """A whole number of at least 1, for argparse."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected 1 or more, got {value}")
    return value


def seconds(text: str) -> float:
    """A positive finite number, for argparse."""
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"expected a positive number of seconds, got {text}")
    return value
