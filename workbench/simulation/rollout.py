"""Runs of a station: commands or trajectories in, a Take out. One station serves many runs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context
from pydrake.trajectories import PiecewisePolynomial

from workbench.effects.apply import apply_to_commands, physics_of
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.motion.smoothing import interpolate
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.servo.bank import servo_joints
from workbench.servo.system import ServoBank
from workbench.simulation.config import SimulationConfig
from workbench.simulation.contact import lowest_point
from workbench.simulation.forces import FootForces
from workbench.simulation.gantry import gantry_coordinates
from workbench.simulation.logs import RunLogs
from workbench.simulation.playback import bridged_base, play_back
from workbench.simulation.reference import linear_trajectory, reference_columns
from workbench.simulation.steady import BaseSetter, BaseStates
from workbench.simulation.structure import Structure
from workbench.types import Array

if TYPE_CHECKING:
    from workbench.simulation.stepped import SteppedRun


class BaseState(NamedTuple):
    """A floating base in the world: p_WB (3,) [m], quat_WB (4,) wxyz, angular velocity w_WB (3,) [rad/s] and velocity of its
    origin v_WB (3,) [m/s], all in W."""

    p_WB: Array
    quat_WB: Array
    w_WB: Array
    v_WB: Array


class Start(NamedTuple):
    """State of the robot at the first command: angles q and velocities v (n,) [rad, rad/s] in the model's order of joints.

    logged: the servos' own, as their sensors measure them (a log's), else the links'. base: where a free base is and how it
    moves. reference: (n,) [rad] where the servos' ramps are; None: `first_reference`."""

    q: Array
    v: Array
    logged: bool = False
    base: BaseState | None = None
    reference: Array | None = None


def first_reference(commands: Commands, servos: Array, zero: Array) -> Array:
    """Ramps (n,) [rad] when the first command reaches servos at `servos` [rad]: at a goal without a moving speed, which may have
    been sent long before; else at the servo's angle, from which the ramp starts."""
    return np.asarray(np.where(commands.speeds[0] > 0, servos, commands.goals[0] + zero))


