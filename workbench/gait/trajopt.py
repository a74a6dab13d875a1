"""Seeds by trajectory optimisation: a kino-centroidal programme with a footfall schedule, on SNOPT or IPOPT.

Over one cycle of N knots the unknowns are the base's pose and twist, the angles of the leg joints, the feet's forces, and the
footholds (after H. Dai, A. Valenzuela, R. Tedrake, Humanoids 2014, with the footfalls prescribed). The robot is one
rigid body at its neutral inertia, its legs massless; tilts are small. Joint ranges and speeds, friction, and the joint torques
caused by the forces (through the legs' Jacobians in the middle of the path) are bounds.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue
from pydrake.solvers import IpoptSolver, MathematicalProgram, SnoptSolver, SolverOptions

from workbench.gait.legs import Leg
from workbench.gait.machine import GaitMachine
from workbench.gait.shape import GaitShape, foot_path
from workbench.robot import GRAVITY
from workbench.types import Array, Mask

KNOTS = 16
TORQUE_SHARE = 0.8
"""Of the torque at full duty that a force may ask of a joint standing still; back-EMF and friction take the rest."""
FRICTION_SHARE = 0.9
"""Of the friction coefficient that planned forces may use."""
LARGEST_TILT = 0.25
"""[rad] up to which the programme's small rotations are right to 1 %."""
MOST_ITERATIONS = 300


@dataclass(frozen=True)
class Task:
    """Task of the programme: a footfall schedule and a motion. velocity: forward, left [m/s]; turn_rate [rad/s]; slope
    [rad] uphill. shape: family, knees, frequency, duty, lift and crouch to begin with."""

    name: str
    shape: GaitShape
    velocity: tuple[float, float] = (0.0, 0.0)
    turn_rate: float = 0.0
    slope: float = 0.0


@dataclass(frozen=True)
class Planned:
    """Solution. solved: whether a solver succeeded; solver, seconds: which, and how long. q (N, n) [rad] at the knots, of every
    joint; stance (N, F); forces (N, F, 3) [N]; p (N, 3) [m], tilt (N, 3) [rad] of the base off the moving frame; shape:
    the gait with the closest parameters, a seed."""

    task: Task
    solved: bool
    solver: str
    seconds: float
    q: Array
    stance: Mask
    forces: Array
    p: Array
    tilt: Array
    shape: GaitShape


def plan(machine: GaitMachine, task: Task) -> Planned:
    """Solves the programme, with SNOPT, and if that fails with IPOPT."""
    began = time.perf_counter()
    programme = _Programme(machine, task)
    result = None
    for solver in (SnoptSolver(), IpoptSolver()):
        result = solver.Solve(programme.prog, programme.guess, programme.options)
        if result.is_success():
            break
    assert result is not None
    return programme.read(result, time.perf_counter() - began)


