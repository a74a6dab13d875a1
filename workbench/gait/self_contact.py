"""How near the robot's links come to each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Role, SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from workbench.robot import ConfigureParser, RobotModel
from workbench.types import Array

FAR = 0.02
"""Distance [m] from which it is not looked closer."""


@dataclass(frozen=True)
class Nearness:
    """distance [m], negative where they overlap; the two links; pose: at which row."""

    distance: float
    links: tuple[str, str]
    pose: int


class SelfContact:
    """Shapes that can touch in the model's file, of links that are not neighbours on one joint. Not for several threads."""

    def __init__(self, model: RobotModel) -> None:
        builder = DiagramBuilder()
        self._plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        assert isinstance(scene_graph, SceneGraph)
        parser = Parser(self._plant)
        ConfigureParser(parser)
        (instance,) = parser.AddModels(str(model.path))
        inspector = scene_graph.model_inspector()
        for body in self._plant.GetBodyIndices(instance):
            for g in self._plant.GetCollisionGeometriesForBody(self._plant.get_body(body)):
                properties = inspector.GetProximityProperties(g)
                if properties.HasProperty("hydroelastic", "compliance_type"):  # the same foot a second time
                    scene_graph.RemoveRole(self._plant.get_source_id(), g, Role.kProximity)
        self._plant.Finalize()
        self._diagram = builder.Build()
        self._root = self._diagram.CreateDefaultContext()
        self._context = self._plant.GetMyContextFromRoot(self._root)
        self._columns = np.array([self._plant.GetJointByName(j).position_start() for j in model.joints], dtype=int)
        self._model = model
        self._links = {g: self._plant.GetBodyFromFrameId(inspector.GetFrameId(g)).name()
                       for g in inspector.GetAllGeometryIds(Role.kProximity)}

    def nearest(self, q: Array) -> Nearness:
        """Over poses q (N, n) [rad] in the model's order of joints; FAR with no links where nothing comes nearer."""
        best = Nearness(FAR, ("", ""), 0)
        values = self._plant.GetPositions(self._context).copy()
        for k, row in enumerate(np.atleast_2d(q)):
            values[self._columns] = row
            self._plant.SetPositions(self._context, values)
            query = self._plant.get_geometry_query_input_port().Eval(self._context)
            for pair in query.ComputeSignedDistancePairwiseClosestPoints(FAR):
                if pair.distance < best.distance:
                    links = (self._links[pair.id_A], self._links[pair.id_B])
                    best = Nearness(float(pair.distance), (min(links), max(links)), k)
        return best
