"""Problems of the files that a run uses, found by checking them against the robot; reported by `inspect` and every other verb."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from filecmp import cmp
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from workbench.compare.options import FILES
from workbench.compare.prediction import read_start
from workbench.compare.session import PredictSpec, Session, TakeSpec
from workbench.compare.session_takes import capture_yaw, read_takes, readable
from workbench.effects.apply import resolve
from workbench.files import InputError
from workbench.files.errors import MistypedError
from workbench.files.problem import RoutineProblem
from workbench.motion import Motion, load_motion
from workbench.recording.formats.read import read_recording
from workbench.recording.mocap.mending import repaired
from workbench.recording.mocap.tracks import check_assets
from workbench.recording.recording import Recording
from workbench.recording.servo_log.plausibility import beyond_range
from workbench.recording.take_from import named_by_model
from workbench.robot import RobotModel

_IN_FULL = 3
"""Problems that a line states in full."""


class Part(NamedTuple):
    """Part of a session that has problems. kind: "robot", one "take", all "takes", or one prediction ("predict"). name: of a take
    or prediction."""

    kind: Literal["robot", "take", "takes", "predict"]
    name: str = ""

    def __str__(self) -> str:
        return f"{self.kind} '{self.name}'" if self.name else self.kind


@dataclass(frozen=True)
class SessionCheck:
    """Problems of a session.

    problems: by part of the session, a line each. longest: duration of its longest take or prediction [s], and longest_name that
    part's name. damaged: the parts that cannot be read or used; the verbs leave such takes out with a warning, and refuse such
    predictions. refused: why no verb can use the takes, or use them together, with the file's name.
    """

    problems: Mapping[Part, Sequence[str]]
    longest: float
    longest_name: str
    damaged: frozenset[Part] = frozenset()
    refused: str | None = None

    @property
    def damaged_takes(self) -> frozenset[str]:
        """Names of the takes that are left out."""
        return frozenset(part.name for part in self.damaged if part.kind == "take")

    @property
    def warnings(self) -> list[str]:
        """One line for each part with serious problems, damaged takes among them."""
        out = []
        for part, lines in self.problems.items():
            bad = [] if part.kind == "takes" and self.refused else serious(lines)
            if part in self.damaged:
                out += [f"{part} left out: {bad[0]}"] if part.kind == "take" else []
            elif bad:
                out.append(f"{part}: {summarize(bad)}")
        return out


def session_check(session: Session) -> SessionCheck:
    """Checks a session: its robot, its servos, its takes and its predictions. Every file is read and checked against the robot;
    a damaged one is a problem of its take."""
    found: dict[Part, list[str]] = {Part("robot"): model_problems_of(session.model)}
    seconds: dict[Part | None, float] = {None: 0.0}
    damaged, mistyped = set[Part](), ""
    entries: tuple[TakeSpec | PredictSpec, ...] = (*session.takes, *session.predict)
    for entry in entries:
        part = Part("take" if isinstance(entry, TakeSpec) else "predict", entry.name)
        try:
            found[part], seconds[part] = (_take_problems(entry, session) if isinstance(entry, TakeSpec)
                                          else _prediction_problems(entry, session))
            if entry.servos:
                found[part] += sorted({text for servo in session.model_of(entry).servos.values() for text in servo.doubts})
        except InputError as e:
            found[part] = [str(e)]
            damaged.add(part)
            if isinstance(e, MistypedError):
                mistyped = mistyped or f"{session.path}: {part}: {e}"
    usable = not mistyped and any(Part("take", t.name) not in damaged for t in session.takes)
    refused = _no_yaw(session) if usable else None
    if refused:
        found[Part("takes")] = [refused]
    if session.yaw is None and not session.takes and any(p.start is not None for p in session.predict):
        found[Part("predict")] = ["no take tells the yaw of the capture: it is estimated to a few degrees from the bodies' "
                                  "positions at the start; give the session's `yaw` [deg], or a captured take"]
    for name, others in recorded_twice(session).items():
        found.setdefault(Part("take", name), []).insert(
            0, f"has the same recording as {others}: what is fitted to one is not held out in the other; leave one out")
    longest = max(seconds, key=lambda part: seconds[part])
    doubtful = {part: lines for part, lines in found.items() if lines}
    return SessionCheck(doubtful, seconds[longest], str(longest or ""), frozenset(damaged), mistyped or refused)


def recorded_twice(session: Session) -> dict[str, str]:
    """Takes whose recording is a copy of an earlier take's, byte for byte, with that take."""
    earlier: list[tuple[Path, str, str]] = []
    out = {}
    for take in session.takes:
        file, part = take.recording, ""
        if not file.is_file():
            whole, _, part = str(file).partition("#")  # one programme or episode of a file
            file = Path(whole)
        if not file.is_file():
            continue
        twin = next((name for other, its_part, name in earlier if its_part == part and cmp(other, file, shallow=False)), None)
        if twin is not None:
            out[take.name] = f"take '{twin}'"
        earlier.append((file, part, take.name))
    return out


