"""A gait for a request, with its certificate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

from workbench.files import InputError
from workbench.gait.engines import other_engine
from workbench.gait.ensemble import Ensemble, load_ensemble
from workbench.gait.machine import GaitMachine
from workbench.gait.optimize import Optimized, OptimizeOptions, write_gait
from workbench.gait.optimize import optimize as seek
from workbench.gait.request import Request
from workbench.motion import Motion
from workbench.robot import RobotModel
from workbench.types import Progress, no_progress
from workbench.view.report.gait import write_gait_page
from workbench.view.report.notebook import gait_html


@dataclass(frozen=True)
class GaitResult:
    """The gait that was found for a request. optimized: everything found, with table (counts and milliseconds) and certificate
    (its numbers carry their units in their names); model: the robot."""

    optimized: Optimized
    model: RobotModel

    @property
    def met(self) -> bool:
        """Whether the gait keeps every limit and the required speed."""
        return self.optimized.met

    @property
    def problem(self) -> str:
        """Which limit binds, with value and unit, in a line; empty where the request is met."""
        return self.optimized.problem

    @property
    def motion(self) -> Motion:
        """The gait as poses from neutral to neutral, in sections: times (K,) [s], angles (K, n) [rad]; its cycles are those of
        the certificate. InputError if no gait was found."""
        table, certified = self._require_gait()
        return replace(Motion.from_table(table.whole), cycles=certified.cycles)

    def save(self, folder: str | PathLike[str]) -> list[Path]:
        """Writes gait.csv, certificate.json and report.html; returns their paths. InputError where no gait was found, or they
        cannot be written."""
        Path(folder).mkdir(parents=True, exist_ok=True)
        written = write_gait(Path(folder), *self._require_gait())
        return [write_gait_page(Path(folder), self.model, self.optimized), *written]

    def _require_gait(self):  # type: ignore[no-untyped-def]
        if self.optimized.table is None or self.optimized.certified is None:
            raise InputError(None, f"no gait was found: {self.problem}")
        return self.optimized.table, self.optimized.certified

    def _repr_html_(self) -> str:
        return gait_html(self.optimized)


def optimize(model: RobotModel, request: Request | None = None, options: OptimizeOptions | None = None, *,
             ensemble: Ensemble | None = None, progress: Progress = no_progress, memory: Path | None = None) -> GaitResult:
    """Searches for a gait within the limits of joints, servos and supply, on an ensemble of robots, any of which this one might
    be.

    request: None: the fastest walk forward. options: size of the search, certificate, seed. ensemble: None: the one that ships.
    progress: called with the stage and the share done. memory: a file from which a run that was killed continues. Returns the
    table, the certificate and the binding limit, even if the request cannot be met. InputError for a robot without legs.
    """
    found = seek(GaitMachine(model), request or Request(), ensemble or load_ensemble(), options or OptimizeOptions(), progress,
                 memory, other_engine())
    return GaitResult(found, model)
