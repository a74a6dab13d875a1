"""Arguments that several verbs share, and the values they give."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from workbench.robot import RobotModel

PUPPY = "package://puppy/puppy.sdf"
MOST = 10_000
"""Largest number of cycles, processes and the like: more is a mistake, not a wish."""


def add_model(parser: argparse.ArgumentParser, default: str = "the bundled puppy", unless: str | None = PUPPY) -> None:
    """--model: which robot. unless: its value where the user names none; default: how the help describes that."""
    parser.add_argument(
        "--model", metavar="FILE", default=unless,
        help="robot: a name (puppy, fox), a model.yaml with its effects, an SDF or URDF, or a session.yaml, whose robot, servos "
        f"and ground are used (default: {default})")
    add_packages(parser)


def add_cycles(parser: argparse.ArgumentParser, default: int) -> None:
    """--cycles: how often a motion's loop runs. default: where neither the option nor the file says it."""
    parser.add_argument("--cycles", type=positive, metavar="N", help="number of times to play the motion, or its loop between "
                        f"start and stop (default: from its file, else {default})")


def add_packages(parser: argparse.ArgumentParser) -> None:
    """--package: where package:// URIs of a model's meshes point."""
    parser.add_argument("--package", metavar="NAME=DIR", dest="packages", type=_package, action="append", default=[],
                        help="folder of a ROS package that the model's meshes refer to; repeatable")


def add_out(parser: argparse.ArgumentParser, default: str | None = None) -> None:
    """--out: the folder for results."""
    kept = "; created if missing, other files in it are kept"
    parser.add_argument(
        "--out", metavar="DIR", type=folder, required=default is None, default=default and Path(default),
        help=f"folder for the results{kept}" + (f" (default: {default})" if default else ""))


def add_engine(parser: argparse.ArgumentParser, auto: str) -> None:
    """--engine: which engine simulates. auto: what `auto` means for this verb, for the help."""
    parser.add_argument("--engine", choices=("auto", "drake"), default="auto",
                        help=f"auto: {auto}; drake: all rollouts by Drake, much slower (default: auto)")


def folder(text: str) -> Path:
    """A folder's path, for argparse; refuses an empty one, which is an unset shell variable rather than the current folder."""
    if not text or "\0" in text:
        raise argparse.ArgumentTypeError("expected a folder")
    return Path(text)


def load_model(name: str, packages: Sequence[tuple[str, str]] = ()) -> RobotModel:
    """The robot that --model names; its effects are checked at once, so that errors name their file."""
    from workbench.api.robots import load_model as named

    return named(name, dict(packages))


def positive(text: str) -> int:
    """A whole number of at least 1, for argparse."""
    from workbench.files.numerals import whole_of

    value = whole_of(text)
    if value is None or not 1 <= value <= MOST:
        raise argparse.ArgumentTypeError(f"expected a whole number from 1 to {MOST}, got {text[:40]}")
    return value


def port(text: str) -> int:
    """The number of a network port, for argparse."""
    from workbench.files.numerals import whole_of

    value = whole_of(text)
    if value is None or not 1 <= value <= 65535:
        raise argparse.ArgumentTypeError(f"expected a port from 1 to 65535, got {text[:40]}")
    return value


def seed(text: str) -> int:
    """A whole number of at least 0, for argparse: random generators take no other."""
    from workbench.files.numerals import whole_of

    value = whole_of(text)
    if value is None or value < 0:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 0, got {text[:40]}")
    return value


def seconds(text: str) -> float:
    """A positive finite number, for argparse."""
    from workbench.files.numerals import number_of

    value = number_of(text)
    if value is None or not value > 0:
        raise argparse.ArgumentTypeError(f"expected a positive number of seconds, got {text[:40]}")
    return value


def time_step(text: str) -> float:
    """A step of the simulation [s], for argparse: with longer ones contact and servos are meaningless, with shorter ones the
    simulation never ends."""
    from workbench.physical import TIME_STEP

    value = seconds(text)
    if TIME_STEP.problem(value) is not None:
        raise argparse.ArgumentTypeError(f"expected {TIME_STEP.least:g} to {TIME_STEP.most:g} s, got {text[:40]}")
    return value


def _package(text: str) -> tuple[str, str]:
    name, equals, folder = text.partition("=")
    if not name or not equals or not Path(folder).is_dir():
        raise argparse.ArgumentTypeError(f"expected NAME=DIR with a folder that is there, got {text[:80]}")
    return name, str(Path(folder).resolve())
