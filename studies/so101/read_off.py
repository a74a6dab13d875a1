"""A model without any search: gain, friction and damping of each joint from the regressions on training programmes.

Stiffness is one over the compliance with which gravity shows in the error (joints that gravity does not turn: the mean of the
others, as all servos are of one kind), dry friction half the distance of the two errors at rest, damping follows from the delay
of the joint; all of them over the nominal servo's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from studies.so101.response import Response
from studies.so101.rest import NamePosterior
from studies.so101.zero import Zero
from workbench.robot import EffectSpec, RobotModel
from workbench.servo import ServoLaw


def read_off(nominal: RobotModel, moving: Mapping[str, Response], resting: Mapping[str, NamePosterior | None],
             zeros: Mapping[str, Zero]) -> RobotModel:
    """The nominal model with servo_gain, coulomb_friction and viscous_friction at every joint."""
    law = ServoLaw.of([nominal.servo(j) for j in nominal.joints])
    stiffness = law.gain * law.full_torque
    ratios = {j: 1 / (z.sign.value * stiffness[nominal.joints.index(j)]) for j, z in zeros.items()}
    effects = []
    for i, joint in enumerate(nominal.joints):
        ratio = ratios.get(joint, float(np.mean(list(ratios.values()))))
        k = ratio * stiffness[i]
        stands = resting[joint]
        dry = 0.0 if stands is None else max(0.0, stands.width.value * k - law.coulomb[i])
        damping = max(0.0, moving[joint].late.value * k - law.damping[i])
        effects += [EffectSpec("servo_gain", (joint,), {"ratio": round(float(ratio), 4)}),
                    EffectSpec("coulomb_friction", (joint,), {"torque": round(float(dry), 5)}),
                    EffectSpec("viscous_friction", (joint,), {"coefficient": round(float(damping), 5)})]
    return replace(nominal, effects=tuple(effects))
