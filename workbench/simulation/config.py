"""Every choice of a simulation, in one typed place."""

from dataclasses import dataclass, fields, replace

import numpy as np

from workbench.files import InputError
from workbench.files.option_checks import check_choice
from workbench.physical import TIME_STEP
from workbench.robot import RobotModel

BASES = ("auto", "free", "fixed", "path")
DRIVES = ("servo", "fast_servo", "ideal", "playback")
CONTACTS = ("point", "hydroelastic")
APPROXIMATIONS = ("lagged", "sap", "similar")
ENGINES = ("auto", "drake", "compiled")


@dataclass(unsafe_hash=True)  # not frozen: Drake's YAML loader fills an instance in
class SimulationConfig:
    """How a robot is simulated; loadable by `pydrake.common.yaml.yaml_load_typed`. InputError names a field out of range.

    time_step [s]: of the discrete plant; 0: continuous, stepped by `integrator` ("runge_kutta3", "implicit_euler", "cenic",
    … as in Drake's GetIntegrationSchemes) to `accuracy`. approximation: Drake's of discrete contact, "lagged", "sap" or
    "similar". base: "free", "fixed" (held
    level, clear of the ground), "path" (moved along a recorded path), or "auto" (`RobotModel.usual_base`).
    drive: "servo" (the full law), "fast_servo"
    (Drake's implicit PD; see fast_servo.py), "ideal" (joints follow a trajectory, torques result), "playback" (poses of a
    recording, no dynamics). contact: "point" or "hydroelastic". hydroelastic_modulus [Pa]: of feet that are given no
    hydroelastic shape by the SDF. settle [s]: time in which the robot comes to rest in neutral. log_period [s]: of the logged
    samples; 0: 1 ms or the step, if longer. contact_period [s]: between samples of contact forces, in whole steps; 0: none.
    boxes [m]: tallest of a field of random boxes on the floor, 0: none (`simulation.boxes`); boxes_seed: which field.
    engine: of jobs and batches: "compiled" (Drake's discrete step compiled; see `simulation.compiled` for its coverage), "drake",
    or "auto", the compiled one where it applies. A `Simulation` is always Drake's.
    """

    time_step: float = 1e-3
    base: str = "auto"
    drive: str = "servo"
    contact: str = "point"
    approximation: str = "lagged"
    integrator: str = "runge_kutta3"
    accuracy: float = 1e-4
    hydroelastic_modulus: float = 2e6
    settle: float = 1.0
    log_period: float = 0.0
    contact_period: float = 1 / 120
    boxes: float = 0.0
    boxes_seed: int = 0
    engine: str = "auto"

    def __post_init__(self) -> None:
        self.check()

    def of(self, model: RobotModel) -> "SimulationConfig":
        """The same with the robot's usual base in place of "auto"."""
        return self if self.base != "auto" else replace(self, base=model.usual_base)

    def check(self) -> None:
        """InputError names a field out of range; called again when a station is made, as loaders and callers may set fields."""
        for name, allowed in (("base", BASES), ("drive", DRIVES), ("contact", CONTACTS), ("approximation", APPROXIMATIONS),
                              ("engine", ENGINES)):
            check_choice(name, getattr(self, name), allowed)
        for f in fields(self):
            value = getattr(self, f.name)
            if f.type not in ("float", float):
                continue
            number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
            if not number or not 0 <= value < float("inf"):
                raise InputError(None, f"{f.name}: expected a non-negative number, got {value!r}")
        if self.time_step > TIME_STEP.most:
            raise InputError(None, f"time_step: {TIME_STEP.problem(self.time_step)}")
        if self.time_step == 0 and self.drive == "fast_servo":
            raise InputError(None, "drive: fast_servo needs a discrete plant (time_step > 0)")

    @property
    def uses_cenic(self) -> bool:
        """Drake's CENIC steps the plant: friction is implicit, and contact forces between steps cannot be computed (Drake
        1.51 aborts)."""
        return self.time_step == 0 and self.integrator == "cenic"

    @property
    def logged_every(self) -> float:
        """Seconds between two rows of the log, a multiple of the step."""
        if self.log_period:
            return self.log_period
        if self.time_step == 0:
            return 1e-3
        return self.time_step * max(1, round(1e-3 / self.time_step))
