"""The logs of a run, as plain arrays."""

from __future__ import annotations

import numpy as np
from pydrake.planning import RobotDiagram
from pydrake.systems.framework import Context

from workbench.motion.commands import Commands
from workbench.robot import RobotModel
from workbench.servo import ServoLaw
from workbench.servo.bank import servo_joints
from workbench.simulation.config import SimulationConfig
from workbench.simulation.gantry import AXES, base_poses
from workbench.types import Array, Mask

LOGS = ("state_log", "net_actuation_log", "reference_log", "generalized_force_log", "motor_torque_log", "friction_relief_log")


class RunLogs:
    """The logs of a station, read by the names of joints. `context` is the diagram's, after a run."""

    def __init__(self, diagram: RobotDiagram, context: Context, model: RobotModel, config: SimulationConfig,
                 law: ServoLaw) -> None:
        self._diagram, self._context, self._model, self._config = diagram, context, model, config
        self._plant = diagram.plant()
        joints = servo_joints(self._plant, model)
        self._q = np.array([j.position_start() for j in joints], dtype=int)
        self._v = np.array([j.velocity_start() for j in joints], dtype=int)
        self._law = law
        actuators = [self._plant.get_joint_actuator(a) for a in self._plant.GetJointActuatorIndices()]
        last = {a.joint().name(): a.input_start() for a in actuators}  # each of a joint's actuators shows the joint's total
        self._u = np.array([last[j.name()] for j in joints if j.name() in last], dtype=int)

    def clear(self) -> None:
        """Empties the logs before a run."""
        for name in LOGS:
            if self._diagram.HasSubsystemNamed(name):
                self._diagram.GetSubsystemByName(name).FindMutableLog(self._context).Clear()

    def read(self, name: str) -> tuple[Array, Array]:
        """Times (N,) [s] and values (N, size) of a log, copied, as the next run overwrites them."""
        log = self._diagram.GetSubsystemByName(f"{name}_log").FindLog(self._context)
        return log.sample_times().copy(), log.data().T.copy()

    def joints(self, state: Array) -> tuple[Array, Array]:
        """The servos' side: angles and velocities (N, n) [rad, rad/s] from logged states (N, nq + nv)."""
        return state[:, self._q], state[:, self._plant.num_positions() + self._v]

    def joints_named(self, names: tuple[str, ...], state: Array) -> tuple[Array, Array]:
        """The same as `joints`, for any joints of the plant with one angle each."""
        found = [self._plant.GetJointByName(n) for n in names]
        q, v = ([j.position_start() for j in found], [j.velocity_start() for j in found])
        return state[:, q], state[:, self._plant.num_positions() + np.array(v, dtype=int)]

    def base_path(self, state: Array) -> tuple[Array, Array]:
        """p_WB (N, 3) [m] and quat_WB (N, 4) wxyz of the base link."""
        base = self._plant.GetBodyByName(self._model.base)
        if self._config.base == "free":
            start = base.floating_positions_start()
            return state[:, start + 4:start + 7], state[:, start:start + 4]
        if self._config.base == "path":
            columns = [self._plant.GetJointByName(f"gantry_{a}").position_start() for a in AXES]
            return base_poses(state[:, columns])
        X_WB = self._plant.EvalBodyPoseInWorld(self._plant.GetMyContextFromRoot(self._context), base)
        return np.tile(X_WB.translation(), (len(state), 1)), np.tile(X_WB.rotation().ToQuaternion().wxyz(), (len(state), 1))

    def torque(self, since_start: Array, q: Array, v: Array, commands: Commands | None) -> Array:
        """Torque of the servos on the joints (N, n) [N m]: of the motor, less viscous and Coulomb friction.

        since_start: (N,) [s] after the first command."""
        if self._config.drive == "servo" and self._config.time_step == 0 and not self._config.uses_cenic:
            force = self.read("generalized_force")[1][:, self._v]
            return np.asarray(force - self._law.damping * v)
        drake = self.read("net_actuation")[1][:, self._u]
        if self._config.drive == "ideal":
            return drake
        if self._config.drive == "fast_servo":
            return np.asarray(drake - self._law.damping * v)
        if self._diagram.HasSubsystemNamed("motor_torque_log"):
            return np.asarray(self.read("motor_torque")[1] - self._law.viscous * v + drake + self.read("friction_relief")[1])
        enabled: Mask | bool = True
        if commands is not None and not commands.enabled.all():
            row = np.clip(np.searchsorted(commands.times, since_start + 1e-9, side="right") - 1, 0, None)
            enabled = commands.enabled[row]
        error = self.read("reference")[1] - q
        return np.asarray(self._law.motor_torque(error, v, enabled) - self._law.viscous * v + drake)