class _Programme:
    def __init__(self, machine: GaitMachine, task: Task) -> None:
        self.machine, self.task, self.legs = machine, task, machine.legs
        shape = task.shape
        stride = np.array(task.velocity) * shape.duty * shape.period
        self.shape = replace(shape, stride=float(stride[0]), side=float(stride[1]),
                             turn=task.turn_rate * shape.duty * shape.period)
        self.N, self.dt = KNOTS, shape.period / KNOTS
        self.phases = np.arange(KNOTS) / KNOTS
        self.path = foot_path(self.shape, self.legs, self.phases)
        self.columns = [[machine.model.joints.index(j) for j in leg.joints] for leg in self.legs]
        self.prog = MathematicalProgram()
        self._variables()
        self._guess()
        self._kinematics()
        self._dynamics()
        self._bounds()
        self._costs()
        self.options = SolverOptions()
        self.options.SetOption(SnoptSolver.id(), "Major iterations limit", MOST_ITERATIONS)
        self.options.SetOption(SnoptSolver.id(), "Major feasibility tolerance", 1e-4)
        self.options.SetOption(SnoptSolver.id(), "Major optimality tolerance", 1e-3)
        self.options.SetOption(IpoptSolver.id(), "max_iter", MOST_ITERATIONS)
        self.options.SetOption(IpoptSolver.id(), "tol", 1e-3)
        self.options.SetOption(IpoptSolver.id(), "hessian_approximation", "limited-memory")

    def _variables(self) -> None:
        prog, N, F = self.prog, self.N, len(self.legs)
        self.p = prog.NewContinuousVariables(N, 3, "p")  # of the base, in a frame that goes and turns with the wanted motion
        self.tilt = prog.NewContinuousVariables(N, 3, "tilt")
        self.v = prog.NewContinuousVariables(N, 3, "v")
        self.w = prog.NewContinuousVariables(N, 3, "w")
        self.q = [prog.NewContinuousVariables(N, len(leg.joints), f"q_{leg.foot}") for leg in self.legs]
        self.f = prog.NewContinuousVariables(N, 3 * F, "f")
        self.place = prog.NewContinuousVariables(F, 2, "place")

    def _guess(self) -> None:
        self.guess = np.zeros(self.prog.num_vars())
        q, _, stance = self.machine.angles(self.shape, self.phases)
        weight = self.machine.model.kinematics.mass * GRAVITY
        shares = stance / np.maximum(stance.sum(axis=1, keepdims=True), 1)
        force = np.zeros((self.N, len(self.legs), 3))
        force[..., 2] = weight * shares
        self.put(self.f, force.reshape(self.N, -1))
        for columns, variables in zip(self.columns, self.q):
            self.put(variables, q[:, columns])
        self.guess_q = q

    def put(self, variables: Array, values: Array) -> None:
        """Sets the initial guess."""
        self.prog.SetDecisionVariableValueInVector(variables, values, self.guess)

    def _kinematics(self) -> None:
        """Feet are where they should: relative to the frame that goes along, the footfall path moved by each foot's placement."""
        for i, (leg, variables) in enumerate(zip(self.legs, self.q)):
            for k in range(self.N):
                target = self.path.p[k, i] + np.array([0.0, 0.0, -self.shape.crouch])
                names = [*self.p[k], *self.tilt[k], *variables[k], *self.place[i]]
                self.prog.AddConstraint(_Foot(leg, target), np.zeros(3), np.zeros(3), names)

    def _dynamics(self) -> None:
        prog, N, dt = self.prog, self.N, self.dt
        k, legs = self.machine.model.kinematics, self.legs
        inertia = _inertia(self.machine)
        down = GRAVITY * np.array([-np.sin(self.task.slope), 0.0, -np.cos(self.task.slope)])
        for n in range(N):
            m = (n + 1) % N
            one = np.eye(3)
            prog.AddLinearEqualityConstraint(np.hstack([one, -one, *[-dt / k.mass * one] * len(legs)]), dt * down,
                                             [*self.v[m], *self.v[n], *self.f[n]])
            for place, rate in ((self.p, self.v), (self.tilt, self.w)):
                prog.AddLinearEqualityConstraint(np.hstack([one, -one, -dt / 2 * one, -dt / 2 * one]), np.zeros(3),
                                                 [*place[m], *place[n], *rate[m], *rate[n]])
            feet = self.path.p[n] + np.array([0.0, 0.0, -self.shape.crouch])
            names = [*self.p[n], *self.w[n], *self.w[m], *self.f[n], *self.place.flatten()]
            prog.AddConstraint(_Turning(feet, inertia, dt, _com(self.machine)), np.zeros(3), np.zeros(3), names)
        for axis in (0, 1):  # the cycle has no place of its own on the floor
            prog.AddBoundingBoxConstraint(0, 0, self.p[0, axis])
        prog.AddBoundingBoxConstraint(0, 0, self.tilt[0, 2])

    def _bounds(self) -> None:
        prog, machine, law = self.prog, self.machine, self.machine.law
        friction = machine.model.ground.friction
        mu = FRICTION_SHARE * (0.5 if friction is None else friction) / np.sqrt(2)  # a pyramid inside the cone
        fastest = self.dt * machine.fastest * machine.speed_unit
        prog.AddBoundingBoxConstraint(-LARGEST_TILT, LARGEST_TILT, self.tilt.flatten())
        prog.AddBoundingBoxConstraint(-0.6 * machine.leg_length, 0.02, self.p[:, 2])
        prog.AddBoundingBoxConstraint(-0.3 * machine.leg_length, 0.3 * machine.leg_length, self.place.flatten())
        for i, (leg, columns, q) in enumerate(zip(self.legs, self.columns, self.q)):
            lower = [machine.ranges[j].lower for j in leg.joints]
            upper = [machine.ranges[j].upper for j in leg.joints]
            middle = leg.jacobian(self.guess_q[:, columns].mean(axis=0)[None])[0]
            for n in range(self.N):
                prog.AddBoundingBoxConstraint(lower, upper, q[n])
                prog.AddLinearConstraint(np.hstack([np.eye(len(columns)), -np.eye(len(columns))]), -fastest[columns],
                                         fastest[columns], [*q[(n + 1) % self.N], *q[n]])
                f = self.f[n, 3 * i:3 * i + 3]
                if not self.path.stance[n, i]:
                    prog.AddBoundingBoxConstraint(0, 0, f)
                    continue
                prog.AddBoundingBoxConstraint(0, np.inf, f[2])
                prog.AddLinearConstraint(np.array([[1, 0, -mu], [-1, 0, -mu], [0, 1, -mu], [0, -1, -mu]]), np.full(4, -np.inf),
                                         np.zeros(4), f)
                most = TORQUE_SHARE * law.full_torque[columns]
                prog.AddLinearConstraint(middle.T, -most, most, f)

    def _costs(self) -> None:
        prog, weight = self.prog, self.machine.model.kinematics.mass * GRAVITY
        prog.AddQuadraticErrorCost(np.eye(self.f.size) / weight**2, np.zeros(self.f.size), self.f.flatten())
        prog.AddQuadraticErrorCost(10 * np.eye(self.tilt.size), np.zeros(self.tilt.size), self.tilt.flatten())
        prog.AddQuadraticErrorCost(10 * np.eye(self.v.size), np.zeros(self.v.size), self.v.flatten())
        height = np.full(self.N, -self.shape.crouch)
        prog.AddQuadraticErrorCost(100 * np.eye(self.N), height, self.p[:, 2])
        for columns, q in zip(self.columns, self.q):
            guess = self.guess_q[:, columns]
            prog.AddQuadraticErrorCost(0.1 * np.eye(q.size), guess.flatten(), q.flatten())

    def read(self, result: object, seconds: float) -> Planned:
        """The solution, and the shape nearest to it."""
        get = result.GetSolution  # type: ignore[attr-defined]
        q = np.zeros((self.N, len(self.machine.model.joints)))
        for columns, variables in zip(self.columns, self.q):
            q[:, columns] = get(variables)
        p, tilt, place = get(self.p), get(self.tilt), get(self.place)
        forces = get(self.f).reshape(self.N, len(self.legs), 3)
        return Planned(self.task, bool(result.is_success()), result.get_solver_id().name(), seconds, q,  # type: ignore[attr-defined]
                       self.path.stance, forces, p, tilt, self._nearest(p, tilt, place))

    def _nearest(self, p: Array, tilt: Array, place: Array) -> GaitShape:
        neutral = np.array([leg.neutral for leg in self.legs])
        front, left = neutral[:, 0] > neutral[:, 0].mean(), neutral[:, 1] > neutral[:, 1].mean()
        shift = place - p[:, :2].mean(axis=0)
        wheelbase = float(neutral[front, 0].mean() - neutral[~front, 0].mean())
        sway = np.fft.fft(p[:, 1])[1] / self.N
        length = self.machine.leg_length
        return replace(
            self.shape, crouch=float(np.clip(-p[:, 2].mean(), 0.02, 0.5 * length)), front=float(shift[front, 0].mean()),
            hind=float(shift[~front, 0].mean()), spread=float(np.where(left, shift[:, 1], -shift[:, 1]).mean()),
            nose=float(-tilt[:, 1].mean() * wheelbase), sway=float(2 * np.abs(sway)),
            sway_phase=float(((-np.angle(sway) - np.pi / 2) / (2 * np.pi)) % 1.0), lead=1.0)


