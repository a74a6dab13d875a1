"""Inverse dynamics of a trajectory, a take or a motion: joint torques, contact forces, and the wrench that nothing explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.ndimage import uniform_filter1d

from workbench.dynamics.contact import share_forces
from workbench.dynamics.machine import DEFAULT_FRICTION, Machine
from workbench.dynamics.margins import motor_torque, servo_load, speed_margin, torque_margin
from workbench.dynamics.result import InverseDynamicsResult
from workbench.dynamics.stance import dearness, floor_under
from workbench.dynamics.trajectory import RobotTrajectory, smooth
from workbench.files import InputError
from workbench.motion.motion import Motion
from workbench.motion.smoothing import interpolate_motion
from workbench.recording import Take, quaternions
from workbench.robot import RobotModel
from workbench.types import Array, Mask

Stance = Mapping[str, Mask]

RECORDED_WINDOW, SIMULATED_WINDOW = 0.1, 0.02
"""Smoothing of takes [s]: the first turns 0.1 deg of noise at 120 Hz into about 2 rad/s², 0.013 N m of an AX-12's rotor; the
second spans an impact of a simulated foot."""
REGULARISATION = 1e-6
"""Cost of contact force against residual, both over the weight: the tolerance of the residual, as a share of the weight."""
DRAWS = 8
"""Number of noisy copies of a take from which uncertainties are computed."""


@dataclass(frozen=True)
class _Solution:
    torque: Array
    forces: Array
    residual: Array
    support: Array


@dataclass(frozen=True)
class _Spreads:
    """Standard deviations from the measurement's noise: of link torque (N, n), residual (N, 6), and both margins (N, n)."""

    torque: Array
    residual: Array
    torque_left: Array
    speed_left: Array


