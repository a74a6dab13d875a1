"""Each pose of the controller takes longer than commanded, and the delays add up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from workbench.effects.base import Effect, Parameter, scalar
from workbench.motion.commands import Commands
from workbench.robot import EffectSpec, RobotModel


class TimingDrift(Effect):
    """Each pose of the controller takes longer than commanded, and the delays add up."""

    name = "timing_drift"
    layer = "timing"
    places = ("robot",)
    family = "timing"
    parameters = (Parameter("per_pose", "s", -0.05, 0.2, 0.003),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"Each pose takes {1000 * scalar(spec, 'per_pose'):.1f} ms longer than commanded."

    def commands(self, commands: Commands, where: tuple[str, ...], values: Mapping[str, float], model: RobotModel) -> Commands:
        k = np.arange(len(commands.times))
        return replace(commands, times=commands.times + k * values["per_pose"], end=commands.end + len(k) * values["per_pose"])


EFFECT = TimingDrift()
