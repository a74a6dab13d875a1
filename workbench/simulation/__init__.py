"""The station, and runs of it."""

from workbench.servo import AddServos
from workbench.simulation.batch import Job, simulate_batch
from workbench.simulation.config import SimulationConfig
from workbench.simulation.rollout import Simulation, Start
from workbench.simulation.station import MakePuppyStation

__all__ = ["AddServos", "Job", "MakePuppyStation", "Simulation", "SimulationConfig", "Start", "simulate_batch"]
