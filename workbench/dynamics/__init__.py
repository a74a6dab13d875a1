"""Inverse dynamics, contact forces, base wrench residual, servo margins."""

from workbench.dynamics.inverse import InverseDynamics, inverse_dynamics
from workbench.dynamics.margins import ServoLoad
from workbench.dynamics.result import InverseDynamicsResult, load_inverse_dynamics, save_inverse_dynamics
from workbench.dynamics.trajectory import RobotTrajectory

__all__ = [
    "InverseDynamics", "InverseDynamicsResult", "RobotTrajectory", "ServoLoad", "inverse_dynamics", "load_inverse_dynamics",
    "save_inverse_dynamics",
]
