"""Ground reaction on each foot, from the plant's contact results."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from workbench.robot import RobotModel
from workbench.simulation.contact import model_geometries


class FootForces:
    """Sums the ground's forces on each link that can touch, by the name of the foot (`RobotModel.foot_links`), of any other link
    by the joint that carries it, of the root by its link. Links of one name (shank and foot of one knee) are summed."""

    def __init__(self, plant: MultibodyPlant, scene_graph: SceneGraph, model: RobotModel) -> None:
        self._plant = plant
        instance = plant.GetBodyByName(model.base).model_instance()
        inspector = scene_graph.model_inspector()
        links = dict.fromkeys(link for g, link in model_geometries(plant, instance).items()
                              if inspector.GetProximityProperties(g) is not None)
        foot = {link: name for name, link in model.foot_links.items()}
        named = {link: foot.get(link) or model.kinematics.parent_joint[link] or link for link in links}
        self.feet = tuple(dict.fromkeys(named.values()))
        row = {link: self.feet.index(name) for link, name in named.items()}
        self._row_of_body = {int(plant.GetBodyByName(link, instance).index()): i for link, i in row.items()}
        self._row_of_geometry = {g: row[link] for g, link in model_geometries(plant, instance).items() if link in row}
        self._world = int(plant.world_body().index())

    def __call__(self, plant_context: Context) -> NDArray[np.float64]:
        """Forces (feet, 3) [N] of the ground on the feet, in W."""
        out = np.zeros((len(self.feet), 3))
        results = self._plant.get_contact_results_output_port().Eval(plant_context)
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            a, b = int(info.bodyA_index()), int(info.bodyB_index())
            if a == self._world and b in self._row_of_body:
                out[self._row_of_body[b]] += info.contact_force()  # on B
            elif b == self._world and a in self._row_of_body:
                out[self._row_of_body[a]] -= info.contact_force()
        for i in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(i)
            m, n = info.contact_surface().id_M(), info.contact_surface().id_N()
            force = info.F_Ac_W().translational()  # on the body of M
            if m in self._row_of_geometry and n not in self._row_of_geometry:
                out[self._row_of_geometry[m]] += force
            elif n in self._row_of_geometry and m not in self._row_of_geometry:
                out[self._row_of_geometry[n]] -= force
        return out
