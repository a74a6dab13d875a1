"""Commands reach the servos late."""

from __future__ import annotations

import math
from collections.abc import Mapping

from workbench.effects.base import Effect, Parameter, scalar
from workbench.effects.schedules import LOOP, delay_commands
from workbench.motion.commands import Commands
from workbench.recording.servo_log.duty_register import RegisterLaw
from workbench.robot import EffectSpec, RobotModel, ServoConstants

REGISTER_ERROR = 0.002
"""Standard error of a delay read from duty [s]: twelve sessions of one STS3215 gave delays 1.2 ms (RMS) apart; the
ages of register and position differ by some milliseconds."""


class CommandDelay(Effect):
    """Commands reach the servos late."""

    name = "command_delay"
    layer = "timing"
    places = ("joint", "robot",)
    family = "timing"
    like_a_late_start = True
    # two rounds of a USB adapter whose latency timer is at its default of 16 ms, plus the servo's own delay
    parameters = (Parameter("delay", "s", 0.0, 0.5, 0.01, resolution=LOOP / math.sqrt(3.0), seldom_beyond=0.04),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"Commands reach {', '.join(spec.where) or 'all servos'} {1000 * scalar(spec, 'delay'):.1f} ms late."

    def commands(self, commands: Commands, where: tuple[str, ...], values: Mapping[str, float], model: RobotModel) -> Commands:
        return delay_commands(commands, [commands.joints.index(j) for j in where] or range(len(commands.joints)), values["delay"])

    def in_duty(self, law: RegisterLaw, servo: ServoConstants) -> tuple[float, float] | None:
        """Beyond the servo's own delay, as well as that is known."""
        own = servo.share_known("goal_delay") * servo.goal_delay
        return law.delay - servo.goal_delay, math.hypot(max(law.sd["delay"], REGISTER_ERROR), own)


EFFECT = CommandDelay()
