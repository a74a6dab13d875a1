"""Checks that every verb makes before the long work: reports problems of its files on stderr, and refuses very long simulations
unless they are intended."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from workbench.cli.progress import warn

if TYPE_CHECKING:
    from workbench.compare.session import Session
    from workbench.motion import Motion
    from workbench.robot import RobotModel


def add_yes(parser: argparse.ArgumentParser) -> None:
    """--yes: long simulations are intended."""
    parser.add_argument("--yes", action="store_true",
                        help="allow simulations longer than ten minutes of robot time")


def check_session(verb: str, session: Session, yes: bool = True) -> frozenset[str]:
    """Warns of a session's problems and returns the names of the takes that are left out. InputError if its takes cannot be used,
    or cannot be used together, or if one is so long that it is probably a mistake, unless `yes`."""
    from workbench.files import InputError
    from workbench.inspect.problems import session_check

    found = session_check(session)
    warn(verb, found.warnings)
    if found.refused:
        raise InputError(None, found.refused)
    _ask(f"{session.path}: {found.longest_name}", found.longest, yes)
    return found.damaged_takes


def say_left_out(verb: str, left_out: Iterable[tuple[str, str]], warned: frozenset[str] = frozenset()) -> None:
    """Names the takes that were left out and why, except those already reported (`told`) before the work."""
    for name, reason in left_out:
        if name not in warned:
            print(f"workbench {verb}: warning: take '{name}' left out: {reason}", file=sys.stderr)


def check_model(verb: str, model: RobotModel) -> None:
    """Warns of a robot's problems."""
    from workbench.inspect.problems import model_problems_of, summarize

    problems = model_problems_of(model)
    warn(verb, [f"{model.description}: {summarize(problems)}"] if problems else [])


def check_motion(verb: str, motion: Motion, cycles: int | None = None, yes: bool = True) -> None:
    """Warns of a motion's problems; InputError if it lasts so long that it is probably a mistake, unless `yes`."""
    from workbench.files import InputError
    from workbench.inspect.problems import motion_problems, slow_poses, summarize

    problems = motion_problems(motion, cycles)
    warn(verb, [f"{motion.source}: {summarize(problems)}"] if problems else [])
    if (text := slow_poses(motion)) and not yes:
        raise InputError(motion.source, f"{text}; add --yes if this is intended")
    _ask(motion.source, motion.seconds(cycles), yes)


def check_certificate_of(verb: str, path: str, motion: Motion, model: RobotModel, force: bool) -> None:
    """Checks that the certificate of a motion made by `optimize` is valid for this robot; InputError if it is not, unless
    `force`, which only warns. Every verb that moves a robot, or writes tables that move one, calls this first."""
    from workbench.gait.certificate import has_mark

    if has_mark(path):
        _check_certificate(verb, path, motion, model, force)


def check_table_of(verb: str, path: str, model: RobotModel, force: bool) -> None:
    """The same for a binary table, which does not say what wrote it: a certificate in its folder must be its own; without one,
    the joints' limits are checked as for any motion. InputError, unless `force`, which warns."""
    from dataclasses import replace
    from pathlib import Path

    from workbench.device.tables.limits import refuse_broken_limits
    from workbench.device.tables.table_file import read_table_file
    from workbench.gait.certificate import NAME
    from workbench.motion import Motion
    from workbench.robot import bus_ids

    table = read_table_file(path, {i: joint for joint, i in bus_ids(model).items()}).table
    known = [table.joints.index(j) for j in model.joints if j in table.joints]
    if len(known) == len(table.joints):  # a controller's table is in order of names, a motion in the model's
        table = replace(table, joints=tuple(table.joints[k] for k in known), goals=table.goals[:, known],
                        speeds=table.speeds[:, known])
    if not Path(path).with_name(NAME).is_file():
        warn(verb, [str(v) for v in refuse_broken_limits(table, model, force, None, "not loaded")])
        return
    _check_certificate(verb, path, Motion.from_table(table), model, force)


def _check_certificate(verb: str, path: str, motion: Motion, model: RobotModel, force: bool) -> None:
    from workbench.files import InputError
    from workbench.gait.certificate import check_certificate

    try:
        check_certificate(path, motion, model)
    except InputError as e:
        if not force:
            raise InputError(e.source, f"{e.problem}; use --force to override") from None
        warn(verb, [str(e)])


def check_files(verb: str, files: Iterable[str], model: RobotModel, cycles: int | None = None, yes: bool = True) -> None:
    """Warns of the problems of a robot, and of motions and recordings of it."""
    from workbench.inspect.problems import recording_problems, serious, summarize
    from workbench.motion import load_motion
    from workbench.recording.formats.file_kind import file_kind
    from workbench.recording.formats.read import read_recording

    check_model(verb, model)
    for file in files:
        kind = file_kind(file)
        if kind == "motion":
            check_motion(verb, load_motion(file, model), cycles, yes)
        elif kind == "recording":
            recording = read_recording(file)
            problems = serious(recording_problems(file, recording, model))
            warn(verb, [f"{file}: {summarize(problems)}"] if problems else [])
            _ask(file, float(recording.time[-1] - recording.time[0]), yes)


def _ask(what: str, seconds: float, yes: bool) -> None:
    from workbench.files import InputError
    from workbench.inspect.problems import long_work

    text = long_work(seconds)
    if text and not yes:
        raise InputError(None, f"{what}: {text}; add --yes if this is intended")
