"""Which links are feet, how feet are named, and where they can touch the ground: one definition for all packages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from workbench.files import InputError
from workbench.files.reading import cached_by_content
from workbench.robot.kinematics import Kinematics
from workbench.types import Array

if TYPE_CHECKING:
    from workbench.robot.model import RobotModel

Points = tuple[Array, Array]
"""Points (M, 3) [m] in a link's frame and the radius (M,) [m] of the sphere about each; 0: a corner."""


def feet_of(kinematics: Kinematics, listed: Sequence[str] | None) -> dict[str, str]:
    """Foot -> link, sorted by the foot's name.

    listed: links, as the session's `feet` names them. None: of a robot that can walk, the last link with a collision shape on
    each branch of the tree; none of a robot that the SDF mounts on the world. A foot has the name of the last joint that moves it
    (the knee's), or the link's name if two feet share that joint or nothing moves them. InputError for a link that does not
    exist.
    """
    unknown = [link for link in listed or () if link not in kinematics.links]
    if unknown:
        raise InputError(kinematics.path, f"feet: no link '{unknown[0]}'; expected some of {', '.join(kinematics.links)}")
    links = tuple(_ends(kinematics) if listed is None else listed)
    carrier = {link: next((j for j in reversed(kinematics.chain(link)) if j in kinematics.joints), link) for link in links}
    shared = [j for j in carrier.values() if list(carrier.values()).count(j) > 1]
    return dict(sorted((link if joint in shared else joint, link) for link, joint in carrier.items()))


def _ends(kinematics: Kinematics) -> list[str]:
    """Links with a shape beyond which no link has one."""
    if kinematics.fixed_to_world:
        return []
    touching = [link for link in kinematics.links if link in _shapes(kinematics.path)]
    inner = {above for link in touching for above in kinematics.ancestors(link)}
    return [link for link in touching if link not in inner]


def foot_points(model: RobotModel) -> dict[str, Points]:
    """Where each foot may touch the ground, by the foot's name, in its link's frame.

    From the link's collision shapes: a sphere is its centre with its radius, any other shape the corners of its box. Feet without
    a shape are left out.
    """
    shapes = _shapes(model.path)
    return {foot: shapes[link] for foot, link in model.foot_links.items() if link in shapes}


def tips(model: RobotModel) -> dict[str, Array]:
    """The tip (3,) [m] of each link without a child, in its frame: the mean of its collision points farthest from its origin,
    else twice its centre of mass."""
    k = model.kinematics
    shapes, carrying = _shapes(model.path), {frame.parent for frame in k.frames.values()}
    out = {}
    for link in k.links:
        if link in carrying:
            continue
        points = shapes[link][0] if link in shapes else 2 * np.atleast_2d(k.centers.get(link, np.zeros(3)))
        away = np.linalg.norm(points, axis=1)
        out[link] = points[away >= 0.9 * away.max()].mean(axis=0)
    return out


def legs(model: RobotModel) -> dict[str, tuple[str, ...]]:
    """Foot -> the joints that move this foot alone, from the trunk on."""
    k = model.kinematics
    chains = {foot: [j for j in k.chain(link) if j in model.joints] for foot, link in model.foot_links.items()}
    return {foot: tuple(j for j in chain if sum(j in other for other in chains.values()) == 1) for foot, chain in chains.items()}


@cached_by_content(maxsize=16)
def _shapes(path: Path) -> Mapping[str, Points]:
    """Points of every link that has a collision shape of finite size."""
    from pydrake.geometry import Role, SceneGraph, Sphere
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    from workbench.files.resources import ConfigureParser
    from workbench.robot.model_source.checks import quiet_drake

    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    parser = Parser(plant)
    ConfigureParser(parser)
    with quiet_drake():
        (instance,) = parser.AddModels(path)
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    shapes: dict[str, Points] = {}
    for body in map(plant.get_body, plant.GetBodyIndices(instance)):
        points, radii = [], []
        for geometry in inspector.GetGeometries(plant.GetBodyFrameIdOrThrow(body.index()), Role.kProximity):
            X_BG, shape = inspector.GetPoseInFrame(geometry), inspector.GetShape(geometry)
            if isinstance(shape, Sphere):
                points.append(X_BG.translation()[None])
                radii.append(np.array([shape.radius()]))
                continue
            box = inspector.GetObbInGeometryFrame(geometry)
            if box is None:  # a half space
                continue
            corners = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, 8) * box.half_width()[:, None]
            points.append((X_BG.multiply(box.pose()).multiply(corners)).T)
            radii.append(np.zeros(8))
        if points:
            shapes[body.name()] = np.vstack(points), np.concatenate(radii)
    return shapes
