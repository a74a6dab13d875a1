"""The robot plays commands in MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from studies.other_engine.description import Description, describe
from studies.other_engine.mjcf import compile_model
from studies.other_engine.servo import Reference, ServoBank
from workbench.motion.commands import Commands
from workbench.robot import RobotModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rollout:
    """One run.

    time (N,) [s], from -lead, 0 = first command, in steps. q, v (N, n) [rad, rad/s] and torque (N, n) [N m, of the
    motors at the joints] by `joints`. qpos (N, nq): MuJoCo's configuration. contact: link -> force on it (N, 3) [N], of
    the ground and of other links, for links with contact shapes. model: MuJoCo's model, whose bodies are the links.
    """

    time: Array
    joints: tuple[str, ...]
    q: Array
    v: Array
    torque: Array
    qpos: Array
    contact: dict[str, Array]
    model: mujoco.MjModel

    def poses(self, time: Array, links: tuple[str, ...]) -> dict[str, tuple[Array, Array]]:
        """Link -> (p (M, 3) [m], R (M, 3, 3)) in the world at times (M,) in the run, interpolated between steps."""
        data = mujoco.MjData(self.model)
        out = {link: (np.empty((len(time), 3)), np.empty((len(time), 3, 3))) for link in links}
        bodies = {link: self.model.body(link).id for link in links}
        step = self.time[1] - self.time[0]
        place = np.clip((np.asarray(time) - self.time[0]) / step, 0, len(self.time) - 1)
        for k, x in enumerate(place):
            i = min(int(x), len(self.time) - 2)
            # Half a millisecond apart the quaternion's chord is its arc; mj_kinematics normalises it.
            data.qpos[:] = (1 - (x - i)) * self.qpos[i] + (x - i) * self.qpos[i + 1]
            mujoco.mj_kinematics(self.model, data)
            for link, b in bodies.items():
                out[link][0][k] = data.xpos[b]
                out[link][1][k] = data.xmat[b].reshape(3, 3)
        return out


def play(
    model: RobotModel, commands: Commands, duration: float, lead: float = 0.3, base: str = "free",
    timestep: float = 5e-4, settle: float = 2.0,
) -> Rollout:
    """From neutral: `settle` seconds, `lead` seconds of rest, then `commands` from time 0 to `duration` [s].

    base: "free", from the height at which the lowest foot touches, or "fixed", the root link held level on a stand.
    InputError for a base that cannot float; ValueError for a model with effects: this engine plays the nominal robot.
    """
    if model.effects:
        raise ValueError(f"expected a nominal robot, got the effect '{model.effects[0].effect}'")
    if base not in ("free", "fixed"):
        raise ValueError(f"base: expected free or fixed, got '{base}'")
    model.check_base(floating=base == "free")
    description = describe(model.path)
    servos = ServoBank([model.servo(j) for j in description.joints])
    compiled = compile_model(description, servos, model.ground, base, timestep)
    return _Run(description, servos, compiled).go(commands.reordered(description.joints), duration, lead, settle)


class _Run:
    """MuJoCo's state and the servos' beside it."""

    def __init__(self, description: Description, servos: ServoBank, model: mujoco.MjModel) -> None:
        self.joints, self.servos, self.model = description.joints, servos, model
        self.data = mujoco.MjData(model)
        self.reference = Reference(len(self.joints))
        self.position = np.array([model.joint(j).qposadr[0] for j in self.joints])
        self.dof = np.array([model.joint(j).dofadr[0] for j in self.joints])
        self.feet = {link.name: model.body(link.name).id for link in description.links if link.shapes}

    def go(self, commands: Commands, duration: float, lead: float, settle: float) -> Rollout:
        h = self.model.opt.timestep
        before, after = round(lead / h), round(duration / h)
        for i in range(round(settle / h)):
            self._step(-lead - settle + i * h)
        time = h * np.arange(-before, after + 1)
        n = len(self.joints)
        q, v, torque = np.empty((len(time), n)), np.empty((len(time), n)), np.empty((len(time), n))
        qpos = np.empty((len(time), self.model.nq))
        contact = {foot: np.empty((len(time), 3)) for foot in self.feet}
        due = 0
        for i, t in enumerate(time):
            while due < len(commands.times) and commands.times[due] <= t + 1e-9:
                self._command(commands, due)
                due += 1
            qpos[i] = self.data.qpos
            q[i], v[i] = self.data.qpos[self.position], self.data.qvel[self.dof]
            torque[i] = self._step(t)
            mujoco.mj_rnePostConstraint(self.model, self.data)
            for foot, body in self.feet.items():
                contact[foot][i] = self.data.cfrc_ext[body, 3:]
        return Rollout(time, self.joints, q, v, torque, qpos, contact, self.model)

    def _command(self, commands: Commands, k: int) -> None:
        enabled, q = commands.enabled[k], self.data.qpos[self.position]
        self.reference.command(commands.times[k], commands.goals[k], commands.speeds[k], enabled, q)
        self.model.dof_damping[self.dof] = self.servos.viscous + np.where(enabled, self.servos.back_emf, 0.0)

    def _step(self, t: float) -> Array:
        """One step from t; returns the motors' torque at t. Back-EMF acts through the joints' damping, not here."""
        servos, data = self.servos, self.data
        on = self.reference.enabled
        drive = np.where(on, servos.duty(self.reference.at(t) - data.qpos[self.position]) * servos.full_torque, 0.0)
        net = drive - np.where(on, servos.back_emf * data.qvel[self.dof], 0.0)
        data.qfrc_applied[self.dof] = drive
        mujoco.mj_step(self.model, data)
        return np.asarray(net, dtype=float)
