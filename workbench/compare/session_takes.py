"""A session's recordings, read and brought into the model's frame and clock; damaged takes are named and left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from workbench.compare.comparison import align
from workbench.compare.options import FILES
from workbench.compare.session import Session, TakeSpec
from workbench.effects.apply import apply_to_measurement
from workbench.files import InputError
from workbench.files.errors import MistypedError
from workbench.motion.commands import Commands
from workbench.recording.formats.read import read_recording
from workbench.recording.joint_names import named_by_model
from workbench.recording.mocap.observe import observe
from workbench.recording.mocap.registration import register
from workbench.recording.mocap.standing import moving_at_start
from workbench.recording.mocap.tracks import check_assets
from workbench.recording.mocap.yaw import session_yaw
from workbench.recording.recording import Measurement, Recording
from workbench.recording.servo_log.started import start_in_log
from workbench.recording.servo_log.state import first_command, state_at
from workbench.recording.take import Take
from workbench.recording.take_from import take_from_recording
from workbench.robot import RobotModel
from workbench.simulation import Start
from workbench.types import Array, Progress, no_progress

LeftOut = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class ReadTake:
    """A take as read from its file, with the robot as it was then and the commands sent on the bus."""

    spec: TakeSpec
    model: RobotModel
    recording: Recording
    commands: Commands | None

    @property
    def duration(self) -> float:
        """Time from the first command to the recording's end [s], assuming that the first command came when the recording
        began."""
        logged = self.recording.sensing == "encoders"
        begin = first_command(self.recording, self.spec.starts_at) if logged else self.spec.starts_at or 0.0
        return float(self.recording.time[-1] - begin)

    def start_state(self) -> Start | None:
        """The joints' state at the first command, where a rollout cannot begin at rest in neutral: for a log of a held robot,
        from its servos' readings. None for captured takes, for a robot on the ground, and for a log that begins at rest in
        neutral to within its resolution."""
        return self._start

    @cached_property
    def _start(self) -> Start | None:
        if self.recording.sensing == "mocap" or self.spec.base != "fixed":
            return None
        state = state_at(self.recording, self.model.joints, first_command(self.recording, self.spec.starts_at))
        return None if state is None else Start(*state, logged=True)


@dataclass(frozen=True)
class RegisteredTake(ReadTake):
    """A take in the model's frame. recorded: zeroed at rest, as the cameras see it; measurement: how to observe a rollout in the
    same way."""

    measurement: Measurement
    recorded: Take

    def observe(self, rollout: Take, model: RobotModel | None = None) -> Take:
        """A rollout of this take as the recording would show it: on its clock, and zeroed in the same way (logs are not zeroed).

        model: the robot that was simulated, if its effects differ from this take's: some effects change what cameras see."""
        if not self.recorded.zeroed:
            return align(rollout.as_logged(), self.recorded)
        model = model or self.model
        return observe(rollout, apply_to_measurement(self.measurement, model), model, self.recorded.time)[0]


def read_takes(session: Session) -> tuple[list[ReadTake], LeftOut]:
    """All recordings of a session, and those left out with the reason. InputError if none remains. An asset without a link in the
    session, a start after a recording's end, or a mistyped name, is an error (InputError) rather than a damaged take."""
    read: list[ReadTake] = []
    left: list[tuple[str, str]] = []
    for spec in session.takes:
        model = session.model_of(spec)
        try:
            recording = readable(spec.recording, model)
        except MistypedError as e:
            raise MistypedError(session.path, f"take '{spec.name}': {e}") from None
        except InputError as e:
            left.append((spec.name, str(e)))
            continue
        if recording.rigid_bodies:
            check_assets(recording, model)
        commands = spec.commands(model) or recording.commands
        if commands is None:
            raise InputError(session.path, f"take '{spec.name}': motion: is missing, and the recording has no commands")
        if spec.starts_at is None and spec.motion is not None and (start := start_in_log(recording, commands)) is not None:
            spec = replace(spec, starts_at=start)
        take = ReadTake(spec, model, recording, commands)
        if spec.starts_at is not None and take.duration < FILES.least_seconds:
            raise InputError(session.path, f"take '{spec.name}': starts_at: {spec.starts_at:g} s, but the recording ends at "
                                           f"{recording.time[-1]:.6g} s; expected {FILES.least_seconds:g} s or more of motion")
        read.append(take)
    return read, remaining(session, read, tuple(left))


