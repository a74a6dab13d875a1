"""Which servo on the bus turns which joint."""

from __future__ import annotations

from collections.abc import Mapping

from workbench.files import InputError
from workbench.robot.model import RobotModel
from workbench.robot.names import BUS_IDS


def bus_ids(model: RobotModel) -> Mapping[str, int]:
    """IDs by joint: the model's own or, where it has none, those of the puppy's joints by name. InputError for a joint without
    one: another robot's servo must not move instead of it."""
    ids = dict(model.bus_ids or {j: i for j, i in BUS_IDS.items() if j in model.joints})
    missing = [joint for joint in model.joints if joint not in ids]
    if missing:
        raise InputError(model.description, f"joint {missing[0]} has no bus ID; give them as robot.bus_ids in a session.yaml")
    return ids
