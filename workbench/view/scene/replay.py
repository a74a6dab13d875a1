"""3D replay of one take, or of a recorded one as a ghost over a simulated one, as one HTML file that opens from disk."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Cylinder, Meshcat, MeshcatAnimation, MeshcatCone, MeshcatParams, Rgba
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from workbench.files.reading import write_whole
from workbench.recording.take import Take
from workbench.robot.model import GRAVITY, RobotModel
from workbench.types import Array
from workbench.view.figures.style import ACCENT, RECORDED, SIMULATED, rgb
from workbench.view.playback import Playback, common_span, names_of, play, since_start
from workbench.view.scene.floor import GRID, add_grid, ribbon
from workbench.view.scene.keyframes import kept_keys
from workbench.view.scene.marks import Errors, Marker
from workbench.view.scene.overlay import LIBRARY, Copy, Legend, with_overlay
from workbench.view.shapes import RobotShapes, VisualShape, robot_shapes

FRAME_RATE = 30.0
MAX_FRAMES = 900
"""Longer takes get fewer frames a second, so that the file stays small."""

GHOST_ALPHA = 0.45
POSITION_TOLERANCE = 5e-4
ANGLE_TOLERANCE = 6e-3
"""Tolerance of the animation between its key frames [m, rad]; invisible, and it halves the file."""


@dataclass(frozen=True)
class ReplayFile:
    """The file: path, size [bytes], frames and their rate [1/s]."""

    path: Path
    size: int
    frames: int
    rate: float


def write_replay(
    path: str | PathLike[str], model: RobotModel, simulated: Take, recorded: Take | None = None, title: str = "",
    errors: Sequence[Errors] = (),
) -> ReplayFile:
    """Writes the replay; the same takes give the same bytes.

    simulated: solid, with its contact forces as arrows. recorded: translucent, laid over it where both stood before the first
    command. In gaps it holds the last pose seen; joints that were not measured follow the simulation. The forces are averaged
    over a frame. errors: how far the recording deviates from one model or several, shown at the recorded robot's joints and body.
    InputError if `path` cannot be written.
    """
    takes = [simulated] if recorded is None else [simulated, recorded]
    first, last = common_span(takes)
    rate = min(FRAME_RATE, MAX_FRAMES / (last - first))
    time = first + np.arange(int((last - first) * rate) + 1) / rate
    played = play(simulated, model, time)
    ghost = None if recorded is None else play(recorded, model, time, like=(simulated, played))
    scene = Scene(model, robot_shapes(model), [played] if ghost is None else [played, ghost], rate)
    prefix, seen, at = "simulated", played, scene.add_robot("simulated", played, SIMULATED, 1.0, own_colours=ghost is None)
    newtons_per_metre = scene.add_forces("forces", simulated, played)
    if ghost is not None:
        prefix, seen, at = "recorded", ghost, scene.add_robot("recorded", ghost, RECORDED, GHOST_ALPHA, own_colours=False)
    marker = Marker(scene.meshcat, scene.animation, model, seen, prefix, at, scene.shapes.height)
    marks = [marker.add(f"error{i}", e) for i, e in enumerate(errors)]
    names = names_of(simulated, recorded)
    legend = Legend(
        title or simulated.name, simulated=names[0], recorded=None if recorded is None else names[1],
        newtons_per_metre=newtons_per_metre, grid=GRID, start=float(time[0]), poses=_poses(simulated),
        middle=scene.middle, reach=scene.reach, aside=1.6 * scene.shapes.height, copies=scene.copies,
        marks=marks)
    written = write_whole(Path(path), with_overlay(scene.html(), legend))
    return ReplayFile(written, written.stat().st_size, len(time), rate)


class Scene:
    """What stands and moves in one replay."""

    def __init__(self, model: RobotModel, shapes: RobotShapes, played: list[Playback], rate: float) -> None:
        self.model, self.shapes = model, shapes
        where = np.concatenate([p.base_p[:, :2] for p in played])
        self.low, self.high = where.min(axis=0), where.max(axis=0)
        self.middle = (float((self.low + self.high)[0] / 2), float((self.low + self.high)[1] / 2))
        links = [p.in_world(link)[0] for p in played for link in p.links]
        # a stretched arm may reach far beyond its height, and be mounted high above the floor
        self.tall = max(shapes.height, max(float(p[:, 2].max()) for p in links))
        wide = max(float(np.linalg.norm(p[:, :2] - self.middle, axis=1).max()) for p in links)
        self.reach = max(1.15 * self.tall + 0.5 * float(np.linalg.norm(self.high - self.low)), wide)
        self.meshcat = _quiet_meshcat()
        self.animation = MeshcatAnimation(rate)
        self.copies: list[Copy] = []
        for name, parts in shapes.meshes.items():
            for k, part in enumerate(parts):
                vertices, faces = np.asfortranarray(part.vertices.T), np.asfortranarray(part.faces.T)
                self.meshcat.SetTriangleMesh(f"/{LIBRARY}/{name}/{k}", vertices, faces, part.rgba)
        self.meshcat.SetProperty(f"/{LIBRARY}", "visible", False)
        self._add_world()

    def add_robot(self, prefix: str, played: Playback, colour: str, alpha: float, own_colours: bool) -> dict[str, str]:
        """The links as a tree under `prefix`, each moved by its joint alone, and the base's path under `traces/prefix`; returns
        each link's path."""
        kinematics = self.model.kinematics
        at = {kinematics.root: f"/{prefix}/{kinematics.root}"}
        for link in kinematics.links:
            p, R = played.in_world(link)
            joint = kinematics.joint_of(link)
            if joint is not None:
                parent = kinematics.frames[joint].parent
                at[link] = f"{at[parent]}/{link}"
                p_WP, R_WP = played.in_world(parent)
                R_PW = np.swapaxes(R_WP, 1, 2)
                p, R = np.einsum("fij,fj->fi", R_PW, p - p_WP), R_PW @ R
            self._animate(at[link], p, R)
            for i, shape in enumerate(self.shapes.visuals[link]):
                self._add_shape(f"{at[link]}/shape{i}", shape, None if own_colours else (colour, alpha))
        path = ribbon(played.base_p[:, :2], width=0.004)
        if path is not None:
            self.meshcat.SetTriangleMesh(f"/traces/{prefix}", *path, Rgba(*rgb(colour), 0.9))
        return at

    def _add_shape(self, path: str, shape: VisualShape, house: tuple[str, float] | None) -> None:
        """In its own colours, or in a house colour and alpha. A mesh is copied by the page, which has each file once."""

        def tint(rgba: Rgba) -> Rgba:
            return rgba if house is None else _tint(rgba, *house)

        if shape.mesh is None:
            self.meshcat.SetObject(path, shape.shape, tint(shape.rgba))
        else:
            colours = [tint(part.rgba) for part in self.shapes.meshes[shape.mesh]]
            self.copies.append(Copy(path, shape.mesh, [[c.r(), c.g(), c.b(), c.a()] for c in colours]))
        self.meshcat.SetTransform(path, shape.X_LG)

    def add_forces(self, prefix: str, take: Take, played: Playback) -> float | None:
        """An arrow at each foot, as long as its force; newtons per metre of arrow, None where the take has no forces."""
        forces = {foot: f for foot, f in take.contact.items() if foot in self.shapes.feet}
        if not forces:
            return None
        per_metre = GRAVITY * self.shapes.mass / self.shapes.height
        for foot, force in forces.items():
            link, p_LF = self.shapes.feet[foot]
            p, R = played.in_world(link)
            f = _average(since_start(take), np.nan_to_num(force), played.time)
            length = np.linalg.norm(f, axis=1) / per_metre
            at, radius = f"/{prefix}/{foot}", 0.04 * self.shapes.height
            self._add_arrow(at, radius)
            p_WF = _held_while(length > radius, p + np.einsum("fij,j->fi", R, p_LF))
            self._animate(at, p_WF, _pointing(_held_while(length > radius, f)))
            thickness = np.clip(length / (4 * radius), 1e-4, 1)
            scale = np.column_stack([thickness, thickness, np.maximum(length, 1e-4)])
            for k in kept_keys(scale[:, 1:] / [0.05, 4 * POSITION_TOLERANCE]):
                self.animation.SetProperty(int(k), at, "scale", scale[k].tolist())
        return per_metre

    def html(self) -> str:
        """The page, playing in a loop."""
        self.animation.set_autoplay(True)
        self.animation.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
        self.animation.set_repetitions(1_000_000)
        self.meshcat.SetAnimation(self.animation)
        return str(self.meshcat.StaticHtml())

    def _animate(self, path: str, p: Array, R: Array) -> None:
        quat = Rotation.from_matrix(R).as_quat()
        quat *= np.cumprod(np.where(np.einsum("fi,fi->f", quat, np.roll(quat, 1, axis=0)) < 0, -1, 1))[:, None]
        keys = kept_keys(np.hstack([p / POSITION_TOLERANCE, 2 * quat / ANGLE_TOLERANCE]))
        self.meshcat.SetTransform(path, RigidTransform(RotationMatrix(R[0]), p[0]))
        if len(keys) == 2 and np.allclose(R[0], R[-1], atol=1e-9) and np.allclose(p[0], p[-1], atol=1e-9):
            return  # it does not move
        for k in keys:
            self.animation.SetTransform(int(k), path, RigidTransform(RotationMatrix(R[k]), p[k]))

    def _add_arrow(self, path: str, radius: float) -> None:
        """Of length one along z; the head takes a quarter of it."""
        colour = Rgba(*rgb(ACCENT), 1.0)
        self.meshcat.SetObject(f"{path}/shaft", Cylinder(0.4 * radius, 0.75), colour)
        self.meshcat.SetTransform(f"{path}/shaft", RigidTransform([0, 0, 0.375]))
        self.meshcat.SetObject(f"{path}/head", MeshcatCone(0.25, radius, radius), colour)
        self.meshcat.SetTransform(f"{path}/head", RigidTransform(RotationMatrix.MakeXRotation(np.pi), [0, 0, 1.0]))

    def _add_world(self) -> None:
        """Floor grid, background, light, and a camera that sees the whole path."""
        for name in ("/Grid", "/Axes"):
            self.meshcat.SetProperty(name, "visible", False)
        for name in ("top_color", "bottom_color"):
            self.meshcat.SetProperty("/Background", name, [1.0, 1.0, 1.0])
        lights = {"PointLightNegativeX": 4.0, "PointLightPositiveX": 4.0, "AmbientLight": 0.9, "FillLight": 0.5}
        for name, intensity in lights.items():
            self.meshcat.SetProperty(f"/Lights/{name}/<object>", "intensity", intensity)
        add_grid(self.meshcat, self.low - 2.5 * self.shapes.height, self.high + 2.5 * self.shapes.height)
        target = np.array([*self.middle, 0.5 * self.tall])
        self.meshcat.SetCamera(Meshcat.PerspectiveCamera(fov=35.0, aspect=1.6, near=0.02, far=50.0))
        self.meshcat.SetCameraPose(target + 2.3 * self.reach * np.array([0.5, -1.0, 0.5]), target)


