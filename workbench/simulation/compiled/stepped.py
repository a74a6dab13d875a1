"""A run of the compiled station advanced piece by piece, for a controller that decides while the robot walks."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from workbench.effects.apply import apply_to_commands, resolve
from workbench.effects.base import Effect
from workbench.motion.commands import Commands
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation.compiled.arrays import Log, State, Work, work_for
from workbench.simulation.compiled.schedule import rows_of, schedule_of, whole_steps
from workbench.simulation.compiled.station import CompiledJob
from workbench.simulation.config import SimulationConfig
from workbench.simulation.job import Job
from workbench.simulation.rollout import BaseState
from workbench.simulation.stepped import switch_commands
from workbench.types import Array

LOOK_BACK = 2.0
"""How long a sent command can still reach the servos [s]: an effect delays by at most 0.5 s, and no servo by more."""


class CompiledSteppedRun:
    """As `Simulation.stepped`, from rest in neutral, at the compiled station's speed. Time 0 is where it starts.

    NotCoveredError, from the constructor and from `advance`, where the station does not know the physics; the run has ended then.
    """

    def __init__(self, model: RobotModel, config: SimulationConfig) -> None:
        self._job = CompiledJob(Job(model, config, duration=config.logged_every))
        self.model, self.config, self.time = model, self._job.config, 0.0
        self._work = self._room()
        self._state: State = self._job.at_rest(self._work)
        self._sent: Commands | None = None
        self._played: Commands | None = None
        self._pieces: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        retiming = [effect for effect, _, _ in resolve(model) if type(effect).commands is not Effect.commands]
        self._only_delayed = all(effect.like_a_late_start for effect in retiming)

    def branch(self) -> CompiledSteppedRun:
        """A second run that starts from the present state of this one. Each can be advanced in a thread of its own."""
        other = copy(self)
        other._state = State(*(a.copy() for a in self._state))  # type: ignore[arg-type]
        other._work, other._pieces = self._room(), list(self._pieces)
        return other

    def _room(self) -> Work:
        return work_for(self._job.machine.tree, self._job.machine.servos, self._job.machine.shapes)

    def send(self, commands: Commands) -> None:
        """Commands whose time 0 is now; those sent before that were due later are withdrawn."""
        self._sent = switch_commands(self._sent, commands.reordered(self.model.joints), self.time)
        self._played = apply_to_commands(self._recent(self._sent), self.model)

    def advance(self, seconds: float) -> None:
        """Advances the run by `seconds`, rounded to whole steps of the log."""
        end = whole_steps(self.config, self.time + seconds)
        schedule = schedule_of(self.config, self._due(end), 0.0, end - self.time, self.time, None)
        log = self._log(rows_of(self.config, end - self.time))
        self._job.play(schedule, self._state, log, self._work)
        begin = 1 if self._pieces else 0  # a piece begins with the row with which the one before it ended
        self._pieces.append((log.q[begin:], log.v[begin:], log.base[begin:]))
        self.time = end

    def _recent(self, sent: Commands) -> Commands:
        """Without those that no longer matter, where effects only delay: else each piece costs more than the one before."""
        old = int(np.searchsorted(sent.times, self.time - LOOK_BACK)) - 1
        if old < 1 or not self._only_delayed:
            return sent
        rows = {f: getattr(sent, f)[old:] for f in ("times", "goals", "speeds", "enabled", "poses")}
        return replace(sent, begun=True, **rows)

    def _log(self, rows: int) -> Log:
        n, m, shapes = len(self._job.tables.joints), len(self.model.joints), len(self._job.machine.shapes.body)
        return Log(q=np.empty((rows, n)), v=np.empty((rows, n)), base=np.empty((rows, 7)), torque=np.empty((0, m)),
                   force=np.empty((0, shapes, 3)))

    def _due(self, end: float) -> Commands | None:
        """The commands that reach the servos between now and `end` [s], on this piece's clock."""
        if self._played is None:
            return None
        times = self._played.times - self.time
        kept = (times >= -1e-9) & (times < end - self.time - 1e-9)
        rows = {f: getattr(self._played, f)[kept] for f in ("goals", "speeds", "enabled", "poses")}
        return replace(self._played, times=np.maximum(times[kept], 0.0), end=end - self.time, **rows)

    @property
    def base(self) -> BaseState | None:
        """Pose and velocity of the free base now; None of a held one."""
        s = self._state
        if self.config.base != "free":
            return None
        return BaseState(s.base[4:].copy(), s.base[:4] / np.linalg.norm(s.base[:4]), s.v[:3].copy(), s.v[3:6].copy())

    @property
    def servo_angles(self) -> Array:
        """Angles (n,) [rad] that the servos read now, by the model's joints."""
        return np.asarray(self._state.q[self._job.machine.servos.joint] - self._job.physics.zero)

    def take(self, name: str = "simulation") -> Take:
        """The take logged so far, from the start of the run: angles as the servos have them, no forces. RuntimeError before
        the first `advance`."""
        if not self._pieces:
            raise RuntimeError("nothing was simulated yet: call advance() before take()")
        q, v, base = (np.concatenate([p[k] for p in self._pieces]) for k in range(3))
        joint = self._job.machine.servos.joint
        time = np.asarray(np.arange(len(q)) * self.config.logged_every, float)
        return Take(name=name, source="simulation", time=time, joints=self.model.joints, q=q[:, joint], starts_at=0.0,
                    base=self.config.base, v=v[:, joint], p_WB=base[:, 4:], quat_WB=base[:, :4], torque=None, contact={},
                    commands=self._sent)
