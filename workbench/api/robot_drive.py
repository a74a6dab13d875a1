"""Steers a gait on the robot: the CM-530 plays it, cameras see it, and each cycle's table is chosen while another one plays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from workbench.device.bus.survey import family_of
from workbench.device.controller.telemetry import write_telemetry
from workbench.device.virtual.clock import SECOND
from workbench.files import InputError
from workbench.gait.drive.controller import CycleController
from workbench.gait.drive.family import GaitFamily
from workbench.gait.drive.loop import FELL, Driven, Watch, drive
from workbench.gait.drive.path import WayPath
from workbench.gait.drive.robot_walk import ControllerWalk, PoseSource, RobotWalkOptions
from workbench.robot import RobotModel
from workbench.robot.mounting import JointServo, Mounting
from workbench.simulation.virtual_robot import VirtualRobot
from workbench.types import Progress

ARRIVED = ("end of the path",)


@dataclass(frozen=True)
class RobotDrive:
    """driven: as in simulation; of a real robot its poses are those that the cameras saw. late: tables that came too late, so
    that the cycle before was repeated. log: the joint log. warnings: for the user."""

    driven: Driven
    late: int
    log: Path | None
    warnings: tuple[str, ...]

    @property
    def arrived(self) -> bool:
        """Whether it walked to the end of its path."""
        return self.driven.reason in ARRIVED


def drive_on_robot(port: Any, model: RobotModel, family: GaitFamily, path: WayPath, controller: CycleController,
                   cameras: PoseSource, folder: Path, stop: Callable[[], str], *, virtual: VirtualRobot | None = None,
                   most_cycles: int = 200, options: RobotWalkOptions | None = None,
                   progress: Progress = lambda what, done: None, watch: Watch | None = None) -> RobotDrive:
    """Steers the robot behind `port`, the PC link of a CM-530 with the workbench's program, along `path`.

    stop: "" until the user wants it to end. virtual: the emulated robot behind the port, whose true path is then known. However
    it ends, the robot is released: after its stop section or, if it was stopped, a ramp to neutral; at once if it fell. BusError
    in one line if the controller is not there, refuses a table, or does not confirm the release.
    """
    walk = ControllerWalk(port, family, cameras, stop, options, progress)
    gently = False
    try:
        driven = drive(walk, path, controller, most_cycles, True, progress, watch)
        gently = driven.reason != FELL
    finally:
        walk.release(gently)
    warnings = [] if driven.reason in ARRIVED else [f"stopped: {driven.reason}"]
    if walk.late:
        warnings.append(f"{walk.late} tables came too late; the cycle before was repeated")
    if virtual is not None and virtual.body.let_go is not None:
        driven = replace(driven, take=virtual.body.take(walk.first_pose - virtual.body.let_go / SECOND))
    log: Path | None = None
    try:
        joints = sorted(model.joints)
        servos = [JointServo(family_of(model), model.mountings.get(joint, Mounting())) for joint in joints]
        log = write_telemetry(folder / "driven_joints.csv", walk.rounds(), joints, servos)
    except InputError as e:
        warnings.append(str(e))
    return RobotDrive(driven, walk.late, log, tuple(warnings))
