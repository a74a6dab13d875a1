"""Applies the effects of a model to the commands, the robot and the camera of this engine."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from studies.other_engine.description import Description, Surroundings
from studies.other_engine.hidden.body import AROUND, ROBOT
from studies.other_engine.hidden.drive import CONSTANTS, STEP, StepEffect
from studies.other_engine.hidden.outside import OUTSIDE_AROUND, OUTSIDE_ROBOT, OUTSIDE_STEP
from studies.other_engine.hidden.timing import COMMANDS
from studies.other_engine.hidden.values import vector
from studies.other_engine.servo import ServoBank
from workbench.motion.commands import Commands
from workbench.robot import EffectSpec, RobotModel
from workbench.types import Array

MEASURED = ("marker_frame",)
VOCABULARY = (*COMMANDS, *ROBOT, *AROUND, *CONSTANTS, *STEP, *MEASURED)
"""The contract's effects."""
OUTSIDE = (*OUTSIDE_STEP, *OUTSIDE_ROBOT, *OUTSIDE_AROUND)
"""Effects that the contract has no name for."""
KNOWN = VOCABULARY + OUTSIDE


@dataclass(frozen=True)
class Hidden:
    """The physics of one take."""

    robot: Description
    around: Surroundings
    servos: ServoBank
    steps: tuple[StepEffect, ...]
    model: RobotModel
    rng: np.random.Generator

    def heard(self, sent: Commands) -> Commands:
        """The commands that reach the servos."""
        for spec in self.model.effects:
            if spec.effect in COMMANDS:
                sent = COMMANDS[spec.effect](sent, spec, self.model, self.rng)
        return sent


def hide(robot: Description, model: RobotModel, rng: np.random.Generator) -> Hidden:
    """The robot with the model's effects; `rng` drives random effects (missed poses, dips of power).

    ValueError for an effect that is not in KNOWN, and for parameters that it cannot use.
    """
    around = Surroundings(model.ground)
    servos = ServoBank([model.servo(j) for j in robot.joints])
    steps: list[StepEffect] = []
    for spec in model.effects:
        i = _columns(robot, spec)
        if spec.effect in (builds := ROBOT | OUTSIDE_ROBOT):
            robot = builds[spec.effect](robot, spec)
        elif spec.effect in (surrounds := AROUND | OUTSIDE_AROUND):
            around = surrounds[spec.effect](around, spec)
        elif spec.effect in CONSTANTS:
            CONSTANTS[spec.effect](servos, i, spec)
        elif spec.effect in (acts := STEP | OUTSIDE_STEP):
            steps.append(acts[spec.effect](i, len(robot.joints), spec, rng))
        elif spec.effect not in (*COMMANDS, *MEASURED):
            raise ValueError(f"expected one of {', '.join(KNOWN)}, got the effect '{spec.effect}'")
    if around.friction is not None:  # the floor's friction, but not of a foot that has its own
        around = replace(around, ground=replace(around.ground, friction=around.friction))
    return Hidden(robot, around, servos, tuple(steps), model, rng)


def turned_frames(model: RobotModel) -> dict[str, Array]:
    """Asset -> rotation vector (3,) [rad], in its own frame, by which the cameras see it turned."""
    turned = (spec for spec in model.effects if spec.effect in MEASURED)
    return {asset: np.deg2rad(vector(spec, "rotation")) for spec in turned for asset in spec.where}


def _columns(robot: Description, spec: EffectSpec) -> NDArray[np.int_]:
    return np.array([robot.joints.index(j) for j in spec.where if j in robot.joints], dtype=int)
