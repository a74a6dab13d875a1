"""The station, and runs of it."""

from workbench.servo import AddServos
from workbench.simulation.batch import Job, simulate_batch
from workbench.simulation.config import SimulationConfig
from workbench.simulation.rollout import BaseState, Simulation, Start
from workbench.simulation.station import MakeStation
from workbench.simulation.stepped import SteppedRun

__all__ = [
    "AddServos", "BaseState", "Job", "MakeStation", "Simulation", "SimulationConfig", "Start", "SteppedRun",
    "simulate_batch",
]
