"""One simulation run as plain data."""

from __future__ import annotations

from dataclasses import dataclass

from workbench.motion.commands import Commands
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation.config import SimulationConfig
from workbench.simulation.rollout import Start
from workbench.simulation.steady import BaseStates, JointStates
from workbench.types import Array


@dataclass(frozen=True)
class Job:
    """One run: what Simulation.run takes, of a model in a configuration. times: (N,) [s] after the first command at which
    the take is wanted, without torques and contact; the whole log if None. Less log is less traffic between processes. restarts:
    states that the servos of a held robot are put to (`servo_angles` alone)."""

    model: RobotModel
    config: SimulationConfig
    commands: Commands | None = None
    duration: float | None = None
    lead: float = 0.1
    trajectory: tuple[Array, Array] | None = None
    path: Take | None = None
    name: str = "simulation"
    times: Array | None = None
    start: Start | tuple[Array, Array] | None = None
    elapsed: float = 0.0
    steadied: BaseStates | None = None
    restarts: JointStates | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "config", self.config.of(self.model))
