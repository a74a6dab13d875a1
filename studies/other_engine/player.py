"""The robot plays commands in MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from studies.other_engine.description import describe
from studies.other_engine.hidden import Hidden, hide
from studies.other_engine.hidden.drive import Drive, Instant
from studies.other_engine.mjcf import compile_model
from studies.other_engine.servo import Reference
from workbench.motion.commands import Commands
from workbench.robot import RobotModel
from workbench.types import Array


@dataclass(frozen=True)
class Rollout:
    """One run.

    time (N,) [s], from -lead, 0 = first command, in steps. q, v (N, n) [rad, rad/s] of the servos (of the links too, but
    where something is between them) and torque (N, n) [N m, of the motors at the joints] by `joints`; sensed (N, n) [rad]:
    readings of the servos' sensors. qpos (N, nq): MuJoCo's configuration. contact: link -> force on it (N, 3) [N], of
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
    sensed: Array

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
    timestep: float = 5e-4, settle: float = 2.0, chance: int = 0,
) -> Rollout:
    """From neutral: `settle` seconds, `lead` seconds of rest, then `commands` from time 0 to `duration` [s].

    base: "free", from the height at which the lowest foot touches, or "fixed", the root link held level on a stand.
    chance: random generator for the effects that are random. InputError for a base that cannot float; ValueError for an
    effect that this engine does not know (`hidden.KNOWN`).
    """
    if base not in ("free", "fixed"):
        raise ValueError(f"base: expected free or fixed, got '{base}'")
    model.check_base(floating=base == "free")
    hidden = hide(describe(model.path), model, np.random.default_rng(chance))
    compiled = compile_model(hidden.robot, hidden.servos, hidden.around, base, timestep)
    heard = hidden.heard(commands.reordered(hidden.robot.joints))
    return _Run(hidden, compiled).go(heard, duration, lead, settle)


class _Run:
    """MuJoCo's state and that of the servos."""

    def __init__(self, hidden: Hidden, model: mujoco.MjModel) -> None:
        robot = hidden.robot
        self.joints, self.servos, self.model = robot.joints, hidden.servos, model
        self.drive = Drive(hidden.servos, hidden.steps)
        self.data = mujoco.MjData(model)
        self.reference = Reference(len(self.joints), hidden.servos.ramp, hidden.servos.lag)
        self.position = np.array([model.joint(j).qposadr[0] for j in self.joints])
        self.dof = np.array([model.joint(j).dofadr[0] for j in self.joints])
        self.feet = {link.name: model.body(link.name).id for link in robot.links if link.shapes}
        self.tether = hidden.around.tether
        self.pulled, self.needs_load = bool(np.any(self.tether)), self.drive.needs_load
        self.damping = self.servos.viscous + self.servos.back_emf
        self.friction_of = {int(d): i for i, d in enumerate(self.dof)}
        n = len(self.joints)
        self.load, self.motor, self.rubbed = np.zeros(n), np.zeros(n), np.zeros(n)
        """Of the last step [N m]: torque of each servo on its link, torque of its motor, and dry friction."""
        # The angle of a link is the servo's and that of the hinges in series about the same axis.
        self.series = np.zeros((n, model.nq))
        for i, j in enumerate(self.joints):
            link = robot.child_of(j)
            for name in (j, *(s.name for s in link.series if np.allclose(s.axis, link.axis))):
                self.series[i, model.joint(name).qposadr[0]] = 1.0

    def go(self, commands: Commands, duration: float, lead: float, settle: float) -> Rollout:
        h = self.model.opt.timestep
        before, after = round(lead / h), round(duration / h)
        for i in range(round(settle / h)):
            self._step(-lead - settle + i * h)
        time = h * np.arange(-before, after + 1)
        n = len(self.joints)
        q, v, torque, sensed = (np.empty((len(time), n)) for _ in range(4))
        qpos = np.empty((len(time), self.model.nq))
        contact = {foot: np.empty((len(time), 3)) for foot in self.feet}
        due = 0
        for i, t in enumerate(time):
            while due < len(commands.times) and commands.times[due] <= t + 1e-9:
                self._command(commands, due)
                due += 1
            qpos[i] = self.data.qpos
            q[i], v[i] = self.data.qpos[self.position], self.data.qvel[self.dof]
            sensed[i] = self.drive.sensed(q[i])
            torque[i] = self._step(t)
            mujoco.mj_rnePostConstraint(self.model, self.data)
            for foot, body in self.feet.items():
                contact[foot][i] = self.data.cfrc_ext[body, 3:]
        return Rollout(time, self.joints, q, v, torque, qpos, contact, self.model, sensed)

    def _command(self, commands: Commands, k: int) -> None:
        enabled, q = commands.enabled[k], self.drive.sensed(self.data.qpos[self.position])
        self.reference.command(commands.times[k], commands.goals[k], commands.speeds[k], enabled, q)
        self.damping = self.servos.viscous + np.where(enabled, self.servos.back_emf, 0.0)

    def _step(self, t: float) -> Array:
        """One step from t; returns the motors' torque at t. Back-EMF acts through the joints' damping, which is implicit, but
        where less than the motor's torque acts."""
        servos, data, model, on = self.servos, self.data, self.model, self.reference.enabled
        q, v = data.qpos[self.position], data.qvel[self.dof]
        duty = np.where(on, servos.duty(self.reference.at(t) - self.drive.sensed(q), v), 0.0)
        damping, on_link = self.damping, None
        if self.drive.effects:
            now = Instant(t, model.opt.timestep, q, v, self.series @ data.qpos, duty, self.load, self.motor, self.rubbed)
            torque = duty * servos.full_torque * self.drive.strength(now)
            net = torque - np.where(on, servos.back_emf * v, 0.0)
            acting = self.drive.acting(net)
            held, net = np.abs(net) > np.abs(acting), acting
            torque = np.where(held, net, torque)
            damping = np.where(held, servos.viscous, damping)
            model.dof_frictionloss[self.dof] = self.drive.friction(now)
            on_link = self.drive.link_torque(now)
        else:
            torque = duty * servos.full_torque
            net = torque - np.where(on, servos.back_emf * v, 0.0)
        model.dof_damping[self.dof] = damping
        self._pull(torque, on_link)
        mujoco.mj_step(model, data)
        if self.needs_load:
            self.rubbed = self._friction()
            self.load = torque - damping * v - model.dof_armature[self.dof] * data.qacc[self.dof] + self.rubbed
        self.motor = net
        return np.asarray(net, dtype=float)

    def _pull(self, torque: Array, on_link: Array | None) -> None:
        data = self.data
        if self.pulled:
            data.xfrc_applied[1, :3] = self.tether
            data.xfrc_applied[1, 3:] = np.cross(data.xpos[1] - data.xipos[1], self.tether)
        if on_link is not None:
            data.qfrc_applied[:] = 0.0
            np.add.at(data.qfrc_applied, self.model.jnt_dofadr, self._spread(on_link))
            data.qfrc_applied[self.dof] += torque
        else:
            data.qfrc_applied[self.dof] = torque

    def _spread(self, on_link: Array) -> Array:
        """Torques of links (n,) on all hinges that turn them about their servos' axes, by MuJoCo's joints."""
        return np.asarray((on_link @ self.series)[self.model.jnt_qposadr], dtype=float)

    def _friction(self) -> Array:
        """Torque of Coulomb friction on each joint [N m]."""
        data, out = self.data, np.zeros(len(self.joints))
        rows = np.flatnonzero(data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF)
        for row in rows:
            out[self.friction_of[int(data.efc_id[row])]] = data.efc_force[row]
        return out