class InverseDynamics:
    """Inverse dynamics of one robot. Builds its plant once; not for several threads at a time.

    base: "free", feet on a level floor, or "fixed", held level (or as the SDF mounts it), or moved along a path. friction:
    of foot on ground; None: the model's ground, else the SDF's feet, else 0.5. servo_friction: whether the motor torque
    includes the servo's own Coulomb and viscous friction. InputError for a base that the model lacks or
    that cannot float.
    """

    def __init__(self, model: RobotModel, base: Literal["free", "fixed"] = "free", friction: float | None = None,
                 servo_friction: bool = True) -> None:
        if base not in ("free", "fixed"):
            raise InputError(None, f"base: expected free or fixed, got '{base}'")
        model.check_base(floating=base == "free")
        self.model, self.base, self.servo_friction = model, base, servo_friction
        self.machine = Machine(model)
        self.friction = self._pair_friction(friction)
        self._servos = [model.servo(j) for j in model.joints]

    def of(self, trajectory: RobotTrajectory, stance: Stance | None = None, floor: float | None = 0.0, name: str = "trajectory",
           ) -> InverseDynamicsResult:
        """Inverse dynamics of exact positions, velocities and accelerations. Base fixed: the trajectory's base may move, and the
        support moves it.

        stance: foot -> (N,) bool, when feet are down; None: found from heights and speeds. floor: its height [m]; None: where the
        feet find it. InputError for a joint or foot that the model lacks.
        """
        trajectory, problems = self._complete(trajectory)
        solution = self._solve(trajectory, self._dearness(trajectory, stance, floor))
        N, n = trajectory.q.shape
        none = np.zeros((N, n))
        return self._result(name, trajectory, solution, _Spreads(none, np.zeros((N, 6)), none, none), problems)

    def of_motion(self, motion: Motion, cycles: int | None = None) -> InverseDynamicsResult:
        """Inverse dynamics of a motion whose angles are followed exactly (the thesis's smooth cubic, sampled at 240 Hz) on a
        fixed base.

        A motion alone does not say how a free base moves: InputError. Simulate it with the ideal drive, and hand in the take.
        """
        if self.base != "fixed":
            raise InputError(motion.source, "a motion does not say how a free base moves; expected a take of it, ideal drive")
        path = interpolate_motion(motion, motion.often(cycles), 1 / 240)
        N = len(path.time)
        place, turn = np.tile(self.machine.mount[0], (N, 1)), np.tile(self.machine.mount[1], (N, 1))
        still = np.zeros((N, 6))
        trajectory = RobotTrajectory(path.time, path.joints, path.q, path.v, path.a, place, turn, still, still)
        return self.of(trajectory, name=motion.name)

    def of_take(self, take: Take, window: float | None = None, stance: Stance | None = None, floor: float | None = None,
                rest: Mapping[str, float] | None = None, rest_rotation: Array | None = None,
                draws: int | None = None) -> InverseDynamicsResult:
        """Inverse dynamics of a take, whose positions are smoothed and differentiated by cubics over `window` [s] (None: 0.1, or
        0.02 if simulated).

        stance, floor as in `of`. rest: joint -> angle [rad] and rest_rotation (4,) wxyz: the pose and tilt in which a zeroed
        take rested (a Measurement's rest_pose and rest_rotation). Joints that the take did not see are held at their
        commanded angle, or zero. Gaps give NaN. The uncertainties come from `draws` copies of
        the take with noise added: q_sigma, or where the take has none the scatter about the smooth path, independent
        between joints (so feet come out somewhat noisier than rigid bodies that were tracked each for itself). The choice of
        stance and the smoothing's bias are not in them. draws None: 8, or none if the take is simulated and has no noise.
        """
        problems: list[str] = []
        simulated = take.source == "simulation"
        window = window or (SIMULATED_WINDOW if simulated else RECORDED_WINDOW)
        if draws is None:
            draws = 0 if simulated and take.q_sigma is None else DRAWS
        q, seen = self._angles(take, rest or {}, problems)
        p, quat = self._base_path(take)
        if take.zeroed and take.base != "fixed" and rest_rotation is not None:
            quat = quaternions.multiply(quat, rest_rotation)
        trajectory, noise = smooth(take.time, self.model.joints, q, p, quat, window)
        self._note_gaps(take, trajectory, problems)
        dear = self._dearness(trajectory, stance, floor)
        solution = self._solve(trajectory, dear)
        sigma = np.broadcast_to(np.where(seen, noise.q, 0.0), q.shape)
        if take.q_sigma is not None:
            given = self._columns(take.joints, take.q_sigma, np.nan)
            sigma = np.where(np.isfinite(given), given, sigma)
        margins = self._margins(solution, trajectory)
        torque, residual = np.zeros_like(q), np.zeros((len(take), 6))
        torque_left, speed_left = np.zeros_like(q), np.zeros_like(q)
        random = np.random.default_rng(0)
        for _ in range(draws):
            turned = _rotate(quat, _normal(random, np.full(p.shape, noise.rotation)))
            moved = p + _normal(random, np.tile(noise.p, (len(take), 1)))
            noisy = smooth(take.time, self.model.joints, q + _normal(random, sigma), moved, turned, window)[0]
            other = self._solve(noisy, dear)
            torque += (other.torque - solution.torque) ** 2 / draws
            residual += (other.residual - solution.residual) ** 2 / draws
            for sum_, here, there in zip((torque_left, speed_left), margins, self._margins(other, noisy)):
                sum_ += (there - here) ** 2 / draws
        pool = max(1, round(window / float(np.median(np.diff(take.time))))) if len(take) > 1 else 1
        spreads = _Spreads(*(_pool(variance, pool) for variance in (torque, residual, torque_left, speed_left)))
        return self._result(take.name, trajectory, solution, spreads, problems)

    # ---- the equations -----------------------------------------------------------------------------------------------------

    def _solve(self, trajectory: RobotTrajectory, dear: Array) -> _Solution:
        wrench, torque = self.machine.demand(trajectory)
        if self.base == "fixed":
            return _Solution(torque, np.empty((len(wrench), 0, 3)), wrench * 0.0, wrench)
        places = self.machine.places(trajectory)
        arms = places - trajectory.p_WB[:, None]
        weight = self.machine.mass * float(np.linalg.norm(self.machine.gravity)) or 1.0
        length = float(np.sqrt(np.nanmean(np.sum(arms**2, axis=2)))) if np.isfinite(arms).any() else 1.0
        scale = np.repeat([weight * length, weight], 3)
        slip = self.machine.velocities(trajectory, places)[:, :, :2]
        forces, residual = share_forces(wrench, arms, slip, self.friction, dear * REGULARISATION / weight**2, scale)
        torque = torque - self.machine.torque_of(trajectory, places, forces)
        return _Solution(torque, forces, residual, wrench * 0.0)

    def _dearness(self, trajectory: RobotTrajectory, stance: Stance | None, floor: float | None) -> Array:
        if self.base == "fixed":
            return np.empty((len(trajectory.time), 0))
        places, points = self.machine.places(trajectory), self.machine.points
        floors = floor_under(places, points) if floor is None else np.full(len(points.feet), float(floor))
        return dearness(places, self.machine.velocities(trajectory, places), points, floors, stance)

    def _motor(self, solution: _Solution, trajectory: RobotTrajectory) -> Array:
        return motor_torque(self._servos, solution.torque, trajectory.v, trajectory.a, self.servo_friction)

    def _margins(self, solution: _Solution, trajectory: RobotTrajectory) -> tuple[Array, Array]:
        """Margins of torque [N m] and speed [rad/s], (N, n) each."""
        return (torque_margin(self._servos, self._motor(solution, trajectory), trajectory.v),
                speed_margin(self._servos, trajectory.v))

    def _result(self, name: str, trajectory: RobotTrajectory, solution: _Solution, sigma: _Spreads,
                problems: list[str]) -> InverseDynamicsResult:
        motor = self._motor(solution, trajectory)
        torque_left, speed_left = self._margins(solution, trajectory)
        columns = motor, torque_left, speed_left, sigma.torque_left, sigma.speed_left
        loads = {j: servo_load(s, *(values[:, i] for values in columns))
                 for i, (j, s) in enumerate(zip(self.model.joints, self._servos))}
        if self.machine.left_out:
            problems.append(f"{', '.join(self.machine.left_out)}: not in the inverse dynamics; only effects on masses are")
        feet = self.machine.points.feet if self.base == "free" else ()
        contact = {foot: solution.forces[:, self.machine.points.foot == f].sum(axis=1) for f, foot in enumerate(feet)}
        return InverseDynamicsResult(
            name=name, base=self.base, time=trajectory.time, joints=self.model.joints,
            q=trajectory.q, v=trajectory.v, a=trajectory.a, torque=solution.torque, motor_torque=motor,
            contact=contact, base_wrench_residual=solution.residual, support=solution.support,
            torque_margin=torque_left, speed_margin=speed_left, torque_sigma=sigma.torque, residual_sigma=sigma.residual,
            loads=loads, problems=tuple(problems))

    def _pair_friction(self, friction: float | None) -> Array:
        of_feet = self.machine.points.friction
        given = friction if friction is not None else self.model.ground.friction
        if given is not None and not given >= 0:
            raise InputError(None, f"friction: expected a non-negative number, got {given}")
        if given is None:
            return np.where(np.isfinite(of_feet), of_feet, DEFAULT_FRICTION)
        return np.full(len(of_feet), float(given))

    # ---- what a take holds -------------------------------------------------------------------------------------------------

    def _complete(self, trajectory: RobotTrajectory) -> tuple[RobotTrajectory, list[str]]:
        """The trajectory with all joints in the model's order; those that it lacks are at zero."""
        self._check_joints("trajectory", trajectory.joints)
        missing = [j for j in self.model.joints if j not in trajectory.joints]
        q, v, a = (self._columns(trajectory.joints, values, 0.0) for values in (trajectory.q, trajectory.v, trajectory.a))
        full = replace(trajectory, joints=self.model.joints, q=q, v=v, a=a)
        return full, [f"{', '.join(missing)}: not given; held at zero"] if missing else []

    def _angles(self, take: Take, rest: Mapping[str, float], problems: list[str]) -> tuple[Array, Mask]:
        """Angles (N, n) [rad] of all joints, and which of them were seen (n,)."""
        self._check_joints(take.name, take.joints)
        q = self._columns(take.joints, take.q, np.nan)
        seen = np.asarray(np.isfinite(q).any(axis=0))
        unseen = [j for j, s in zip(self.model.joints, seen) if not s]
        held = np.zeros_like(q)
        commanded = take.commands is not None and np.isfinite(take.starts_at)
        if commanded:
            assert take.commands is not None
            held = take.commands.reordered(self.model.joints).reference(take.since_start)
        if unseen:
            problems.append(f"{', '.join(unseen)}: not seen; held at {'the commanded angle' if commanded else 'zero'}")
        if take.zeroed:
            q = q + np.array([rest.get(j, 0.0) for j in self.model.joints])
            if not rest:
                problems.append("angles count from the rest before the first command, which is taken as zero")
        return np.where(seen, q, held), seen

    def _columns(self, joints: tuple[str, ...], values: Array, missing: float) -> Array:
        """Values (N, len(joints)) in the model's order (N, n)."""
        out = np.full((len(values), len(self.model.joints)), missing)
        for i, joint in enumerate(self.model.joints):
            if joint in joints:
                out[:, i] = values[:, joints.index(joint)]
        return out

    def _base_path(self, take: Take) -> tuple[Array, Array]:
        if (take.base == "free") != (self.base == "free"):
            raise InputError(take.name, f"base: the take's is {take.base}, these inverse dynamics are for a {self.base} one")
        if take.base == "fixed":
            return np.tile(self.machine.mount[0], (len(take), 1)), np.tile(self.machine.mount[1], (len(take), 1))
        if take.p_WB is None or take.quat_WB is None:
            raise InputError(take.name, f"base: the take has no pose of '{self.model.base}', which a moving base needs")
        return take.p_WB, take.quat_WB

    def _note_gaps(self, take: Take, trajectory: RobotTrajectory, problems: list[str]) -> None:
        lost = {j: ~np.isfinite(trajectory.a[:, i]) for i, j in enumerate(self.model.joints)} | {
            self.model.base: ~np.isfinite(trajectory.A_WB).all(axis=1)}
        problems += [f"{what}: gaps in {100 * gone.mean():.2g} % of the samples" for what, gone in lost.items() if gone.any()]
        gone = np.any(list(lost.values()), axis=0)
        if gone.all():
            raise InputError(take.name, "no sample has all joints and the base; nothing to compute")
        if gone.any():
            problems.append(f"{100 * gone.mean():.2g} % of the samples have a gap somewhere and no forces")

    def _check_joints(self, source: str, joints: tuple[str, ...]) -> None:
        for joint in joints:
            if joint not in self.model.joints:
                raise InputError(source, f"joint '{joint}': the robot has {' '.join(self.model.joints)}")


