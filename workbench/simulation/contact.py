"""Ground and feet: which shapes touch, and with which material.

Drake combines the materials of a pair: friction 2ab/(a+b), stiffness in series, dissipation weighted by the other's stiffness;
discrete plants use the dynamic coefficient alone (facts measured on Drake 1.51).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    GeometryId,
    ProximityProperties,
    Role,
    RoleAssign,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from workbench.robot import Ground
from workbench.robot.model_source import check_own_friction, own_friction

POINT_FOOT, HYDRO_FOOT = "foot_sphere", "foot_hydro"
"""Names by which a model's feet offer a shape for each contact model; a model with one shape only uses it for both."""
GROUND_SIZE = (40.0, 40.0, 1.0)
RIGID_STIFFNESS = 1e12
"""Stiffness [N/m] that represents a rigid ground for feet of 1e4 to 1e6."""


def model_geometries(plant: MultibodyPlant, instance: ModelInstanceIndex) -> dict[GeometryId, str]:
    """Collision shapes of a model and the link each belongs to."""
    return {g: plant.get_body(b).name() for b in plant.GetBodyIndices(instance)
            for g in plant.GetCollisionGeometriesForBody(plant.get_body(b))}


def SelectFeet(plant: MultibodyPlant, scene_graph: SceneGraph, instance: ModelInstanceIndex, contact: str,
               hydroelastic_modulus: float) -> None:
    """Leaves each foot with one set of shapes: the spheres ("point") or the compliant pad ("hydroelastic").

    A model without pads gets its own shapes made compliant, with `hydroelastic_modulus` [Pa]. Call before Finalize.
    """
    inspector = scene_graph.model_inspector()
    shapes = model_geometries(plant, instance)
    named = {g: inspector.GetName(g) for g in shapes}
    with_pads = {link for g, link in shapes.items() if HYDRO_FOOT in named[g]}
    unwanted = HYDRO_FOOT if contact == "point" else POINT_FOOT
    for g, link in shapes.items():
        if link in with_pads and unwanted in named[g]:
            scene_graph.RemoveRole(plant.get_source_id(), g, Role.kProximity)
        elif contact == "hydroelastic" and link not in with_pads:
            properties = inspector.GetProximityProperties(g)
            if not properties.HasProperty("hydroelastic", "compliance_type"):
                changed = ProximityProperties(properties)
                AddCompliantHydroelasticProperties(0.005, hydroelastic_modulus, changed)
                scene_graph.AssignRole(plant.get_source_id(), g, changed, RoleAssign.kReplace)


def AddGround(plant: MultibodyPlant, scene_graph: SceneGraph, instance: ModelInstanceIndex, ground: Ground) -> None:
    """A level floor at z = 0, and the pair friction of feet on it. Call before Finalize.

    Where `ground.friction` is None the SDF's own coefficients act: the ground takes the feet's mean, as the pair's
    friction is the harmonic mean of both; InputError where one is impossible.
    """
    inspector = scene_graph.model_inspector()
    live = {g: link for g, link in model_geometries(plant, instance).items() if inspector.GetProximityProperties(g) is not None}
    friction = ground.friction
    if friction is None:
        given = [own_friction(inspector.GetProximityProperties(g)) for g in live]
        for link, value in zip(live.values(), given):
            check_own_friction(link, value)
        friction = float(np.mean([f for f in given if f is not None])) if any(f is not None for f in given) else 1.0
    else:
        for g in live:
            properties = ProximityProperties(inspector.GetProximityProperties(g))
            properties.UpdateProperty("material", "coulomb_friction", CoulombFriction(friction, friction))
            scene_graph.AssignRole(plant.get_source_id(), g, properties, RoleAssign.kReplace)
    properties = ProximityProperties()
    stiffness = ground.stiffness if ground.stiffness is not None and math.isfinite(ground.stiffness) else RIGID_STIFFNESS
    AddContactMaterial(dissipation=ground.dissipation or 0.0, point_stiffness=stiffness,
                       friction=CoulombFriction(friction, friction), properties=properties)
    AddRigidHydroelasticProperties(properties)
    slab = RigidTransform([0, 0, -GROUND_SIZE[2] / 2])  # Drake logs a warning for every half space
    plant.RegisterCollisionGeometry(plant.world_body(), slab, Box(*GROUND_SIZE), "ground", properties)


def SetFootContact(plant: MultibodyPlant, scene_graph: SceneGraph, instance: ModelInstanceIndex, friction: Mapping[str, float],
                   stiffness: float | None) -> None:
    """Gives feet, by link, a friction of their own with the ground (the pair's), and all contact points a stiffness [N/m] (their
    own, in series with the ground's). Call after AddGround, before Finalize."""
    inspector = scene_graph.model_inspector()
    ground = plant.GetCollisionGeometriesForBody(plant.world_body())[-1]
    mu_ground = own_friction(inspector.GetProximityProperties(ground)) or 0.0
    for g, link in model_geometries(plant, instance).items():
        properties = inspector.GetProximityProperties(g)
        if properties is None or (link not in friction and stiffness is None):
            continue
        changed = ProximityProperties(properties)
        if link in friction:
            mu = partner_friction(friction[link], mu_ground)
            changed.UpdateProperty("material", "coulomb_friction", CoulombFriction(mu, mu))
        if stiffness is not None:
            changed.UpdateProperty("material", "point_contact_stiffness", stiffness)
        scene_graph.AssignRole(plant.get_source_id(), g, changed, RoleAssign.kReplace)


def partner_friction(pair: float, ground: float) -> float:
    """What gives the pair, 2ab/(a+b), with the ground's; at most 1e3, where the pair should exceed twice the ground's."""
    return min(pair * ground / (2 * ground - pair), 1e3) if pair < 2 * ground else 1e3


def lowest_point(
    plant: MultibodyPlant, scene_graph: SceneGraph, instance: ModelInstanceIndex, poses: dict[str, RigidTransform]
) -> float:
    """Lowest z [m] of the model's collision shapes, its links at `poses` (X_WL by link); 0 without shapes."""
    inspector = scene_graph.model_inspector()
    lowest = math.inf
    for g, link in model_geometries(plant, instance).items():
        if inspector.GetProximityProperties(g) is None:
            continue
        box = inspector.GetObbInGeometryFrame(g)
        X_LG = inspector.GetPoseInFrame(g)
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]).T * box.half_width()[:, None]
        p_W = poses[link] @ X_LG @ box.pose() @ corners
        lowest = min(lowest, float(p_W[2].min()))
    return lowest if math.isfinite(lowest) else 0.0
