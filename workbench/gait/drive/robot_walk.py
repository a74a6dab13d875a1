"""Who walks: a robot whose CM-530 plays the gait, seen by cameras; one table a cycle over the PC link."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.device.bus.errors import BusError
from workbench.device.controller.play import ENDED, SPARE, UNCONFIRMED, StopAskedError
from workbench.device.controller.walk import CycleController, LeftPlayError
from workbench.device.link import LogMessage
from workbench.device.tables.limits import refuse_broken_limits
from workbench.device.tables.table_file import JointBounds, TableFile, table_file
from workbench.files.option_checks import check_positive, check_whole
from workbench.gait.drive.family import GaitFamily, Steer
from workbench.gait.drive.walk import Seen, StoppedError
from workbench.motion import PoseTable
from workbench.recording.take import Take
from workbench.types import Array, Progress, no_progress


class PoseSource(Protocol):
    """Cameras that see the robot while it walks."""

    def rest(self) -> None:
        """The robot stands where it starts: poses count from here. InputError where it is not seen."""
        ...

    def seen(self) -> Seen:
        """The robot's pose now, in the frame of its start."""
        ...


@dataclass(frozen=True)
class RobotWalkOptions:
    """Limits of a walk on the robot.

    unattended: cycles that the program walks on when no table comes, as when the cable is pulled; then it ramps to neutral. Two
    cycles are needed while all is well. late: tables that may come too late one after another; each time the cycle before is
    repeated. margin: before the end of a cycle by which its successor has to be checked [s]: a sweep of the servos.
    """

    unattended: int = 4
    late: int = 3
    margin: float = 0.01

    def __post_init__(self) -> None:
        check_whole(self, unattended=2, late=1)
        check_positive(self, "margin")


class ControllerWalk:
    """The family's cycles on a CM-530 with the workbench's program. port: its PC link. stop: "" until the user wants it to end.

    `release` has to be called however it ends; `late` counts tables that came too late.
    """

    def __init__(self, port: Any, family: GaitFamily, cameras: PoseSource, stop: Callable[[], str],
                 options: RobotWalkOptions | None = None, tell: Progress = no_progress
                 ) -> None:
        self.family, self.cameras, self.options = family, cameras, options or RobotWalkOptions()
        self.controller = CycleController(port, stop)
        self.late, self._row, self._tell = 0, 0, tell
        self._ends = self.first_pose = 0.0
        self._bounds: tuple[JointBounds, ...] = ()
        self._poses: list[tuple[float, Array]] = []

    def begin(self) -> Seen:
        """Uploads start and first cycle, goes to neutral, plays the start section."""
        self._tell("uploading", None)
        first = self._file(PoseTable.in_sections(self.family.start, self.family.cycle(), None), self.options.unattended)
        self._bounds = first.joints
        try:
            self._tell("to neutral", None)
            self.first_pose = self.controller.begin(first)
            self.cameras.rest()
            self._ends = self.first_pose + self.family.start_seconds
            return self._at_end()
        except StopAskedError as e:
            raise StoppedError(e.reason) from None

    def cycle(self, steer: Steer, after: Steer | None) -> Seen:
        """While a cycle plays, sends the one after it: steered by `after`, or with None the stop. steer: as was said before."""
        try:
            if after is None:
                self.controller.send_next(self._file(self.family.stop(steer), 1))
            else:
                self.controller.send_next(self._file(self.family.cycle(after, steer), self.options.unattended))
            self._ends += self.family.period
            return self._at_end()
        except StopAskedError as e:
            raise StoppedError(e.reason) from None

    def end(self) -> None:
        """Waits until the stop has been played and the robot is in neutral."""
        seconds = float(self.family.stop().dwells_ms.sum()) / 1000 + self.family.period + SPARE
        try:
            try:
                self.controller.listen(self._ends + seconds)
            except LeftPlayError as e:
                if e.reason != ENDED:
                    raise StoppedError(e.reason) from None
            why = self.controller.back()
        except StopAskedError as e:
            raise StoppedError(e.reason) from None
        if why:
            raise StoppedError(why)

    def release(self, gently: bool) -> None:
        """Torque off. gently: first back to neutral if it still moves, unless the user asks to stop meanwhile. BusError where the
        release was not confirmed."""
        try:
            if gently:
                with suppress(StopAskedError, BusError):
                    self.controller.back()
        finally:
            released = self.controller.release()
        if not released:
            raise BusError("stopped" + UNCONFIRMED)

    def rounds(self) -> list[LogMessage]:
        """The program's log."""
        return [m for _, m in self.controller.heard if isinstance(m, LogMessage)]

    def take(self) -> Take:
        """The captured poses at the ends of cycles, as a take without joints."""
        known = [(t, p) for t, p in self._poses if np.isfinite(p).all()] or [(0.0, np.zeros(3))]
        time, poses = np.array([t for t, _ in known]), np.array([p for _, p in known])
        quat = Rotation.from_euler("z", poses[:, 2:]).as_quat(scalar_first=True)
        p_WB = np.column_stack([poses[:, :2], np.zeros(len(poses))])
        return Take(name="driven", source="mocap", time=time - time[0], joints=(), q=np.empty((len(time), 0)), p_WB=p_WB,
                    quat_WB=quat)

    def _at_end(self) -> Seen:
        """Waits for the end of the cycle, checks that its successor has been taken, and looks at the robot."""
        try:
            self.controller.listen(self._ends - self.options.margin)
            if self._poses:
                self._check_taken()
            self.controller.listen(self._ends)
        except LeftPlayError as e:
            raise StoppedError(e.reason) from None
        seen = self.cameras.seen()
        self._poses.append((self._ends, seen.captured))
        return seen

    def _check_taken(self) -> None:
        if self.controller.taken():
            self._row = 0
            return
        self.late, self._row = self.late + 1, self._row + 1
        if self._row >= self.options.late:
            raise StoppedError(f"{self._row} tables in a row came too late")

    def _file(self, table: PoseTable, cycles: int) -> TableFile:
        """A table for the controller within the servos' limits, and within the first one's bounds, as its program requires."""
        model = self.family.machine.model
        refuse_broken_limits(table, model, False)
        file = table_file(table, model, cycles, True)
        return replace(file, joints=self._bounds) if self._bounds else file
