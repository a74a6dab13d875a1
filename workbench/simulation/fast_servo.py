"""A fast variant of the servo on Drake's implicit PD, for large steps and many rollouts.

Exact (up to the implicit step) for a proportional law without margin and punch: duty = clip(gain (ref - q), -1, 1). A
compliance law is approximated by a line through its edge of saturation, which ignores margin and punch inside it; the error
against the full law is measured by a test (tests/simulation/test_station.py).
"""

from __future__ import annotations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PdControllerGains
from pydrake.systems.framework import DiagramBuilder

from workbench.robot import RobotModel
from workbench.servo import ServoLaw
from workbench.servo.bank import HOLDING_DAMPING, find_actuator, servo_joints
from workbench.simulation.reference import ConnectReference


def AddFastServos(builder: DiagramBuilder, plant: MultibodyPlant, model: RobotModel, law: ServoLaw) -> None:
    """Position gain on each joint's own actuator, Coulomb friction on a second one; finalizes the plant and adds
    "joint_reference".

    Both actuators carry the reflected inertia, as a joint's is that of the last one added. Discrete plants only: CENIC sums the
    gains of both and clamps them once.
    """
    joints = servo_joints(plant, model)
    for i, joint in enumerate(joints):
        drive = find_actuator(plant, joint)
        joint.set_default_damping(float(law.damping[i]))
        brakes = [plant.AddJointActuator(f"{joint.name()}_friction", joint)] if law.coulomb[i] > 0 else []
        for actuator in (drive, *brakes):
            actuator.set_default_rotor_inertia(float(law.inertia[i]))
            actuator.set_default_gear_ratio(1.0)
        drive.set_controller_gains(PdControllerGains(p=float(_secant_gain(law, i) * law.full_torque[i]), d=0.0))
        drive.set_effort_limit(float(law.full_torque[i]))
        for brake in brakes:
            brake.set_controller_gains(PdControllerGains(p=0.0, d=HOLDING_DAMPING))
            brake.set_effort_limit(float(law.coulomb[i]))
    plant.Finalize()
    ConnectReference(builder, plant, joints, with_velocity=False)


def _secant_gain(law: ServoLaw, i: int) -> float:
    saturation = law.margin[i] + (1.0 - law.punch[i]) / law.gain[i]
    return float(1.0 / saturation) if np.isfinite(saturation) else 0.0
