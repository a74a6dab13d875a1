"""Simulate a small legged robot on hobby servos, compare it with recordings, and find the physics that the simulation left out.

`import workbench` offers the names listed in `__all__`, each loaded when it is first used:

    result = workbench.diagnose("session.yaml")
    result.save("runs/mine")

SI units and radians inside; degrees in files. `workbench.InputError` is raised for input that a user can correct.
"""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from workbench.api.gaits import GaitResult, optimize
    from workbench.api.robots import load_model, save_model
    from workbench.api.sessions import (
        ComparisonResult,
        DiagnoseOptions,
        DiagnosisResult,
        PredictionResult,
        compare_session,
        diagnose,
        predict,
    )
    from workbench.compare.session import Session, load_session
    from workbench.files import InputError
    from workbench.gait.optimize import OptimizeOptions
    from workbench.gait.request import Request
    from workbench.motion import Motion, load_motion
    from workbench.recording import Take
    from workbench.robot import ConfigureParser, EffectSpec, RobotModel
    from workbench.simulation import AddServos, MakeStation, Simulation, SimulationConfig
    from workbench.view.scene.live import show

_HOME = {
    "AddServos": "workbench.simulation", "ComparisonResult": "workbench.api.sessions", "ConfigureParser": "workbench.robot",
    "DiagnoseOptions": "workbench.api.sessions", "DiagnosisResult": "workbench.api.sessions", "EffectSpec": "workbench.robot",
    "GaitResult": "workbench.api.gaits", "InputError": "workbench.files", "MakeStation": "workbench.simulation",
    "Motion": "workbench.motion", "OptimizeOptions": "workbench.gait.optimize", "Request": "workbench.gait.request",
    "PredictionResult": "workbench.api.sessions",
    "RobotModel": "workbench.robot", "Session": "workbench.compare.session", "Simulation": "workbench.simulation",
    "SimulationConfig": "workbench.simulation", "Take": "workbench.recording", "compare_session": "workbench.api.sessions",
    "diagnose": "workbench.api.sessions", "load_model": "workbench.api.robots", "load_motion": "workbench.motion",
    "load_session": "workbench.compare.session", "optimize": "workbench.api.gaits", "predict": "workbench.api.sessions",
    "save_model": "workbench.api.robots", "show": "workbench.view.scene.live",
}
"""Which module each name is loaded from."""

__all__ = [
    "AddServos", "ComparisonResult", "ConfigureParser", "DiagnoseOptions", "DiagnosisResult", "EffectSpec", "GaitResult",
    "InputError", "MakeStation", "Motion", "OptimizeOptions", "PredictionResult", "Request", "RobotModel", "Session",
    "Simulation", "SimulationConfig", "Take", "compare_session", "diagnose", "load_model", "load_motion", "load_session",
    "optimize", "predict", "save_model", "show",
]

try:
    __version__ = version("drake-workbench")
except PackageNotFoundError:  # run from a source tree that was never installed
    __version__ = "0+unknown"


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'workbench' has no attribute '{name}'")
    value = globals()[name] = getattr(import_module(_HOME[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
