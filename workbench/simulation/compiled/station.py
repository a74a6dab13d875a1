"""Jobs played by the compiled station: the same take as `Simulation.run` gives, or the reason why not."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from threading import Lock, get_ident
from typing import TypeVar

import numpy as np
from pydrake.math import RotationMatrix
from scipy.spatial.transform import Rotation

from workbench.effects.apply import Hearing, Physics, physics_of
from workbench.motion.commands import Commands
from workbench.recording.take import Take
from workbench.robot import puppy_model
from workbench.simulation.compiled.arrays import Log, Schedule, State, Work, work_for
from workbench.simulation.compiled.kernel import is_compiled
from workbench.simulation.compiled.machine import Machine, machine_of
from workbench.simulation.compiled.run import DONE, TOUCHED, run, stand
from workbench.simulation.compiled.schedule import rows_of, schedule_of, settling, whole_steps
from workbench.simulation.compiled.structures import tables_of
from workbench.simulation.compiled.tables import NotCoveredError, Tables
from workbench.simulation.compiled.turns import compile_turns
from workbench.simulation.config import SimulationConfig
from workbench.simulation.job import Job
from workbench.simulation.rollout import Start, first_reference
from workbench.simulation.structure import Structure

T = TypeVar("T")
ENDED = {TOUCHED: "shapes touch that are neither a foot on the floor nor a sphere on another link"}
"""Why a run was given up, by how it ended; any other way, Drake shall say."""
_first = Lock()
_ran: set[object] = set()


def covers(job: Job) -> str | None:
    """Why the compiled station cannot play this job; None where it can."""
    try:
        CompiledJob(job)
    except NotCoveredError as e:
        return str(e)
    return None


def run_compiled(job: Job) -> Take:
    """The take of a job; NotCoveredError says why it has to be Drake's."""
    return announced(CompiledJob(job).take)


def announced(play: Callable[[], T], kernel: object = run) -> T:
    """What `play` returns; before the first run of this kernel on a machine, says that the station is being compiled."""
    if is_compiled(kernel) or kernel in _ran:
        return play()
    with _first:  # of several threads one compiles and says so, the others wait for it
        if not (is_compiled(kernel) or kernel in _ran):
            logging.getLogger(__name__).warning("compiling the station, once for this version and machine (a minute) ...")
        try:
            return play()
        finally:
            _ran.add(kernel)


def compile_station() -> None:
    """Compiles the kernel of one robot and the passes over its log, unless this machine keeps them for this checkout: plays a
    millisecond."""
    compile_turns()
    run_compiled(Job(puppy_model(), SimulationConfig(base="fixed", settle=1e-3), duration=1e-3, lead=0.0))


def _check(job: Job) -> None:
    c = job.config
    known = {"drive": "servo", "contact": "point", "approximation": "lagged"}
    for name, value in known.items():
        if getattr(c, name) != value:
            raise NotCoveredError(f"{name} '{getattr(c, name)}'")
    if c.boxes:
        raise NotCoveredError("boxes on the floor")
    if c.time_step == 0:
        raise NotCoveredError("a continuous plant")
    if c.base not in ("free", "fixed"):
        raise NotCoveredError(f"base '{c.base}'")
    if job.trajectory is not None or job.path is not None:
        raise NotCoveredError("a trajectory or a path to follow")
    if abs(c.logged_every / c.time_step - round(c.logged_every / c.time_step)) > 1e-9:
        raise NotCoveredError("a log between the steps")
    if job.times is None and job.commands is not None and not job.commands.enabled.all():
        raise NotCoveredError("torques of servos that are switched off")
    if job.start is not None and c.base == "free" and Start(*job.start).base is None:
        raise NotCoveredError("a free base whose pose is not given")  # an error, which the station words


@dataclass
class _Plan:
    """commands: as the servos hear them; heard_as_sent: whether that is as they were sent."""

    commands: Commands | None
    lead: float
    duration: float
    heard_as_sent: bool


