"""The k-th bus ID gets the speed of the k-th joint by name: figure 3.4 of the thesis lists goals by ID and speeds by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from workbench.effects.base import Effect
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.robot import EffectSpec, RobotModel


class SpeedOrder(Effect):
    """The k-th bus ID gets the speed of the k-th joint by name: figure 3.4 of the thesis lists goals by ID and speeds by name."""

    name = "speed_order"
    layer = "timing"
    places = ("robot",)

    def sentence(self, spec: EffectSpec) -> str:
        return ("Every servo runs at another servo's speed: goals were sent in the order of bus IDs, but speeds in the order of "
                "names.")

    def could_act(self, model: RobotModel, sent: Sequence[Commands]) -> bool:
        """Only if there are several servos, all of them have bus IDs, and moving speeds were sent."""
        known = not set(model.bus_ids) < set(model.joints) and len(model.joints) > 1
        return known and any(bool(np.any(c.speeds > 0)) for c in sent)

    def commands(self, commands: Commands, where: tuple[str, ...], values: Mapping[str, float], model: RobotModel) -> Commands:
        missing = [j for j in commands.joints if j not in model.bus_ids]
        if missing:
            raise InputError(None, f"effect 'speed_order': joint '{missing[0]}' has no bus ID")
        by_id = sorted(commands.joints, key=lambda j: model.bus_ids[j])
        speeds = commands.speeds.copy()
        for k, joint in enumerate(by_id):
            speeds[:, commands.joints.index(joint)] = commands.speeds[:, commands.joints.index(sorted(commands.joints)[k])]
        return replace(commands, speeds=speeds)


EFFECT = SpeedOrder()
