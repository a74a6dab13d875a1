"""A servo misses poses at random."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from workbench.effects.base import Effect, Parameter, scalar
from workbench.effects.schedules import without_poses
from workbench.motion.commands import Commands
from workbench.robot import EffectSpec, RobotModel

SEED = 0
"""The missed poses differ from take to take; a simulation always uses the same random draw."""


class DroppedCommand(Effect):
    """A servo misses poses at random."""

    name = "dropped_command"
    layer = "timing"
    places = ("joint",)
    estimator = "missed poses"
    from_neutral = False
    parameters = (Parameter("probability", "1", 0.0, 1.0, 0.1),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} misses {100 * scalar(spec, 'probability'):.0f} % of its poses."

    def commands(self, commands: Commands, where: tuple[str, ...], values: Mapping[str, float], model: RobotModel) -> Commands:
        chance = np.random.default_rng(SEED)
        for joint in where:
            missed = chance.random(len(commands.times)) < values["probability"]
            commands = without_poses(commands, commands.column(joint), np.flatnonzero(missed).tolist())
        return commands


EFFECT = DroppedCommand()
