"""What a robot looks like: the visual shapes of its links, and where its feet touch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import HalfSpace, Rgba, Role, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from workbench.robot.model import RobotModel
from workbench.robot.resources import ConfigureParser

Array = NDArray[np.float64]


@dataclass(frozen=True)
class VisualShape:
    """A shape on a link: its pose in the link's frame and its colour."""

    shape: Any
    X_LG: RigidTransform
    rgba: Rgba


@dataclass(frozen=True)
class RobotShapes:
    """visuals: link -> shapes. feet: knee's joint -> (link, middle of its contact shapes in the link's frame (3,) [m]).
    mass [kg]; height of the robot at the zero pose [m]."""

    visuals: dict[str, list[VisualShape]]
    feet: dict[str, tuple[str, Array]]
    mass: float
    height: float


def robot_shapes(model: RobotModel) -> RobotShapes:
    """Reads them from the model's SDF; links without visuals show their collision shapes."""
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    parser = Parser(plant)
    ConfigureParser(parser)
    parser.AddModels(str(model.path))
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    kinematics = model.kinematics
    visuals: dict[str, list[VisualShape]] = {}
    feet: dict[str, tuple[str, Array]] = {}
    at_zero = kinematics.forward(np.zeros((1, len(kinematics.joints))))
    heights = [0.0]
    for link in kinematics.links:
        frame = plant.GetBodyFrameIdOrThrow(plant.GetBodyByName(link).index())
        touching = inspector.GetGeometries(frame, Role.kProximity)
        seen = inspector.GetGeometries(frame, Role.kIllustration) or touching
        visuals[link] = [_visual(inspector, g) for g in seen if not isinstance(inspector.GetShape(g), HalfSpace)]
        joint = kinematics.joint_of(link)
        if touching and joint is not None:
            feet[joint] = (link, np.mean([inspector.GetPoseInFrame(g).translation() for g in touching], axis=0))
        p, R = at_zero[link]
        points = [p[0]] + [p[0] + R[0] @ s.X_LG.translation() for s in visuals[link]]
        if joint in feet:
            points.append(p[0] + R[0] @ feet[joint][1])
        heights += [float(x[2]) for x in points]
    return RobotShapes(visuals, feet, sum(kinematics.masses.values()), max(0.02, max(heights) - min(heights)))


def _visual(inspector: Any, geometry: Any) -> VisualShape:
    properties = inspector.GetIllustrationProperties(geometry)
    rgba = Rgba(0.8, 0.8, 0.8, 1.0)
    if properties is not None and properties.HasProperty("phong", "diffuse"):
        rgba = properties.GetProperty("phong", "diffuse")
    return VisualShape(inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry), rgba)