def _held_while(known: NDArray[np.bool_], values: Array) -> Array:
    """Rows of `values` (F, k) where `known`; elsewhere the last known one, the first known one at the start."""
    if not known.any():
        return values
    last = np.maximum.accumulate(np.where(known, np.arange(len(known)), int(known.argmax())))
    return values[last]


def _pointing(force: Array) -> Array:
    """Rotations (F, 3, 3) that turn z along the force (F, 3)."""
    size = np.linalg.norm(force, axis=1, keepdims=True)
    z = np.where(size > 1e-9, force / np.maximum(size, 1e-9), [0, 0, 1.0])
    x = np.cross([0, 1.0, 0], z)
    x = np.where(np.linalg.norm(x, axis=1, keepdims=True) > 1e-6, x, [1.0, 0, 0])
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _average(clock: Array, values: Array, time: Array) -> Array:
    """Mean of `values` (N, k) around each frame, as contact forces chatter faster than a film can show."""
    half = 0.5 * (time[1] - time[0]) if len(time) > 1 else 0.0
    total = np.vstack([np.zeros(values.shape[1]), np.cumsum(values, axis=0)])
    first = np.searchsorted(clock, time - half).clip(0, len(clock) - 1)
    last = np.maximum(np.searchsorted(clock, time + half), first + 1).clip(1, len(clock))
    return np.asarray((total[last] - total[first]) / (last - first)[:, None], dtype=float)


def _tint(rgba: Rgba, colour: str, alpha: float) -> Rgba:
    """The house colour, lighter or darker as the part is."""
    shade = 0.6 + 0.5 * (0.299 * rgba.r() + 0.587 * rgba.g() + 0.114 * rgba.b())
    r, g, b = (min(1.0, shade * c) for c in rgb(colour))
    return Rgba(r, g, b, alpha * rgba.a())


def _poses(take: Take) -> list[float]:
    return [] if take.commands is None else [float(t) for t in take.commands.times]


def _quiet_meshcat() -> Meshcat:
    """A Meshcat of our own, on a free port of this machine alone, that does not announce itself. It closes with its last
    reference."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(logging.WARNING)
    try:
        params = MeshcatParams()
        params.host, params.port = "127.0.0.1", 0
        return Meshcat(params)
    finally:
        log.setLevel(level)