class CompiledJob:
    """A job with its arrays; made, it is covered, but for what only the run can tell. apart: links that touch end it, whatever
    shapes they touch with."""

    def __init__(self, job: Job, apart: bool = False) -> None:
        _check(job)
        self.job, self.model, self.config = job, job.model, job.config
        self.free = self.config.base == "free"
        self.model.check_base(floating=self.free)
        self.physics: Physics = physics_of(self.model)
        self.tables: Tables = tables_of(self.model, self.physics.build, self.free)
        self.machine: Machine = machine_of(self.model, self.physics, self.tables, self.free, self.config.time_step, apart)
        self._settled: list[State] = []  # of this robot: at most one, which jobs made by `of` share
        self._work: dict[int, Work] = {}  # likewise, by thread: jobs made by `of` are played at the same time
        self.hearing = Hearing.of(self.model) if self.physics.retimed else None
        self.plan = self._plan()

    def _plan(self) -> _Plan:
        job = self.job
        sent = None if job.commands is None else job.commands.reordered(self.model.joints)
        until = math.inf if job.duration is None else job.duration
        commands = self.hearing.heard(sent, until) if sent is not None and self.hearing is not None else sent
        duration = job.duration if job.duration is not None else commands.end if commands is not None else None
        if duration is None:
            raise ValueError("expected commands, a trajectory or a duration")
        lead = 0.0 if job.start is not None else whole_steps(self.config, job.lead)
        if commands is not None and len(commands.times) and lead + commands.times[0] < 0.0:
            raise NotCoveredError("a command before the run begins")
        if job.steadied is not None and not self.free:
            raise NotCoveredError("a held base that is put somewhere")
        return _Plan(commands, lead, duration, commands is sent)

    def of(self, job: Job) -> CompiledJob:
        """Another job of the same model in the same configuration."""
        _check(job)
        other = copy(self)
        other.job = job
        other.plan = other._plan()
        return other

    def take(self, as_seen: bool = True) -> Take:
        """Settles, plays, and reads the log; NotCoveredError where something touches in a way that is Drake's. as_seen: with
        angles as cameras see them where something is between servos and links; else servos' angles and velocities stand."""
        return self._read(self.log(self.schedule()), as_seen)

    def schedule(self) -> Schedule:
        """What happens when in this job."""
        plan = self.plan
        return schedule_of(self.config, plan.commands, plan.lead, plan.duration, self.job.elapsed, self.job.steadied)

    def log(self, schedule: Schedule) -> Log:
        """Settles and plays; NotCoveredError as in `take`."""
        thread = get_ident()
        if thread not in self._work:
            self._work[thread] = work_for(self.machine.tree, self.machine.servos, self.machine.shapes)
        work = self._work[thread]
        if not self.is_settled:
            self.settle(self.at_rest(work))
        log = self._log(self.rows)
        self.play(schedule, self.begin(), log, work)
        return log

    @property
    def rows(self) -> int:
        """Of the log."""
        return rows_of(self.config, self.plan.lead + self.plan.duration)

    @property
    def is_settled(self) -> bool:
        """Whether the robot's rest is known, from this job or another of the same model."""
        return bool(self._settled)

    def settle(self, rest: State) -> None:
        """Makes this the robot's rest."""
        self._settled.append(rest)

    def begin(self) -> State:
        """The state of a robot that has settled before the job's first step."""
        state = State(*(a.copy() for a in self._settled[0]))  # type: ignore[arg-type]
        if self.job.start is not None:
            self._set_start(Start(*self.job.start), state)
        return state

    def at_rest(self, work: Work) -> State:
        """The robot at rest in neutral, before the first command."""
        state = self.neutral()
        stand(*self.machine, state, work)
        self.play(settling(self.config, len(self.model.joints)), state, self._log(0), work)
        if self.free:
            _centre(state)
        return state

    def play(self, schedule: Schedule, state: State, log: Log, work: Work) -> None:
        """Plays a schedule from `state` on, which it changes, into `log`; NotCoveredError as in `take`."""
        how = run(*self.machine, schedule, state, log, work)
        if how != DONE:
            raise NotCoveredError(ENDED.get(how, "the step's problem was not solved"))

    def _log(self, rows: int) -> Log:
        whole = rows if self.job.times is None else 0
        n, m, s = len(self.tables.joints), len(self.model.joints), len(self.machine.shapes.body)
        forces = whole if self.free and self.config.contact_period > 0 else 0
        return Log(q=np.empty((rows, n)), v=np.empty((rows, n)), base=np.empty((rows, 7)), torque=np.empty((whole, m)),
                   force=np.empty((forces, s, 3)))

    def neutral(self) -> State:
        """All joints at zero, before anything moves."""
        n, m, nv = len(self.tables.joints), len(self.model.joints), len(self.tables.tree.path)
        return State(base=np.array([1.0, 0, 0, 0, 0, 0, 0]), q=np.zeros(n), v=np.zeros(nv), reference=np.zeros(m),
                     goal=self.physics.zero.copy(), lagging=np.zeros(m), reach=np.full(m, np.inf), on=np.ones(m, dtype=bool),
                     memory=np.zeros((4, m)), stepped=np.zeros(1))

    def _set_start(self, start: Start, state: State) -> None:
        """As `Simulation` starts from a given state."""
        servos = np.asarray(start.q, dtype=float)
        if start.logged:
            servos = servos + self.physics.zero
        elif (structure := self._structure()) is not None:
            servos = structure.servo_angles(servos, state.q[[self.tables.joints.index(j) for j in structure.joints]])
        joint = self.machine.servos.joint
        state.q[joint], state.v[(6 if self.free else 0) + joint] = servos, start.v
        if self.free and start.base is not None:
            state.base[:4] = start.base.quat_WB / np.linalg.norm(start.base.quat_WB)
            state.base[4:], state.v[:3], state.v[3:6] = start.base.p_WB, start.base.w_WB, start.base.v_WB
        commands = self.plan.commands
        state.reference[:] = servos if commands is None else first_reference(commands, servos, self.physics.zero)
        if start.reference is not None:
            state.reference[:] = state.goal[:] = start.reference
        state.lagging[:] = state.reference
        state.memory[:], state.stepped[:] = 0.0, 0.0

    @property
    def between(self) -> bool:
        """Whether joints lie between servos and links, or links have other lengths than in the model's file."""
        return bool(self.physics.stages) or self.physics.moved

    def _structure(self) -> Structure | None:
        if not self.between:
            return None
        key = str(self.physics.stages)
        if key not in self.tables.derived:
            self.tables.derived[key] = Structure(self.model, self.physics)
        return self.tables.derived[key]  # type: ignore[return-value]

    def _read(self, log: Log, as_seen: bool) -> Take:
        job, joint, config = self.job, self.machine.servos.joint, self.config
        time = np.arange(len(log.q), dtype=float) * config.logged_every - self.plan.lead
        alike = np.array_equal(joint, np.arange(log.q.shape[1]))  # then there is nothing to copy
        q, v = (log.q, log.v) if alike else (log.q[:, joint], log.v[:, joint])
        p_WB, quat_WB = log.base[:, 4:], log.base[:, :4]
        if not self.free:
            X = self.tables.X_WBase
            p_WB = np.broadcast_to(X.translation(), (len(time), 3))
            quat_WB = np.broadcast_to(RotationMatrix(X.rotation()).ToQuaternion().wxyz(), (len(time), 4))
        take = Take(name=job.name, source="simulation", time=time, joints=self.model.joints, q=q, starts_at=0.0,
                    base=config.base, v=v, p_WB=p_WB, quat_WB=quat_WB,
                    torque=log.torque if len(log.torque) else None, contact=self._contact(log, time), commands=job.commands)
        take = self._as_built(take, log) if as_seen else take
        del log  # of a recording of 1,000 s a hundred MB, more than half of which a held robot's take does not need
        return take if job.times is None else take.resampled(job.times)

    def _contact(self, log: Log, time: np.ndarray) -> dict[str, np.ndarray]:
        """Forces on feet, sampled as often as the configuration says."""
        if not len(log.force):
            return {}
        every = max(1, round(self.config.contact_period / self.config.logged_every))
        links = np.array(self.tables.shapes.link)
        out = {}
        for link in dict.fromkeys(self.tables.shapes.link):
            force = log.force[::every, links == link].sum(axis=1)
            foot = self.model.kinematics.parent_joint[link] or link
            out[foot] = np.column_stack([np.interp(time, time[::every], c) for c in force.T])
        return out

    def _as_built(self, take: Take, log: Log) -> Take:
        if self.physics.zero.any():
            take = replace(take, servo_q=take.q - self.physics.zero)
        structure = self._structure()
        if structure is None:
            return take
        columns = [self.tables.joints.index(j) for j in structure.joints]
        seen = structure.seen(log.q[:, columns], log.v[:, columns])
        assert take.p_WB is not None
        assert take.quat_WB is not None
        return replace(take, q=seen.q, v=seen.v, off_axis=seen.off_axis, servo_q=take.q - self.physics.zero,
                       links=structure.links(log.q[:, columns], take.p_WB, take.quat_WB))


def _centre(state: State) -> None:
    """Takes the heading and the place that settling added out of a free base's pose, as `Simulation` does; velocities stay."""
    R = Rotation.from_quat(state.base[:4], scalar_first=True)
    yaw = R.as_euler("ZYX")[0]
    state.base[:4] = (Rotation.from_euler("z", -yaw) * R).as_quat(scalar_first=True)
    state.base[4:6] = 0.0
