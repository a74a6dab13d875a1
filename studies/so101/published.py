"""This arm's servos as others publish them, for comparison with the findings: stiffness, damping and friction of each joint.

A simulator's position actuator is the servo law with a gain of kp over the largest torque and a back-EMF of kv.
"""

from __future__ import annotations

from dataclasses import dataclass

from workbench.recording.formats.sage import JOINTS
from workbench.robot import RobotModel, ServoConstants


@dataclass(frozen=True)
class Published:
    """kp [N m/rad], kv and damping [N m s/rad], friction [N m], armature [kg m^2], torque [N m] at most; the joints it is said
    of."""

    name: str
    source: str
    kp: float
    kv: float
    damping: float
    friction: float
    armature: float
    torque: float = 2.94
    joints: tuple[str, ...] = JOINTS

    def servo(self, jaw_range: float | None = None) -> ServoConstants:
        """Of one joint; jaw_range [rad]: of the jaw, whose angle the recordings give as a share of it (`robot.servo`)."""
        s = 1.0 if jaw_range is None else jaw_range
        volt = 7.4
        return ServoConstants(
            model="STS3215", stall_torque=self.torque / s, no_load_speed=self.torque / self.kv / s, rated_voltage=volt,
            supply_voltage=volt, coulomb_friction=self.friction / s, viscous_friction=self.damping,
            reflected_inertia=self.armature, proportional_gain=s * self.kp / self.torque,
            compliance_slope=None, compliance_margin=None, punch=None)

    def robot(self, nominal: RobotModel, jaw_range: float) -> RobotModel:
        """The nominal arm with these servos."""
        return nominal.with_physics({j: self.servo(jaw_range if j == "Jaw" else None) for j in JOINTS}, ())


PUBLISHED = (
    Published("the arm's makers", "TheRobotStudio/SO-ARM100 pull request 141 and mujoco_menagerie's so101.xml, for P 16",
              kp=998.22, kv=2.731, damping=0.60, friction=0.052, armature=0.028),
    Published("AnchorBench, identified", "data card sreetz-nv/so101_vials_actuators_sysid, its pan joint",
              kp=48.4, kv=3.3, damping=1.59, friction=0.347, armature=0.068, joints=("Rotation",)),
    Published("AnchorBench, by hand", "data card sreetz-nv/so101_vials_actuators_hand_tuned, its pan joint",
              kp=33.0, kv=1.6, damping=0.0, friction=0.0, armature=0.02, joints=("Rotation",)))
"""Largest torque: the makers', as the data cards give none. Bam's servo, also published, is the nominal one."""