def _no_yaw(session: Session) -> str | None:
    """Why the yaw of the capture cannot be found from the takes; None where it can, or where the session gives it."""
    try:
        capture_yaw(session, read_takes(session)[0])
    except InputError as e:
        return str(e)
    return None


def model_problems_of(model: RobotModel) -> list[str]:
    """Problems of a robot's description, its servos' constants and its effects, one line each."""
    out = list(model.held_problems if model.held else model.problems)
    doubts = {text: joint for joint, servo in model.servos.items() for text in servo.doubts}
    out += [f"servo of {joint}: {text}" for text, joint in doubts.items()]
    out += model.ground.doubts
    given = set(model.servos)
    lacking = [j for j in model.joints if j not in given]
    if given and lacking:
        out.append(f"servos: none is given for {', '.join(lacking)}; taken as an AX-12A")
    acting = [" ".join([e.effect, *sorted(e.where)]) for _, e, _ in resolve(model)]  # InputError for an invalid effect
    out += [f"effect '{name}' is given {acting.count(name)} times: they act together" for name in dict.fromkeys(acting)
            if acting.count(name) > 1]
    return out


def recording_problems(path: str | Path, recording: Recording, model: RobotModel | None = None) -> list[str]:
    """Problems of a recording, routine ones last; checked against a `model`'s joints, links and ranges if one is given.
    InputError where it cannot be a recording of that model."""
    out = list(recording.problems)
    if recording.sensing == "mocap":
        if not recording.rigid_bodies:
            found = f"only {len(recording.markers)} markers" if recording.markers else "nothing solved"
            out.append(f"no rigid bodies, {found}: no verb can use it; solve the robot's rigid bodies in the capture "
                       "system (Motive: rigid bodies) and export again, or give the three or more markers of each body a "
                       "common name: leg_1, leg_2, leg_3")
        else:
            if model is not None:
                check_assets(recording, model)
            out += repaired(recording, model).problems
            out += _nothing_moved(recording)
    elif model is not None:
        named = named_by_model(recording, model)
        frames = model.kinematics.frames
        out += _not_logged(named, model)
        out += beyond_range(named, {j: (frames[j].lower, frames[j].upper) for j in model.joints})
    return sorted(dict.fromkeys(out), key=lambda text: isinstance(text, RoutineProblem))


def _nothing_moved(recording: Recording) -> list[str]:
    """A line if every body keeps its pose to the last digit throughout: cameras that see a body give it noise."""
    paths = [np.hstack([body.p, body.quat]) for body in recording.rigid_bodies.values()]
    seen = [path[np.isfinite(path).all(axis=1)] for path in paths]
    if len(recording.time) < FILES.fewest_frames or any(len(path) and np.ptp(path, axis=0).any() for path in seen):
        return []
    return ["no body ever moves, to the last digit: was one pose exported, or was the capture paused?"]


def _not_logged(log: Recording, model: RobotModel) -> list[str]:
    """Joints of the model of which a log lacks the goals or the readings; its commands may come from the session's motion."""
    lacking = [j for j in model.joints if log.commands is not None and j not in log.commands.joints]
    unread = [j for j in model.joints if j not in lacking and not np.isfinite(log.channels.get(f"position.{j}", np.nan)).any()]
    out = []
    if lacking:
        out.append(f"the log has no goals of {', '.join(lacking)}: simulated as held at zero")
    if unread:
        out.append(f"the log has no readings of {', '.join(unread)}: its goals are simulated and compared with nothing")
    return out