def readable(path: Path, model: RobotModel) -> Recording:
    """Reads a recording that can be compared: InputError if it cannot be read, has too few frames, is over in no time, or has
    neither visible rigid bodies nor joints."""
    recording = read_recording(path)
    check_length(path, recording.time)
    if recording.channels:
        log = named_by_model(recording, model)
        read = [values for name, values in log.channels.items() if name.startswith("position.")]
        if not any(np.isfinite(values).any() for values in read):
            why = "".join(f"; {text}" for text in recording.problems[:1])
            raise InputError(path, f"no joint has a position to compare with{why}")
        return log
    if not recording.rigid_bodies:
        found = f"{len(recording.markers)} markers" if recording.markers else "nothing"
        raise InputError(path, f"expected rigid bodies or joint channels, found {found}")
    if not any(np.isfinite(b.p).any() and b.quat.any() for b in recording.rigid_bodies.values()):
        raise InputError(path, "no rigid body was seen in any frame")
    if all(model.rigid_bodies.get(asset) in model.kinematics.links for asset in recording.rigid_bodies):
        _check_stands(path, recording, model)
    return recording


def check_length(path: Path, time: Array) -> None:
    """InputError where a take's times (N,) [s] are too few to compare, or over in no time."""
    if len(time) < FILES.fewest_frames:
        raise InputError(path, f"holds {len(time)} frame(s); expected {FILES.fewest_frames} or more")
    if (seconds := float(np.ptp(time))) < FILES.least_seconds:
        raise InputError(path, f"lasts {seconds:.3g} s; expected {FILES.least_seconds:g} s or more: are its times in seconds?")


def _check_stands(path: Path, recording: Recording, model: RobotModel) -> None:
    """InputError where a captured robot moves when its recording begins: its angles would count from a pose of the motion."""
    moving, seen = moving_at_start(recording, model, FILES.first_frames, FILES.moves_at_once)
    if seen and len(moving) >= FILES.share_moving * seen:
        names = ", ".join(moving[:3]) + (", …" if moving[3:] else "")
        raise InputError(path, f"the robot moves when the recording begins ({names}); expected its neutral pose "
                               "before the first command, from which its angles are measured")


def remaining(session: Session, takes: Sequence[ReadTake], left_out: LeftOut) -> LeftOut:
    """Returns `left_out`; InputError if no take remains."""
    if takes:
        return left_out
    if not left_out:
        raise InputError(session.path, "takes: expected at least one")
    raise InputError(session.path, "no take can be used: " + "; ".join(f"{name}: {why}" for name, why in left_out))


def register_takes(session: Session, takes: Sequence[ReadTake], rollouts: Mapping[str, Take],
                   progress: Progress = no_progress) -> tuple[list[RegisteredTake], LeftOut]:
    """Registers each take against its rollout (by the take's name), with one yaw for all of them."""
    yaw = capture_yaw(session, takes)
    registered: list[RegisteredTake] = []
    left: list[tuple[str, str]] = []
    for i, t in enumerate(takes):
        progress(f"registering {t.spec.name}", i / len(takes))
        try:
            registered.append(register_take(t, rollouts[t.spec.name], yaw))
        except InputError as e:
            left.append((t.spec.name, str(e)))
    return registered, remaining(session, registered, tuple(left))


def capture_yaw(session: Session, takes: Sequence[ReadTake]) -> float | None:
    """One yaw [rad] for all takes that cameras saw; None without any."""
    captured = [t for t in takes if t.recording.rigid_bodies]
    if not captured or session.yaw is not None:
        return session.yaw
    try:
        return session_yaw([t.recording for t in captured], session.model, [t.commands for t in captured]).yaw
    except InputError as e:
        names = ", ".join(t.spec.name for t in captured)
        raise InputError(e.source or session.path, f"takes {names}: {e.problem}") from None


def register_take(take: ReadTake, predicted: Take | None, yaw: float | None) -> RegisteredTake:
    """Registers one take against a simulation (or another recording). InputError if that is impossible."""
    spec, model, recording, commands = take.spec, take.model, take.recording, take.commands
    measurement = register(recording, model, commands, predicted, spec.starts_at, yaw, spec.base)
    recorded = take_from_recording(recording, measurement, model, name=spec.name, base=spec.base)
    return RegisteredTake(spec, model, recording, commands, measurement, replace(recorded, commands=commands))
