"""MuJoCo's system identification toolbox (`mujoco.sysid`) on one joint's friction, for comparison with the workbench's own fit.

The robot is that of `to_mjcf` with the servo law as MuJoCo's own actuators. All settings are the toolbox's defaults (its own
optimiser, differences batched in one call of `mujoco.rollout`, a compiled model for each point), but for one thread.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from mujoco.rollout import rollout
from mujoco.sysid import (
    ModelSequences,
    Parameter,
    ParameterDict,
    SignalType,
    TimeSeries,
    build_residual_fn,
    create_initial_state,
    optimize,
)

from studies.other_engine.description import Surroundings, describe
from studies.other_engine.mjcf import to_mjcf
from studies.other_engine.servo import ServoBank
from workbench.motion.commands import Commands
from workbench.robot import RobotModel
from workbench.types import Array

HIGHEST = 1.5, 2.0
"""Coulomb friction [N m] and viscous friction [N m s/rad] are sought from zero to here."""


@dataclass(frozen=True)
class Identified:
    """Result of the toolbox. friction: Coulomb [N m] and viscous [N m s/rad]; residual: RMS over joints and time [rad];
    rollouts: how many were made."""

    friction: tuple[float, float]
    residual: float
    rollouts: int


class Identification:
    """The robot on a fixed base from rest in neutral, one joint's two frictions unknown."""

    def __init__(self, model: RobotModel, joint: str, commands: Commands, timestep: float) -> None:
        description = describe(model.path)
        servos = ServoBank([model.servo(j) for j in description.joints])
        self.joints, self.joint = description.joints, joint
        around = Surroundings(model.ground)
        self.spec = mujoco.MjSpec.from_string(to_mjcf(description, servos, around, "fixed", timestep, drives=True))
        for actuator in self.spec.actuators:  # the toolbox goes by names
            actuator.name = actuator.target
        i = self.joints.index(joint)
        self.back_emf = float(servos.back_emf[i])
        self.nominal = float(servos.coulomb[i]), float(servos.viscous[i])
        self.time: Array = timestep * np.arange(round(commands.end / timestep) + 1, dtype=float)
        """Of states (N,) [s], 0 = first command."""
        compiled = self.spec.compile()
        order = [self.joints.index(compiled.joint(compiled.actuator_trnid[k, 0]).name) for k in range(compiled.nu)]
        self.control = np.ascontiguousarray(commands.reordered(self.joints).reference(self.time)[:, order])
        self.columns = np.array([compiled.joint(j).qposadr[0] for j in self.joints])
        self.start = create_initial_state(compiled, np.zeros(compiled.nq), np.zeros(compiled.nv))

    def played(self, friction: tuple[float, float], time: Array) -> Array:
        """Angles (M, n) [rad] of `joints` at times (M,) [s] with that Coulomb and viscous friction."""
        spec = self.spec.copy()
        self._rub(spec, 0, friction[0])
        self._rub(spec, 1, friction[1])
        compiled = spec.compile()
        states, _ = rollout(compiled, mujoco.MjData(compiled), self.start[None], self.control[None, :-1])
        q = np.vstack([np.zeros(len(self.joints)), states[0][:, 1 + self.columns]])
        return np.column_stack([np.interp(time, self.time, c) for c in q.T])

    def fitted(self, time: Array, angles: Array) -> Identified:
        """From the nominal friction; angles (M, n) [rad] of `joints` at times (M,) [s] since the first command."""
        signals = {f"{j}_qpos": (SignalType.MjStateQPos, np.array([i])) for i, j in enumerate(self.joints)}
        measured = TimeSeries(time, angles, signals)
        compiled = self.spec.compile()
        control = TimeSeries(self.time, self.control, TimeSeries.compute_all_control_mapping(compiled))
        with _quietly():
            log = ModelSequences("arm", self.spec, "log", self.start, control, measured, allow_missing_sensors=True)
            residual = build_residual_fn(models_sequences=[log], n_threads=1)
            count = 0

            def counted(x: Array, parameters: ParameterDict) -> Any:
                nonlocal count
                count += 1 if x.ndim == 1 else x.shape[1]
                return residual(x, parameters)

            found, _ = optimize(self._parameters(), counted, verbose=False)
        friction = float(found["coulomb"].value[0]), float(found["viscous"].value[0])
        left = angles - self.played(friction, time)
        return Identified(friction, float(np.sqrt(np.mean(np.square(left)))), count)

    def _parameters(self) -> ParameterDict:
        out = ParameterDict()
        for k, name in enumerate(("coulomb", "viscous")):
            out.add(Parameter(name, self.nominal[k], 0.0, HIGHEST[k],
                              modifier=lambda spec, p, k=k: self._rub(spec, k, float(p.value[0]))))
        return out

    def _rub(self, spec: Any, which: int, value: float) -> None:
        """Sets Coulomb (0) or viscous (1) friction; MuJoCo's damping is the back-EMF too."""
        joint = spec.joint(self.joint)
        if which == 0:
            joint.frictionloss = value
        else:
            joint.damping[0] = value + self.back_emf


@contextmanager
def _quietly() -> Iterator[None]:
    """The optimiser prints its iterations; that angles are no sensors of the model (those lag by a step) is said as a warning."""
    logger = logging.getLogger("absl")
    before, logger.disabled = logger.disabled, True
    try:
        with redirect_stdout(io.StringIO()):
            yield
    finally:
        logger.disabled = before
