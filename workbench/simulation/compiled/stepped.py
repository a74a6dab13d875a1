"""A run of the compiled station advanced piece by piece, for a controller that decides while the robot walks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench.effects.apply import played
from workbench.motion.commands import Commands
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation.compiled.arrays import Log, State, work_for
from workbench.simulation.compiled.schedule import rows_of, schedule_of, whole_steps
from workbench.simulation.compiled.station import CompiledJob
from workbench.simulation.config import SimulationConfig
from workbench.simulation.job import Job
from workbench.simulation.rollout import BaseState
from workbench.simulation.stepped import followed


class CompiledSteppedRun:
    """As `Simulation.stepped`, from rest in neutral, at the compiled station's speed. Time 0 is where it starts.

    NotCoveredError, from the constructor and from `advance`, where the station does not know the physics; the run has ended then.
    """

    def __init__(self, model: RobotModel, config: SimulationConfig) -> None:
        self._job = CompiledJob(Job(model, config, duration=config.logged_every))
        self.model, self.config, self.time = model, self._job.config, 0.0
        self._work = work_for(self._job.machine.tree, self._job.machine.servos, self._job.machine.shapes)
        self._state: State = self._job.at_rest(self._work)
        self._sent: Commands | None = None
        self._played: Commands | None = None
        self._pieces: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def send(self, commands: Commands) -> None:
        """Commands whose time 0 is now; those sent before that were due later are withdrawn."""
        self._sent = followed(self._sent, commands.reordered(self.model.joints), self.time)
        self._played = played(self._sent, self.model)

    def advance(self, seconds: float) -> None:
        """Advances the run by `seconds`, rounded to whole steps of the log."""
        end = whole_steps(self.config, self.time + seconds)
        schedule = schedule_of(self.config, self._due(end), 0.0, end - self.time, self.time, None)
        log = self._log(rows_of(self.config, end - self.time))
        self._job.play(schedule, self._state, log, self._work)
        begin = 1 if self._pieces else 0  # a piece begins with the row with which the one before it ended
        self._pieces.append((log.q[begin:], log.v[begin:], log.base[begin:]))
        self.time = end

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