class Simulation:
    """One robot in one configuration, built once as a Drake diagram; every run starts from the same settled neutral pose.
    InputError for a robot, an effect or a configuration that cannot be simulated."""

    def __init__(self, model: RobotModel, config: SimulationConfig | None = None) -> None:
        from workbench.simulation.station import MakeStation

        self.model = model
        self.config = (config or SimulationConfig()).of(model)
        self.diagram = MakeStation(model, self.config)
        self.plant = self.diagram.plant()
        self.context: Context = self.diagram.CreateDefaultContext()
        self.simulator = Simulator(self.diagram, self.context)
        if self.config.time_step == 0:
            ApplySimulatorConfig(SimulatorConfig(integration_scheme=self.config.integrator, accuracy=self.config.accuracy,
                                                 max_step_size=0.01), self.simulator)
        self._plant_context = self.diagram.GetMutableSubsystemContext(self.plant, self.context)
        self._joints = servo_joints(self.plant, model)
        physics = physics_of(model)
        self._zero = physics.zero
        self._structure = Structure(model, physics) if physics.stages or physics.moved else None
        self._logs = RunLogs(self.diagram, self.context, model, self.config, physics.law)
        self._base = self.plant.GetBodyByName(model.base)
        self._foot_forces = FootForces(self.plant, self.diagram.scene_graph(), model)
        self._rest: tuple[bytes | None, Context] | None = None
        self._runs = 0

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints (n,), in the order of the columns of commands and takes."""
        return self.model.joints

    def run(self, commands: Commands | None = None, duration: float | None = None, lead: float = 0.1, *,
            trajectory: tuple[Array, Array] | None = None, path: Take | None = None,
            start: Start | tuple[Array, Array] | None = None, elapsed: float = 0.0, steadied: BaseStates | None = None,
            name: str = "simulation") -> Take:
        """Plays `commands`, or follows `trajectory` (times (K,) [s], angles (K, n) [rad] in self.joints' order; drive "ideal";
        default: smoothly through the commands' poses).

        duration [s] after the first command (default: to the end). lead [s] of rest before it. path: take whose base moves
        this one (base "path"). start: angles and velocities (n,) [rad, rad/s] in self.joints' order at the first command, in
        place of rest in neutral: the links', or the servos' own by Start, which also gives a free base its pose; no lead then.
        elapsed [s]: how long the robot has played before these commands, for effects that grow with it. steadied: states to which
        a free base is put back on its way. name: of the take.

        Returns a Take with time 0 at the first command, in SI, radians and the world's axes (x forward, y left, z up).
        InputError where neither commands, trajectory nor duration are given, `path` is missing where the base needs it, or
        `start` lacks a free base's pose; for drive "playback", which has no dynamics.
        """
        if self.config.drive == "playback":
            raise InputError(None, "drive 'playback' shows a take; call play_back")
        sent = commands
        if commands is not None:
            commands = apply_to_commands(commands.reordered(self.joints), self.model)
        if duration is None:
            if trajectory is not None:
                duration = float(trajectory[0][-1])
            elif commands is not None:
                duration = commands.end
            else:
                raise InputError(None, "expected commands, a trajectory or a duration")
        lead = 0.0 if start is not None else self._whole_steps(lead)
        base_path = self._base_path_to_follow(path, lead, duration)
        self._rest_in_neutral(None if base_path is None else base_path[1][0])
        if base_path is not None:
            self.diagram.GetSubsystemByName("base_path").UpdateTrajectory(self._ahead(*base_path))
        if start is not None:
            self._set_start(Start(*start), commands)
        self._set_first_command(lead - elapsed)
        self._follow(commands, trajectory, lead, duration)
        setter = None if steadied is None else BaseSetter(
            steadied, self.plant, self.diagram.scene_graph(), self._base, self._plant_context)
        self.simulator.Initialize()
        sampled, forces = self._advance(commands, lead, 0.0, lead + duration, setter)
        return self._take(name, lead, sent, commands, sampled, forces, setter)

    def stepped(self, start: Start | None = None) -> SteppedRun:
        """A run that accepts further commands while it advances, from rest in neutral or from `start`. Only one at a time: a new
        run of this simulation ends it. InputError unless the drive is "servo" and the base free or fixed."""
        from workbench.simulation.stepped import SteppedRun

        return SteppedRun(self, start)

    def _take(self, name: str, lead: float, sent: Commands | None, commands: Commands | None, sampled: Array,
              forces: dict[str, Array], setter: BaseSetter | None = None) -> Take:
        """A take from the logs. lead: time of the first command [s]; sent: commands recorded in the take, `commands` those that
        reached the servos."""
        t, state = self._logs.read("state")
        time = t - lead
        q, v = self._logs.joints(state)
        p_WB, quat_WB = self._logs.base_path(state)
        if setter is not None:
            p_WB, quat_WB = setter.in_one_piece(t, p_WB, quat_WB)
        contact = {f: np.column_stack([np.interp(t, sampled, c) for c in xyz.T]) for f, xyz in forces.items() if len(sampled)}
        take = Take(name=name, source="simulation", time=time, joints=self.joints, q=q, starts_at=0.0, base=self.config.base, v=v,
                    p_WB=p_WB, quat_WB=quat_WB, torque=self._logs.torque(time, q, v, commands), contact=contact,
                    commands=sent)
        return self._as_built(take, state)

    def play_back(self, take: Take) -> Take:
        """The thesis's animation: the model posed at each frame of a take, without dynamics; unseen joints stay in
        neutral, gaps are bridged. Returns a Take on the same clock."""
        return play_back(self.diagram, self.context, self.model, self.config.base, take)

    def _begin_stepped(self, start: Start | None) -> int:
        """For SteppedRun: puts the robot where its run starts; returns what `_is_stepping` knows it by."""
        self._rest_in_neutral(None)
        if start is not None:
            self._set_start(start, None)
        self._set_first_command(0.0)
        self.simulator.Initialize()
        return self._runs

    def _is_stepping(self, token: int) -> bool:
        """Whether no other run has begun since `_begin_stepped` gave this token."""
        return token == self._runs

    def _present_state(self) -> Start:
        """The state of joints, base and ramps now."""
        q = np.array([j.get_angle(self._plant_context) for j in self._joints])
        v = np.array([j.get_angular_rate(self._plant_context) for j in self._joints])
        base = None
        if self.config.base == "free":
            X_WB = self.plant.GetFreeBodyPose(self._plant_context, self._base)
            V_WB = self._base.EvalSpatialVelocityInWorld(self._plant_context)
            base = BaseState(*(np.array(x) for x in (X_WB.translation(), X_WB.rotation().ToQuaternion().wxyz(),
                                                   V_WB.rotational(), V_WB.translational())))
        bank, context = self._bank()
        reference = np.array(bank.GetOutputPort("reference").Eval(context))
        return Start(q - self._zero, v, logged=True, base=base, reference=reference)

    def _as_built(self, take: Take, state: Array) -> Take:
        """The take with the motion of the links, where they do not follow the servos rigidly."""
        if self._zero.any():
            take = replace(take, servo_q=take.q - self._zero)
        if self._structure is None:
            return take
        assert take.p_WB is not None
        assert take.quat_WB is not None
        q, v = self._logs.joints_named(self._structure.joints, state)
        seen = self._structure.seen(q, v)
        return replace(take, q=seen.q, v=seen.v, off_axis=seen.off_axis, servo_q=take.q - self._zero,
                       links=self._structure.links(q, take.p_WB, take.quat_WB))

    def _whole_steps(self, seconds: float) -> float:
        return round(seconds / self.config.logged_every) * self.config.logged_every

    def _on_grid(self, t: float) -> float:
        """t, or the instant of the log that it misses by rounding alone: Drake would take a step of 1e-17 s between the two."""
        nearest = self._whole_steps(t)
        return nearest if abs(nearest - t) < 1e-9 else t

    def _base_path_to_follow(self, path: Take | None, lead: float, duration: float) -> tuple[Array, Array] | None:
        """Times (K,) [s] on the run's clock and gantry coordinates (K, 6) of the path, from the run's first instant on."""
        if self.config.base != "path":
            return None
        if path is None:
            raise InputError(None, "base 'path' needs a take to follow")
        times = path.since_start + lead
        rows = gantry_coordinates(*bridged_base(path))
        start = np.array([np.interp(0.0, times, c) for c in rows.T])
        inside = (times > 0) & (times < lead + duration + 0.1)
        return np.concatenate([[0.0], times[inside]]), np.vstack([start, rows[inside]])

    def _rest_in_neutral(self, gantry: Array | None) -> None:
        """Puts the context at the state in which the robot stands still in neutral, at time 0; found once, kept for the next
        run."""
        key = None if gantry is None else gantry.tobytes()
        if self._rest is None or self._rest[0] != key:
            self.context.SetTimeStateAndParametersFrom(self.diagram.CreateDefaultContext())
            for joint, angle in zip(self._joints, self._zero):  # not from elsewhere: friction would hold it short
                joint.set_angle(self._plant_context, float(angle))
            self._place_base(gantry)
            self._hold_neutral()
            self._set_first_command(np.inf)
            self.simulator.Initialize()
            self.simulator.AdvanceTo(self._whole_steps(self.config.settle))
            self._centre_base()
            self._rest = key, self.context.Clone()
        self._runs += 1
        self.context.SetTimeStateAndParametersFrom(self._rest[1])
        self.context.SetTime(0.0)
        self._hold_neutral()  # the inputs' values are no part of what was restored
        self._logs.clear()

    def _place_base(self, gantry: Array | None) -> None:
        if gantry is not None:
            self.plant.SetPositions(self._plant_context, self.plant.GetModelInstanceByName("gantry"), gantry)
            hold = linear_trajectory(np.array([0.0, 1.0]), np.vstack([gantry, gantry]))
            self.diagram.GetSubsystemByName("base_path").UpdateTrajectory(hold)
        elif self.config.base == "free":
            k = self._structure.kinematics if self._structure else self.model.kinematics
            poses = {link: RigidTransform(RotationMatrix(R[0]), p[0])
                     for link, (p, R) in k.forward(np.atleast_2d(self._zero), self.joints).items()}
            height = -lowest_point(self.plant, self.diagram.scene_graph(), self._base.model_instance(), poses)
            self.plant.SetFloatingBaseBodyPoseInWorldFrame(self._plant_context, self._base, RigidTransform([0, 0, height]))

    def _hold_neutral(self) -> None:
        neutral = np.zeros(len(self.joints))
        if self.config.drive == "servo":
            self._command(neutral, neutral, neutral + 1)
        else:
            self._update_reference(np.array([0.0, 1.0]), np.zeros((2, len(self.joints))))

    def _set_first_command(self, time: float) -> None:
        if self.config.drive == "servo":
            bank, context = self._bank()
            bank.SetFirstCommand(context, time)

    def _bank(self) -> tuple[ServoBank, Context]:
        bank = self.diagram.GetSubsystemByName("servo_bank")
        return bank, self.diagram.GetMutableSubsystemContext(bank, self.context)

    def _set_start(self, start: Start, commands: Commands | None) -> None:
        """Starts from a given state, with the ramp of each servo where it says, or at its first goal."""
        if self.config.base == "free" and start.base is None:
            raise InputError(None, "a run that starts from given joint angles needs a held base, 'fixed' or 'path', or the pose "
                             "and velocity of the free one")
        servos = np.asarray(start.q, dtype=float)
        if start.logged:
            servos = servos + self._zero
        elif self._structure is not None:  # play and springs stay as they rested
            standing = np.atleast_2d(self.plant.GetPositionsAndVelocities(self._plant_context))
            servos = self._structure.servo_angles(servos, self._logs.joints_named(self._structure.joints, standing)[0][0])
        for joint, angle, rate in zip(self._joints, servos, start.v):
            joint.set_angle(self._plant_context, float(angle))
            joint.set_angular_rate(self._plant_context, float(rate))
        if self.config.base == "free" and start.base is not None:
            self._put_base(start.base)
        if self.config.drive == "servo":
            reference = start.reference
            if reference is None:
                reference = servos if commands is None else first_reference(commands, servos, self._zero)
            bank, context = self._bank()
            bank.SetReference(context, np.asarray(reference, dtype=float))
            if start.reference is not None:  # held until the first command
                self._command(start.reference - self._zero, np.zeros(len(self.joints)), np.ones(len(self.joints)))

    def _put_base(self, base: BaseState) -> None:
        from scipy.spatial.transform import Rotation  # slow to import, and not needed to read a log

        R_WB = Rotation.from_quat(np.asarray(base.quat_WB, dtype=float), scalar_first=True).as_matrix()
        self.plant.SetFloatingBaseBodyPoseInWorldFrame(
            self._plant_context, self._base, RigidTransform(RotationMatrix(R_WB), np.asarray(base.p_WB, dtype=float)))
        self.plant.SetFreeBodySpatialVelocity(
            context=self._plant_context, body=self._base, V_JpJc=SpatialVelocity(np.asarray(base.w_WB), np.asarray(base.v_WB)))

    def _centre_base(self) -> None:
        """Removes from the state the millimetres and the heading that settling added; the floor is the same everywhere."""
        if self.config.base != "free":
            return
        X_WB = self.plant.GetFreeBodyPose(self._plant_context, self._base)
        rpy = RollPitchYaw(X_WB.rotation())
        centred = RigidTransform(RollPitchYaw(rpy.roll_angle(), rpy.pitch_angle(), 0.0), [0, 0, X_WB.translation()[2]])
        self.plant.SetFloatingBaseBodyPoseInWorldFrame(self._plant_context, self._base, centred)

    def _command(self, goal: Array, speed: Array, enabled: Array) -> None:
        for port, value in (("goal_position", goal + self._zero), ("moving_speed", speed), ("torque_enable", enabled)):
            self.diagram.GetInputPort(port).FixValue(self.context, value)

    def _update_reference(self, times: Array, rows: Array) -> None:
        columns = reference_columns(self.plant, self.model)
        self.diagram.GetSubsystemByName("joint_reference").UpdateTrajectory(self._ahead(times, (rows + self._zero)[:, columns]))

    def _ahead(self, times: Array, rows: Array) -> PiecewisePolynomial:
        """A reference one step early: the implicit controllers of a discrete plant act on the state at the end of the step."""
        return linear_trajectory(np.asarray(times) - self.config.time_step, rows)

    def _follow(self, commands: Commands | None, trajectory: tuple[Array, Array] | None, lead: float, duration: float) -> None:
        """Hands a trajectory to the drives that follow one; a trajectory that does not start in neutral is approached during
        the lead."""
        if self.config.drive == "servo":
            if trajectory is not None:
                raise InputError(None, "drive 'servo' plays commands; a trajectory needs drive 'ideal'")
            return
        if trajectory is None:
            if commands is None:
                return
            if self.config.drive == "ideal":
                trajectory = smooth_through_poses(commands, self.config.logged_every)
            else:
                times = np.arange(0.0, duration + 1e-9, self.config.logged_every)
                trajectory = times, commands.reference(times)
        times, rows = np.asarray(trajectory[0], dtype=float) - trajectory[0][0] + lead, np.asarray(trajectory[1], dtype=float)
        if lead > 0:
            s = np.linspace(0, 1, 20)[:-1]
            times, rows = np.concatenate([s * lead, times]), np.vstack([np.outer(s * s * (3 - 2 * s), rows[0]), rows])
        self._update_reference(times, rows)

    def _advance(self, commands: Commands | None, lead: float, begin: float, end: float, setter: BaseSetter | None = None
                 ) -> tuple[Array, dict[str, Array]]:
        """Runs from `begin` to `end` [s], changing commands and the base's state at their times from `begin` on, those at `end`
        not yet; returns the times and values of foot forces, that at `end` only if it is on a sample."""
        puts = {} if setter is None else {self._whole_steps(lead + t): k for k, t in enumerate(setter.states.times.tolist())}
        commanded = commands is not None and self.config.drive == "servo"
        times = commands.times.tolist() if commands is not None and commanded else []
        changes = {self._on_grid(lead + t): k for k, t in enumerate(times)}
        every = max(1, round(self.config.contact_period / self.config.logged_every))  # on a step: Drake solves each step once
        steps = np.arange(0, round(end / self.config.logged_every) + 1, every)
        sampling = self.config.contact_period > 0 and self.config.base == "free" and not self.config.uses_cenic
        samples = steps * self.config.logged_every if sampling else np.empty(0)
        samples = samples[samples >= begin - 1e-9] if begin > 0 else samples
        forces: list[Array] = []
        sampled: list[float] = []
        due = set(samples.tolist())
        for t in sorted(due | {c for c in (*changes, *puts) if begin <= c < end} | {self._on_grid(end)}):
            if t > self.context.get_time():  # else a command at once would come a step late
                self.simulator.AdvanceTo(t)
            if setter is not None and t in puts:
                setter.put(puts[t], t)
            if t in due:
                forces.append(self._foot_forces(self._plant_context))
                sampled.append(t)
            if t in changes:
                assert commands is not None
                self._command_at(t, commands, changes[t])
        stacked = np.array(forces).reshape(len(forces), len(self._foot_forces.feet), 3)
        return np.array(sampled), {foot: stacked[:, i] for i, foot in enumerate(self._foot_forces.feet)}

    def _command_at(self, t: float, commands: Commands, k: int) -> None:
        """Sends command k at time t [s]; one that comes between two steps of a discrete plant ramps from then on, not from the
        next step on."""
        step = self.config.time_step
        late = step * np.ceil(t / step - 1e-6) - t if step and self.config.drive == "servo" else 0.0
        bank, context = self._bank()
        if late > 1e-9:
            bank.ShiftRamp(context, -late)
        self._command(commands.goals[k], commands.speeds[k], commands.enabled[k].astype(float))
        if late > 1e-9:
            bank.ShiftRamp(context, late)


def smooth_through_poses(commands: Commands, step: float) -> tuple[Array, Array]:
    """The motion behind a table: cubics from neutral through each goal at the end of its dwell, at rest at both ends.

    Times (K,) [s] every `step`, angles (K, n) [rad]."""
    arrivals = np.concatenate([[0.0], commands.times[1:], [commands.end]])
    rows = np.vstack([np.zeros(len(commands.joints)), commands.goals])
    smooth = interpolate(arrivals, commands.joints, rows, step)
    return smooth.time, smooth.q
