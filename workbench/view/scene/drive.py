"""A drive live in Meshcat: the path, the discs, the robot where it was last seen, and the plan."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.geometry import Cylinder, Rgba
from pydrake.math import RigidTransform, RollPitchYaw

from workbench.gait.drive.path import WayPath
from workbench.gait.drive.plan import Disc
from workbench.gait.drive.walk import Seen
from workbench.robot import RobotModel
from workbench.types import Array
from workbench.view.scene.live import open_meshcat
from workbench.view.scene.live import show as show_model

PATH, PLAN, SEEN, DISC = Rgba(0.3, 0.3, 0.3), Rgba(0.85, 0.37, 0.0), Rgba(0.0, 0.45, 0.7), Rgba(0.7, 0.1, 0.1, 0.6)
RAISED = 0.004
"""Height of lines above the floor [m], so that both are seen."""


class DriveScene:
    """On a server of its own while this object lives. place: x, y [m], heading [rad] of the robot shown."""

    def __init__(self, model: RobotModel, path: WayPath, discs: Sequence[Disc] = ()) -> None:
        self.meshcat = show_model(model, open_meshcat())
        links = model.kinematics.forward(np.zeros(len(model.joints)), model.joints)
        self._height = -min(float(p[0, 2]) for p, _ in links.values())
        self._seen: list[Array] = []
        self._line("path", path.p, PATH)
        for k, point in enumerate(path.points):
            self._cylinder(f"way-points/{k + 1}", point, 0.012, PATH)
        for k, disc in enumerate(discs):
            self._cylinder(f"discs/{k + 1}", np.array([disc.x, disc.y]), disc.radius, DISC)
        self.place = np.zeros(3)
        self._move(self.place)

    @property
    def url(self) -> str:
        """Where a browser sees it."""
        return str(self.meshcat.web_url())

    def show(self, seen: Seen, planned: Array) -> None:
        """The end of a cycle: the robot as the cameras see it, its way so far, and the planned positions (N, 2) [m]."""
        if np.isfinite(seen.captured).all():
            self._seen.append(seen.captured)
            self._move(seen.captured)
        if len(self._seen) > 1:
            self._line("way", np.array(self._seen)[:, :2], SEEN)
        if len(planned) > 1:
            self._line("plan", planned, PLAN)

    def _move(self, pose: Array) -> None:
        self.place = pose
        x, y, heading = pose
        self.meshcat.SetTransform("/robot", RigidTransform(RollPitchYaw(0.0, 0.0, heading), [x, y, self._height]))

    def _line(self, name: str, points: Array, colour: Rgba) -> None:
        raised = np.vstack([points.T, np.full(len(points), RAISED)])
        self.meshcat.SetLine(f"/drive/{name}", raised, 3.0, colour)

    def _cylinder(self, name: str, centre: Array, radius: float, colour: Rgba) -> None:
        self.meshcat.SetObject(f"/drive/{name}", Cylinder(radius, 2 * RAISED), colour)
        self.meshcat.SetTransform(f"/drive/{name}", RigidTransform([*centre, RAISED]))
