"""The controller's clock runs slower or faster than the recording's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from workbench.effects.base import Effect, Parameter
from workbench.motion.commands import Commands
from workbench.recording.servo_log.duty_register import RegisterLaw
from workbench.robot import EffectSpec, RobotModel, ServoConstants

REGISTER_ERROR = 0.001
"""Standard error of a clock read from a register of duty, as a share: twelve sessions of one STS3215 gave up to 0.13 %."""


class ClockRate(Effect):
    """The controller's clock runs slower or faster than the recording's."""

    name = "clock_rate"
    layer = "timing"
    places = ("robot",)
    family = "timing"
    # an STM32's own oscillator (data sheet): 1 % at 25 deg C, up to 2.5 % over temperature; a crystal 0.01 %
    parameters = (Parameter("ratio", "1", 0.5, 2.0, 1.01, seldom_beyond=1.015),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"One second of the commands takes {spec.parameters['ratio']:.4f} s in the recording."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (1.0,)

    def commands(self, commands: Commands, where: tuple[str, ...], values: Mapping[str, float], model: RobotModel) -> Commands:
        return replace(commands, times=commands.times * values["ratio"], end=commands.end * values["ratio"])

    def in_duty(self, law: RegisterLaw, servo: ServoConstants) -> tuple[float, float] | None:
        return law.rate, max(law.sd["rate"], REGISTER_ERROR)


EFFECT = ClockRate()
