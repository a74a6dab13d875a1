"""Where and when a recording deviates from a model, on the robot of a 3D replay: marks at joints and body in the map's
colours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, MeshcatAnimation, Rgba, Sphere
from pydrake.math import RigidTransform

from workbench.compare.channels import BODY, joint_of
from workbench.robot.model import RobotModel
from workbench.types import Array
from workbench.view.figures.heat import BIN, cells, colours, shares
from workbench.view.playback import Playback
from workbench.view.scene.keyframes import kept_keys

PATH, TILT = "path", "tilt"
"""Of the body: where it goes and turns to, shown on the floor under it; how it leans and sinks, shown at the base."""
LARGEST, SMALLEST = 0.085, 0.3
"""Radius of the darkest mark in heights of the robot, and of the palest in radii of the darkest."""
COLOUR_TOLERANCE = 0.06
"""Tolerance of a mark's colour between its key frames; invisible."""


@dataclass(frozen=True)
class Errors:
    """How far a recording deviates from one model. label: for the legend; time (N,) [s] since the first command; residual (N, c)
    over noise, numerics and contact models, NaN where unseen; channels: (c) joints, joints across an axis, the body's. shown:
    from the start, or on demand."""

    label: str
    time: Array
    channels: tuple[str, ...]
    residual: Array
    shown: bool = True

    def by_place(self, joints: tuple[str, ...]) -> dict[str, Array]:
        """RMS in cells of BIN from the first command on: {joint, PATH or TILT: (bins,)}, the worst channel there; NaN where
        nothing was seen."""
        edges = np.arange(0.0, max(float(self.time[-1]), BIN) + BIN, BIN)
        found: dict[str, Array] = {}
        for channel, row in zip(self.channels, np.ma.filled(cells(self.time, self.residual, edges), np.nan)):
            place = (PATH if channel in BODY[:3] else TILT) if channel in BODY else joint_of(channel)
            if channel in BODY or place in joints:
                found[place] = np.fmax(found[place], row) if place in found else row
        return found


@dataclass(frozen=True)
class Marks:
    """The added marks: the legend's text, whether they are visible at the start, and their paths."""

    label: str
    shown: bool
    paths: tuple[str, ...]


class Marker:
    """Puts marks on one robot of a replay. at: path of each link in the scene; prefix: the robot's."""

    def __init__(self, meshcat: Meshcat, animation: MeshcatAnimation, model: RobotModel, played: Playback, prefix: str,
                 at: Mapping[str, str], height: float) -> None:
        self.meshcat, self.animation, self.model, self.played = meshcat, animation, model, played
        self.prefix, self.at, self.height = prefix, at, height

    def add(self, name: str, errors: Errors) -> Marks:
        """A sphere at each joint and at the base, a disc under it, called `name`, coloured and sized over time."""
        paths = []
        for place, ratio in errors.by_place(self.model.joints).items():
            paths.append(self._place(name, place))
            self._animate(paths[-1], ratio, sized=place != PATH)
        return Marks(errors.label, errors.shown, tuple(paths))

    def _place(self, name: str, place: str) -> str:
        """Adds the mark as a child of the object it moves with; returns its path."""
        sphere = Sphere(LARGEST * self.height)
        if place == PATH:
            path = f"/{self.prefix}/{place}/{name}"
            self.meshcat.SetObject(path, Cylinder(0.4 * self.height, 0.001), Rgba(0, 0, 0, 0.7))
            ground = self.played.base_p * [1.0, 1.0, 0.0] + [0, 0, 1e-3]
            for k in kept_keys(ground / 0.002):
                self.animation.SetTransform(int(k), f"/{self.prefix}/{place}", RigidTransform(ground[k]))
            return path
        if place == TILT:
            path = f"{self.at[self.model.base]}/{name}"
            self.meshcat.SetObject(path, sphere, Rgba(0, 0, 0, 0.92))
            return path
        joint = self.model.kinematics.frames[place]
        path = f"{self.at[joint.child]}/{name}"
        self.meshcat.SetObject(path, sphere, Rgba(0, 0, 0, 0.92))
        self.meshcat.SetTransform(path, RigidTransform(joint.p_BM))
        return path

    def _animate(self, path: str, ratio: Array, sized: bool) -> None:
        """Colour and size; grey where it was not seen, which includes the time before the first command. The colour is emissive:
        light and shadow do not change it."""
        time = self.played.time
        middles = np.concatenate([[-1e-6], BIN * (np.arange(len(ratio)) + 0.5)])
        ratio = np.concatenate([[np.nan], ratio])
        rgb = np.column_stack([np.interp(time, middles, c) for c in colours(ratio).T])
        size = SMALLEST + (1 - SMALLEST) * np.interp(time, middles, shares(ratio))
        for k in kept_keys(np.column_stack([rgb, size]) / COLOUR_TOLERANCE):
            self.animation.SetProperty(int(k), f"{path}/<object>", "material.emissive", _linear(rgb[k]).tolist())
            if sized:
                self.animation.SetProperty(int(k), f"{path}/<object>", "scale", [float(size[k])] * 3)


def _linear(srgb: Array) -> Array:
    """sRGB in the linear light that three.js keeps its colours in (IEC 61966-2-1)."""
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return np.asarray(np.round(linear, 3), dtype=float)