def motion_problems(motion: Motion, cycles: int | None = 2) -> list[str]:
    """Problems of a motion that is played `cycles` times (None: as often as its file says), one line each."""
    jumps = motion.often(cycles) > 1 and not motion.closes
    out = ["the last row differs from the first: played in a loop, the motion jumps"] if jumps else []
    if (text := slow_poses(motion) or long_work(motion.seconds(1))) is not None:
        out.append(text)
    if np.abs(motion.angles).max() < FILES.smallest_motion and np.ptp(motion.angles) > 0:
        most = np.rad2deg(np.abs(motion.angles).max())
        out.append(f"no joint leaves {most:.2g} deg: are the angles in radians? (a table has degrees)")
    if np.abs(motion.angles).max() > FILES.largest_angle:
        most = np.rad2deg(np.abs(motion.angles).max())
        out.append(f"a joint goes to {most:.4g} deg from its servo's centre: are the angles in counts? (a table has degrees)")
    try:
        motion.as_table()
    except InputError as e:
        out.append(e.problem)
    return out


def long_work(seconds: float) -> str | None:
    """A line if the requested duration is so long that it is probably a mistake."""
    if seconds <= FILES.longest:
        return None
    return f"lasts {seconds:.6g} s, {seconds / 60:.4g} minutes of the robot's time: check times, frames and cycles"


def slow_poses(motion: Motion) -> str | None:
    """A line if poses follow each other so slowly that their times are probably not in seconds."""
    apart = float(np.median(np.diff(motion.times)))
    if apart <= FILES.slowest_pose:
        return None
    return (f"a pose every {apart:.4g} s, {motion.seconds(1):.6g} s in total: are the times in milliseconds? "
            "(a table has seconds)")


def serious(problems: Sequence[str]) -> list[str]:
    """The problems that are not routine."""
    return [text for text in problems if not isinstance(text, RoutineProblem)]


def summarize(problems: Sequence[str]) -> str:
    """Several problems in one line: the first few in full, the rest counted."""
    more = f" (and {len(problems) - _IN_FULL} more: see workbench inspect)" if len(problems) > _IN_FULL else ""
    return "; ".join(problems[:_IN_FULL]) + more


def _take_problems(take: TakeSpec, session: Session) -> tuple[list[str], float]:
    """Problems of a take's files, and the duration of its recording [s]. InputError where it cannot be used."""
    model = session.model_of(take)
    recording = readable(take.recording, model)
    out = recording_problems(take.recording, recording, model)
    commands = take.commands(model) or recording.commands
    if commands is None:
        raise InputError(take.recording, "no motion is given, and the recording has no commands")
    if take.motion is not None:
        out = [f"{take.motion}: {text}" for text in motion_problems(load_motion(take.motion, model), take.cycles)] + out
    if np.ptp(commands.goals, axis=0).max() == 0 and len(commands.times) > 1:
        out.insert(0, "its commands never change")
    seconds = float(recording.time[-1] - recording.time[0])
    if take.starts_at is not None and take.starts_at > recording.time[-1]:
        out.insert(0, f"starts_at: {take.starts_at:g} s is after the recording's end, {recording.time[-1]:g} s")
    return [*_unlikely(take, model, seconds), *_too_long(seconds), *out], seconds


def _unlikely(take: TakeSpec, model: RobotModel, seconds: float) -> list[str]:
    """Entries of a take that have no effect or cannot be meant, and a duration that shows nothing."""
    out = []
    if seconds < FILES.shortest:
        out.append(f"lasts {seconds:.3g} s: a search compares stretches of {FILES.shortest:g} s; record longer takes")
    if take.cycles is not None and take.motion is None:
        out.append(f"cycles: {take.cycles} has no effect: the take has no motion, its commands are those of the recording")
    if take.load is not None and take.load.mass > model.kinematics.mass:
        out.append(f"load: {take.load.mass:g} kg weighs more than the robot ({model.kinematics.mass:.3g} kg): is it in another "
                   "unit?")
    return out


def _prediction_problems(entry: PredictSpec, session: Session) -> tuple[list[str], float]:
    """Problems of a prediction's files, and its duration [s]. InputError where it cannot be predicted."""
    model = session.model_of(entry)
    if entry.commands is not None:
        log = named_by_model(read_recording(entry.commands), model)
        seconds = float(log.time[-1] - log.time[0])
        return [*_too_long(seconds), *log.problems], seconds
    assert entry.start is not None
    assert entry.motion is not None
    start = read_start(entry.start)
    check_assets(start, model)
    seconds = (entry.frames or 0) / start.rate
    motion = load_motion(entry.motion, model)
    motion.commands(entry.cycles)
    out = [f"{entry.motion}: {text}" for text in motion_problems(motion, entry.cycles)]
    return [*_too_long(seconds), *out], seconds


def _too_long(seconds: float) -> list[str]:
    text = long_work(seconds)
    return [] if text is None else [text]
