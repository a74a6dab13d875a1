"""A run advanced piece by piece, for a controller or a learner."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from workbench.effects.apply import apply_to_commands
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.recording.take import Take
from workbench.types import Array

if TYPE_CHECKING:
    from workbench.simulation.rollout import BaseState, Simulation, Start


class SteppedRun:
    """One run of a simulation, advanced piece by piece. Time 0 is where it starts.

    Commands that are sent reach the servos as in one long run (delayed ones, if the model has a delay, in a later
    piece), so that the same commands in pieces or at once give the same take to the bit.
    """

    def __init__(self, simulation: Simulation, start: Start | None) -> None:
        if simulation.config.drive != "servo" or simulation.config.base == "path":
            raise InputError(None, "a stepped run needs drive 'servo' and a base that is free or fixed")
        self._simulation = simulation
        self._sent: Commands | None = None
        self._played: Commands | None = None
        self._sampled: list[Array] = []
        self._forces: list[dict[str, Array]] = []
        self._token = simulation._begin_stepped(start)
        self.time = 0.0

    def send(self, commands: Commands) -> None:
        """Commands whose time 0 is now; those sent before that were due later are withdrawn."""
        self._check_alive()
        self._sent = switch_commands(self._sent, commands.reordered(self._simulation.joints), self.time)
        self._played = apply_to_commands(self._sent, self._simulation.model)

    def advance(self, seconds: float) -> None:
        """Advances the run by `seconds`, rounded to whole steps of the log."""
        self._check_alive()
        end = self._simulation._whole_steps(self.time + seconds)
        sampled, forces = self._simulation._advance(self._played, 0.0, self.time, end)
        self._sampled.append(sampled)
        self._forces.append(forces)
        self.time = end

    @property
    def state(self) -> Start:
        """Present state of the robot, from which another run may start."""
        self._check_alive()
        return self._simulation._present_state()

    @property
    def base(self) -> BaseState | None:
        """Pose and velocity of the free base now; None of a held one."""
        return self.state.base

    def take(self, name: str = "simulation") -> Take:
        """The take logged so far, from the start of the run; RuntimeError before the first `advance`."""
        if not self._sampled:
            raise RuntimeError("nothing was simulated yet: call advance() before take()")
        self._check_alive()
        sampled = np.concatenate([*self._sampled, np.empty(0)])
        unique, rows = np.unique(sampled, return_index=True)
        feet = self._forces[0] if self._forces else {}
        forces = {foot: np.concatenate([f[foot] for f in self._forces])[rows] for foot in feet}
        return self._simulation._take(name, 0.0, self._sent, self._played, unique, forces)

    def _check_alive(self) -> None:
        if not self._simulation._is_stepping(self._token):
            raise RuntimeError("another run of the same simulation has ended this one")


def switch_commands(before: Commands | None, after: Commands, now: float) -> Commands:
    """A schedule on the run's clock: the commands sent before `now` [s], then `after`."""
    if before is None:
        return Commands(after.times + now, after.joints, after.goals, after.speeds, after.enabled, after.end + now, after.poses,
                        after.begun)
    kept = before.times < now - 1e-9
    rows = {f: np.concatenate([getattr(before, f)[kept], getattr(after, f)]) for f in ("goals", "speeds", "enabled", "poses")}
    return Commands(times=np.concatenate([before.times[kept], after.times + now]), joints=after.joints, end=after.end + now,
                    begun=before.begun,
                    **rows)