def inverse_dynamics(model: RobotModel, take: Take, **choices: object) -> InverseDynamicsResult:
    """Inverse dynamics of one take, on the base it says; choices as in `InverseDynamics.of_take`."""
    return InverseDynamics(model, "free" if take.base == "free" else "fixed").of_take(take, **choices)  # type: ignore[arg-type]


def _normal(random: np.random.Generator, sigma: Array) -> Array:
    return np.asarray(random.standard_normal(sigma.shape) * np.nan_to_num(sigma))


def _rotate(quat: Array, rotation: Array) -> Array:
    """Quaternions wxyz (N, 4) turned by small rotation vectors (N, 3) [rad] in W."""
    return quat + quaternions.multiply(np.hstack([np.zeros((len(rotation), 1)), rotation / 2]), quat)


def _pool(variance: Array, samples: int) -> Array:
    """Standard deviation from the mean variance of neighbouring samples; NaN where there is none."""
    seen = np.asarray(np.isfinite(variance).all(axis=1))
    count = uniform_filter1d(seen.astype(float), samples)
    mean = uniform_filter1d(np.where(seen[:, None], variance, 0.0), samples, axis=0)
    return np.asarray(np.where(seen[:, None], np.sqrt(np.maximum(mean, 0) / np.maximum(count, 1e-9)[:, None]), np.nan))
