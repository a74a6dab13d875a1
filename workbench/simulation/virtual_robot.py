"""The virtual robot: servos on a bus whose joints are those of a station, and cameras that see it; all in one virtual clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from workbench.device.bus.survey import family_of
from workbench.device.virtual import (
    AX12A,
    MX28,
    SECOND,
    STS3215,
    XL330,
    XL430,
    Clock,
    Drive,
    Sense,
    ServoBus,
    VirtualPort,
    VirtualServo,
)
from workbench.device.virtual.motive import Pose, Scene
from workbench.effects.apply import apply_to_commands, apply_to_measurement, physics_of, resolve
from workbench.effects.base import Effect
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.recording import Measurement, Take, observe
from workbench.robot import RobotModel, bus_ids
from workbench.robot.mounting import JointServo, Mounting
from workbench.robot.servo_profile import ServoProfile
from workbench.simulation.config import SimulationConfig
from workbench.simulation.rollout import BaseState, Simulation
from workbench.types import Array

FAMILIES = {"AX-12A": AX12A, "MX-28": MX28, "XL-330": XL330, "XL-430": XL430, "STS3215": STS3215}
"""Families of which there is a virtual servo, by the name of their profile."""
ROTATION_NOISE, POSITION_NOISE = float(np.deg2rad(0.12)), 1e-4
"""Standard deviations of the cameras' noise about and along each axis [rad, m]."""
PIVOT = 0.012
"""How far a rigid body's pivot may lie from its link's origin, along each axis [m]: as wide as a marker cluster."""


class StationBody:
    """Joints of a station, moved by servos whose bus tells the time; as long as not all servos have torque, a hand holds the
    robot where it stands, in neutral. What grows from the first command on does so from when the hand lets go."""

    def __init__(self, model: RobotModel, base: str = "free") -> None:
        self.simulation = Simulation(_without_controller(model), SimulationConfig(base=base, contact_period=0.0))
        self.step = self.simulation.config.time_step
        self._run = self.simulation.stepped()
        self._joints = model.joints
        n = len(model.joints)
        self._goal, self._speed, self._on = np.zeros(n), np.zeros(n), np.zeros(n, dtype=bool)
        self._column = {i: model.joints.index(joint) for joint, i in bus_ids(model).items()}
        self._servo = {i: JointServo(family_of(model), model.mountings.get(joint, Mounting()))
                       for joint, i in bus_ids(model).items()}
        self._changed = False
        self._here: tuple[Array, Array, Array] | None = None
        self.let_go: int | None = None
        """When the hand let go [ticks]; None before."""

    def drive(self, joint: int, now: int, drive: Drive) -> None:
        """From now on the servo does this."""
        self._advance(now)
        k = self._column[joint]
        goal = self._servo[joint].from_servo(drive.goal)
        self._goal[k], self._speed[k], self._on[k] = goal, drive.speed, drive.enabled and drive.torque_limit > 0
        self._changed = True
        if self.let_go is None and self._on.all():
            self.let_go = now

    def sense(self, joint: int, now: int) -> Sense:
        """How the joint is now."""
        self._advance(now)
        if self._here is None:
            state = self._run.state
            duty = self.simulation.diagram.GetOutputPort("duty").Eval(self.simulation.context)
            self._here = np.asarray(state.q), np.asarray(state.v), np.asarray(duty)
        q, v, duty = self._here
        k = self._column[joint]
        since = self.time(now) - self._run.time
        servo = self._servo[joint]
        sign = servo.mounting.direction
        return Sense(servo.to_servo(float(q[k] + since * v[k])), sign * float(v[k]), sign * float(duty[k] * self._on[k]))

    def time(self, now: int) -> float:
        """The station's clock [s] at a time of the bus's [ticks]: it starts when the hand lets go."""
        return 0.0 if self.let_go is None else (now - self.let_go) / SECOND

    def base(self, now: int) -> BaseState | None:
        """Pose and velocity of the free base at a time of the bus's [ticks]; None of a held one."""
        self._advance(now)
        return self._run.base

    def take(self, started: float) -> Take:
        """The take since then, time 0 at `started` [s on the station's clock]."""
        take = self._run.take()
        return replace(take, time=take.time - started, starts_at=0.0)

    def _advance(self, now: int) -> None:
        """Whole steps up to the one nearest to now; what servos were told in the same instant goes out as one command."""
        target = int(self.time(now) / self.step + 0.5) * self.step
        if target <= self._run.time + 1e-9:
            return
        if self._changed:
            self._changed = False
            self._run.send(Commands(np.zeros(1), self._joints, self._goal[None].copy(), self._speed[None].copy(),
                                    self._on[None].copy(), end=1.0, poses=np.array([-1])))
        self._run.advance(target - self._run.time)
        self._here = None


