"""A complete run: journal, motion, joint log; however it ends, the log so far is kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from workbench.device.bus.bus import Bus
from workbench.device.bus.survey import Survey
from workbench.device.play.journal import PlayJournal
from workbench.device.play.log import NothingPlayedError, finish_log
from workbench.device.play.options import Played, PlayOptions
from workbench.device.play.plan import reading_plan
from workbench.device.play.player import play
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.types import Progress


def preflight(found: Survey) -> None:
    """InputError where something has to be fixed before anything moves: the first problem, and how many there are."""
    problems = found.problems()
    if problems:
        more = f" (and {len(problems) - 1} more; `workbench servos` shows all)" if len(problems) > 1 else ""
        raise InputError(None, f"{problems[0]}{more}; nothing was moved")


def perform(bus: Bus, found: Survey, commands: Commands, log: Path, stop: Callable[[], str], options: PlayOptions | None = None,
            progress: Progress | None = None) -> Played:
    """Plays commands on servos that pass the preflight and writes the joint log. While it runs, LOG.play holds the journal, which
    is deleted when the log is on the disk. BusError, or InputError, where it could not be played to a regular end; where it
    was stopped before there was anything to log, `log_problem` gives the reason."""
    preflight(found)
    reading_plan(bus, len(found.found), commands)
    joints = [servo.joint for servo in found.found.values() if servo.joint is not None]
    path = log.with_suffix(".play")
    with PlayJournal(path, {"joints": joints, "family": bus.profile.name}) as journal:
        try:
            played = play(bus, found, commands, journal, stop, options, progress=progress)
        except BaseException:
            journal.close()
            _finish(path, log)
            raise
    problem = _finish(path, log)
    if problem is not None and not played.stopped:
        raise problem
    return replace(played, log_problem="" if problem is None else problem.problem)


def _finish(path: Path, log: Path) -> InputError | None:
    """Makes the log and takes the journal away; why there is no log. A journal without a motion in it goes as well, as it would
    only be in the way of the next one; any other stays, for --finish."""
    try:
        finish_log(path, log)
    except NothingPlayedError as e:
        path.unlink()
        return e
    except InputError as e:
        return e
    path.unlink()
    return None
