"""Runs a motion on the robot, from the preflight checks to a session that can be compared and diagnosed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from workbench.compare.options import COMPARE
from workbench.compare.session_file import write_session
from workbench.device.bus.bus import Bus
from workbench.device.bus.survey import family_of, survey
from workbench.device.capture import BackgroundRecording, Capture, Recorder, record_take
from workbench.device.controller.play import ControllerRun, play_by_controller
from workbench.device.play import Played, PlayOptions, perform, preflight
from workbench.device.tables.table_file import table_file
from workbench.device.virtual.motive import VirtualLink, VirtualMotive
from workbench.files import InputError
from workbench.motion import Motion, save_motion
from workbench.robot import RobotModel
from workbench.robot.servo_registers import save_registers
from workbench.simulation.virtual_robot import VirtualRobot
from workbench.types import Progress


@dataclass(frozen=True)
class RobotRun:
    """session: its file. takes: as in that file. capture: result of the cameras, None without cameras. done: whether the whole
    motion was played and torque is off."""

    session: Path
    takes: tuple[dict[str, Any], ...]
    played: Played | ControllerRun
    capture: Capture | None
    warnings: tuple[str, ...]
    done: bool = True


def run_on_robot(bus: Bus, model: RobotModel, motion: Motion, cycles: int, folder: Path, stop: Callable[[], str], *,
                 base: str = "free", virtual: VirtualRobot | None = None, recorder: Recorder | None = None,
                 options: PlayOptions | None = None, seed: int = 0, progress: Progress | None = None) -> RobotRun:
    """Checks all servos, plays the motion while the cameras record, and writes takes, registers, motion and session.

    virtual: the emulated robot whose bus this is; its cameras are emulated, too, by `seed`. recorder: of real ones. InputError if
    something has to be fixed first; then nothing has moved.
    """
    tell = progress or (lambda what, done: None)
    found = survey(bus, model, ids=(), progress=tell)
    preflight(found)
    registers = found.registers()
    commands = motion.commands(cycles)
    name = motion.name
    background = None if recorder is None else BackgroundRecording(recorder, folder / f"{name}.csv")
    if background is not None:
        tell("waiting for the cameras", None)
        background.start()
    played = None
    try:
        played = perform(bus, found, virtual.controller(commands) if virtual else commands, folder / f"{name}_joints.csv", stop,
                         options, progress=tell)
    finally:
        capture = None if background is None else background.stop(played.ended if played else None)
    if played.log_problem:
        raise InputError(None, f"stopped: {played.stopped}; there is no joint log: {played.log_problem}")
    if virtual is not None and played.poses:
        tell("the cameras' recording", None)
        capture = _film(virtual, played, folder / f"{name}.csv", seed)
    save_registers(registers, folder / "registers.yaml")
    save_motion(motion.as_sent(), folder / f"{name}_motion.csv")
    takes = _takes(name, cycles, base, played, capture)
    session = write_session(folder, model, takes, "registers.yaml")
    warnings = [f"register {d}" for d in registers.departures(model)] + list(capture.problems if capture else ())
    if played.missed:
        warnings.insert(0, f"{played.missed} goals did not reach their servos in time; this was not the requested motion")
    if played.unknown:
        warnings.insert(0, f"torque may still be on in {', '.join(played.unknown)}: no answer; switch the robot's power off")
    if played.stopped:
        warnings.insert(0, f"stopped: {played.stopped}")
    done = not (played.missed or played.unknown or played.stopped)
    return RobotRun(session, tuple(takes), played, capture, tuple(warnings), done)


def run_by_controller(port: Any, model: RobotModel, motion: Motion, cycles: int, folder: Path, stop: Callable[[], str], *,
                      base: str = "free", virtual: VirtualRobot | None = None, recorder: Recorder | None = None, seed: int = 0,
                      progress: Progress | None = None) -> RobotRun:
    """As `run_on_robot`, but the CM-530's own program plays: the table goes there over its PC link, its log comes back. The
    program checks the servos itself; their registers are not read."""
    tell = progress or (lambda what, done: None)
    commands, name = motion.commands(cycles), motion.name
    table = motion.as_table()
    file = table_file(table, model, cycles, True)
    background = None if recorder is None else BackgroundRecording(recorder, folder / f"{name}.csv")
    if background is not None:
        background.start()
    played = None
    try:
        played = play_by_controller(port, file, commands.end, folder / f"{name}_joints.csv", family_of(model), stop, tell)
    finally:
        capture = None if background is None else background.stop(played.ended if played else None)
    if virtual is not None:
        tell("the cameras' recording", None)
        capture = _film(virtual, played, folder / f"{name}.csv", seed)
    save_motion(motion.as_sent(), folder / f"{name}_motion.csv")
    table_said = {"motion": f"{name}_motion.csv", "cycles": cycles, "base": base}
    takes = [{"name": name, "recording": f"{name}.csv", **table_said}] if capture is not None else []
    takes.append({"name": f"{name}_joints", "recording": f"{name}_joints.csv", **table_said,
                  "starts_at": round(played.start_in_log, 5)})
    session = write_session(folder, model, takes)
    warnings = list(capture.problems) if capture else []
    if played.stopped:
        warnings.insert(0, f"stopped: {played.stopped}")
    return RobotRun(session, tuple(takes), played, capture, tuple(warnings))


def _film(virtual: VirtualRobot, played: Played | ControllerRun, take: Path, seed: int) -> Capture:
    names, scene, begin, end = virtual.scene(played.started, seed)
    motive = VirtualMotive(names, scene, rate=COMPARE.camera_rate, started=begin, seed=seed)
    seconds = end - begin - 1 / COMPARE.camera_rate
    return record_take(Recorder(VirtualLink(motive)), take, lambda: False, seconds, until_time=lambda: played.ended)


def _takes(name: str, cycles: int, base: str, played: Played, capture: Capture | None) -> list[dict[str, Any]]:
    """The takes of the cameras, with the start that both clocks give, and of the servos' own log."""
    takes: list[dict[str, Any]] = []
    if capture is not None:
        starts = played.started - capture.first_host
        takes.append({"name": name, "motion": f"{name}_motion.csv", "cycles": cycles, "recording": f"{name}.csv", "base": base}
                     | ({"starts_at": round(starts, 5)} if starts > 0 else {}))
    return [*takes, {"name": f"{name}_joints", "recording": f"{name}_joints.csv", "base": base}]