def _without_controller(model: RobotModel) -> RobotModel:
    """The same robot with a controller that adds nothing: the commands on the bus have passed through the real one."""
    kept = tuple(spec for effect, spec, _ in resolve(model) if type(effect).commands is Effect.commands)
    return replace(model, effects=kept)


class VirtualRobot:
    """A robot on its bus. model: as it really is, hidden effects included; base: "free" or "fixed".

    Each servo's registers hold the model's constants. rate: of the bus [bit/s].
    """

    def __init__(self, model: RobotModel, base: str = "free", rate: int = 1_000_000) -> None:
        family = family_of(model)
        if family.name not in FAMILIES:
            raise InputError(model.description, f"no emulator for {family.name}; available: {', '.join(FAMILIES)}")
        self.model, self.base, self.profile = model, base, family
        self.clock = Clock()
        self.bus = ServoBus(self.clock)
        law = physics_of(model).law
        self.bus.supply = float(law.full_torque[0] / law.torque_per_volt[0])  # what is there, whatever the model says
        self.body = StationBody(model, base)
        self.servos = {joint: VirtualServo(self.bus, FAMILIES[family.name], i, self.body) for joint, i in bus_ids(model).items()}
        for joint, servo in self.servos.items():
            servo["return_delay_time"] = 0
            for name, value in _law(model, joint, family).items():
                servo[name] = value
        self.port = VirtualPort(self.bus, rate)

    def controller(self, commands: Commands) -> Commands:
        """A motion's commands after the robot's controller: delayed, dropped or mixed up by the model's effects."""
        return apply_to_commands(commands.reordered(self.model.joints), self.model)

    def scene(self, started: float, seed: int = 0) -> tuple[tuple[str, ...], Scene, float, float]:
        """What cameras saw from the rest before the first pose on: names of the bodies, their poses by the time since then, when
        that was and until when [s on the bus's clock].

        started: when the first pose was sent [s on the bus's clock]. A yaw, pivots and the noise by `seed`.
        """
        rng = np.random.default_rng(seed)
        let_go = self.body.let_go
        assert let_go is not None, "nothing was played"
        take = self.body.take(started - let_go / SECOND)
        begin = max(take.time[0], -0.9)
        rest = take.resampled(take.time[take.time >= begin - 1e-9])
        measurement = apply_to_measurement(self._measurement(rest, rng), self.model)
        times = rest.time - rest.time[0]
        _, tracks = observe(rest, measurement, self.model, times)
        names = tuple(tracks)
        p = {n: t.p + rng.normal(0, POSITION_NOISE, t.p.shape) for n, t in tracks.items()}
        quat = {n: _shaken(t.quat, rng.normal(0, ROTATION_NOISE, t.p.shape)) for n, t in tracks.items()}

        def scene(t: float) -> Mapping[str, Pose]:
            k = min(max(round(t / self.body.step), 0), len(times) - 1)
            return {n: (tuple(p[n][k]), (*quat[n][k][1:], quat[n][k][0]), True) for n in names}

        return names, scene, started + float(rest.time[0]), started + float(rest.time[-1])

    def _measurement(self, rest: Take, rng: np.random.Generator) -> Measurement:
        pivots = {asset: rng.uniform(-PIVOT, PIVOT, 3) for asset in self.model.rigid_bodies}
        return Measurement(starts_at=-float(rest.time[0]), yaw=float(rng.uniform(-np.pi, np.pi)),
                           origin=np.array([*rng.uniform(-0.5, 0.5, 2), 0.2]), pivots=pivots)


def _law(model: RobotModel, joint: str, family: ServoProfile) -> dict[str, int]:
    constants = model.servo(joint)
    return {name: law.counts(value) for key, law in family.law.items() if (value := getattr(constants, key)) is not None
            for name in law.registers}


def _shaken(quat: Array, turn: Array) -> Array:
    """Quaternions wxyz (N, 4), each turned by a small rotation vector (N, 3) [rad]."""
    from workbench.recording import quaternions

    half = np.concatenate([np.ones((len(turn), 1)), turn / 2], axis=1)
    return quaternions.multiply(quat, half / np.linalg.norm(half, axis=1, keepdims=True))
