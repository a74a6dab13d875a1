"""Appearance of a robot: the visual shapes of its links, and the contact points of its feet."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Convex, HalfSpace, Mesh, Rgba, Role, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from workbench.files.resources import ConfigureParser
from workbench.robot.feet import foot_points
from workbench.robot.model import RobotModel
from workbench.robot.model_source.checks import quiet_drake
from workbench.types import Array

GREY = Rgba(0.8, 0.8, 0.8, 1.0)


@dataclass(frozen=True)
class MeshPart:
    """Triangles of one colour: vertices (V, 3) [m], faces (F, 3)."""

    vertices: Array
    faces: NDArray[np.int32]
    rgba: Rgba


@dataclass(frozen=True)
class VisualShape:
    """A shape on a link: its pose in the link's frame and its colour. `mesh`: name of its mesh in `RobotShapes.meshes`, or
    None for a shape that meshcat draws without a mesh."""

    shape: Any
    X_LG: RigidTransform
    rgba: Rgba
    mesh: str | None = None


@dataclass(frozen=True)
class RobotShapes:
    """visuals: link -> shapes. meshes: name -> parts, each file once, however often the robot has it. feet: knee's joint ->
    (link, middle of its contact points in the link's frame (3,) [m]). mass [kg]; height at the zero pose [m]."""

    visuals: dict[str, list[VisualShape]]
    meshes: dict[str, list[MeshPart]]
    feet: dict[str, tuple[str, Array]]
    mass: float
    height: float


def robot_shapes(model: RobotModel) -> RobotShapes:
    """Reads them from the model's SDF; links without visuals show their collision shapes."""
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    parser = Parser(plant)
    ConfigureParser(parser)
    with quiet_drake():
        parser.AddModels(str(model.path))
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    kinematics = model.kinematics
    feet = {foot: (model.foot_links[foot], points.mean(axis=0)) for foot, (points, _) in foot_points(model).items()}
    visuals: dict[str, list[VisualShape]] = {}
    meshes: dict[str, list[MeshPart]] = {}
    for link in kinematics.links:
        frame = plant.GetBodyFrameIdOrThrow(plant.GetBodyByName(link).index())
        seen = inspector.GetGeometries(frame, Role.kIllustration) or inspector.GetGeometries(frame, Role.kProximity)
        visuals[link] = [_visual(inspector, g, meshes) for g in seen if not isinstance(inspector.GetShape(g), HalfSpace)]
    return RobotShapes(visuals, meshes, feet, kinematics.mass, _height(model, visuals, feet))


def _visual(inspector: Any, geometry: Any, meshes: dict[str, list[MeshPart]]) -> VisualShape:
    properties = inspector.GetIllustrationProperties(geometry)
    rgba = GREY
    if properties is not None and properties.HasProperty("phong", "diffuse"):
        rgba = properties.GetProperty("phong", "diffuse")
    shape, X_LG = inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry)
    if not isinstance(shape, (Mesh, Convex)):
        return VisualShape(shape, X_LG, rgba)
    path, scale = Path(shape.source().path()), np.asarray(shape.scale3(), dtype=float)
    name = f"{path.stem}_{'x'.join(f'{s:g}' for s in scale)}".replace(".", "p")
    if name not in meshes:
        meshes[name] = _mesh_parts(path, scale, rgba)
    return VisualShape(shape, X_LG, rgba, name)


def _mesh_parts(path: Path, scale: Array, rgba: Rgba) -> list[MeshPart]:
    """The file's triangles, a part for each material; `rgba` where it has none. glTF's y axis becomes z, as in Drake. We draw the
    triangles ourselves, because meshcat cannot show .glb, loads other files late, and stores a copy for each servo.
    """
    import trimesh  # not all robots have meshes

    loaded = trimesh.load_scene(path)
    turn = np.eye(4)
    if path.suffix.lower() in (".glb", ".gltf"):
        turn[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    parts = []
    for node in loaded.graph.nodes_geometry:
        X, name = loaded.graph[node]
        geometry = loaded.geometry[name].copy()
        geometry.apply_transform(turn @ X)
        colour = _material_colour(geometry)
        geometry.merge_vertices(merge_tex=True, merge_norm=True)
        vertices, faces = np.asarray(geometry.vertices * scale, dtype=float), np.asarray(geometry.faces, dtype=np.int32)
        parts.append(MeshPart(vertices, faces, colour or rgba))
    return parts


def _material_colour(geometry: Any) -> Rgba | None:
    material = getattr(geometry.visual, "material", None)
    colour = getattr(material, "main_color", None)
    return None if colour is None else Rgba(*(float(c) / 255 for c in colour))


def _height(model: RobotModel, visuals: dict[str, list[VisualShape]], feet: dict[str, tuple[str, Array]]) -> float:
    at_zero = model.kinematics.forward(np.zeros((1, len(model.joints))))
    heights = [0.0]
    for link, (p, R) in at_zero.items():
        heights += [float(p[0, 2] + R[0, 2] @ shape.X_LG.translation()) for shape in visuals[link]]
        heights += [float(p[0, 2] + R[0, 2] @ place) for foot, place in feet.values() if foot == link]
    return max(0.02, max(heights) - min(heights))