class _Foot:
    """Vector (3,) [m] from where a foot should be to where it is, a function of the base's place and tilt, the leg's angles and
    the placement."""

    def __init__(self, leg: Leg, target: Array) -> None:
        self.leg, self.target = leg, target

    def __call__(self, x: Array) -> Array:
        value = ExtractValue(x).flatten() if x.dtype == object else np.asarray(x)
        k = len(value) - 8
        p, tilt, q, place = value[:3], value[3:6], value[6:6 + k], value[6 + k:]
        r = self.leg.place(q[None])[0]
        out = p + r + np.cross(tilt, r) - self.target - np.array([*place, 0.0])
        if x.dtype != object:
            return np.asarray(out)
        turned = np.eye(3) + _cross(tilt)
        J = np.hstack([np.eye(3), -_cross(r), turned @ self.leg.jacobian(q[None])[0], -np.eye(3)[:, :2]])
        return _with_gradient(out, J, x)


class _Turning:
    """Change of angular momentum less the integrated moments of the forces over an interval (3,) [N m s]."""

    def __init__(self, feet: Array, inertia: Array, dt: float, com: Array) -> None:
        self.feet, self.inertia, self.dt, self.com = feet, inertia, dt, com

    def __call__(self, x: Array) -> Array:
        value = ExtractValue(x).flatten() if x.dtype == object else np.asarray(x)
        F = len(self.feet)
        p, w, after = value[:3], value[3:6], value[6:9]
        f, place = value[9:9 + 3 * F].reshape(F, 3), value[9 + 3 * F:].reshape(F, 2)
        arms = self.feet + np.column_stack([place, np.zeros(F)]) - p - self.com
        out = self.inertia @ (after - w) - self.dt * np.cross(arms, f).sum(axis=0)
        if x.dtype != object:
            return np.asarray(out)
        by_arm = [self.dt * _cross(fi) for fi in f]
        J = np.hstack([-sum(by_arm), -self.inertia, self.inertia, *[-self.dt * _cross(a) for a in arms],
                       *[b[:, :2] for b in by_arm]])
        return _with_gradient(out, J, x)


def _with_gradient(value: Array, J: Array, x: Array) -> Array:
    gradient = J @ ExtractGradient(x)
    return np.array([AutoDiffXd(v, g) for v, g in zip(value, gradient)])


def _cross(a: Array) -> Array:
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def _com(machine: GaitMachine) -> Array:
    """Centre of mass in neutral (3,) [m], in the base link's frame."""
    k = machine.model.kinematics
    poses = k.forward(np.zeros((1, len(k.joints))))
    return np.asarray(sum(k.masses[link] * (p[0] + R[0] @ k.centers[link]) for link, (p, R) in poses.items()) / k.mass)


def _inertia(machine: GaitMachine) -> Array:
    """About the centre of mass in neutral (3, 3) [kg m^2], of links as points: leg links are far from it and their own inertias
    small in comparison; the base link's own is a third of the missing part."""
    k, com = machine.model.kinematics, _com(machine)
    poses = k.forward(np.zeros((1, len(k.joints))))
    out = np.zeros((3, 3))
    for link, (p, R) in poses.items():
        d = p[0] + R[0] @ k.centers[link] - com
        out += k.masses[link] * (d @ d * np.eye(3) - np.outer(d, d))
    return out
