"""The five runs, each simulation also at finer steps and in the other contact model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from studies import inputs
from studies.common import COORDINATES, body_track
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import Job, Simulation, SimulationConfig, simulate_batch

Array = NDArray[np.float64]

IDEAL = SimulationConfig(drive="ideal", contact_period=0.0, log_period=5e-3)
STEPS = (1e-3, 5e-4, 2.5e-4)
ANIMATION = "animation"
SIMULATED = ("robotis M", "robotis", "mocap M", "mocap")
"""The thesis's names; M: MATLAB filter, else its own."""
SMOOTH = "robotis, smooth"
"""Not among the thesis's: its own filter on the poses joined by a smooth spline, where cubicpolytraj may have rested at each."""


@dataclass(frozen=True)
class Run:
    """One run. track: COORDINATES (N, 6) at `time` (N,) [s]. finer: tracks at the step halved and quartered; other_contact: track
    in hydroelastic contact; none of them for the animation."""

    name: str
    time: Array
    track: Array
    finer: tuple[Array, ...] = ()
    other_contact: Array | None = None

    def end(self, coordinate: str) -> float:
        """Where the body ends."""
        return float(self.track[-1, COORDINATES.index(coordinate)])

    def floor(self, coordinate: str) -> float:
        """How far the finer steps move that end."""
        i = COORDINATES.index(coordinate)
        return max((abs(float(t[-1, i] - self.track[-1, i])) for t in self.finer), default=0.0)

    def contact_spread(self, coordinate: str) -> float:
        """How far the other contact model moves it."""
        i = COORDINATES.index(coordinate)
        return 0.0 if self.other_contact is None else abs(float(self.other_contact[-1, i] - self.track[-1, i]))


def five_runs(model: RobotModel, seconds: float, steps: Sequence[float], other_contact: bool,
              progress: Callable[[str, float | None], None]) -> list[Run]:
    """The animation first, SMOOTH last. seconds: how much of each. steps [s]: the run's own, then those of its floor."""
    progress("reading the recording", None)
    recorded = inputs.recording().recorded
    angles = (*inputs.robotis(), inputs.recorded_angles(recorded))
    robotis, smooth, mocap = (inputs.first_seconds(path, seconds) for path in angles)
    progress("filtering", None)
    paths = {"robotis M": inputs.matlab_filter(robotis), "robotis": inputs.own_filter(robotis),
             "mocap M": inputs.matlab_filter(mocap), "mocap": inputs.own_filter(mocap), SMOOTH: inputs.own_filter(smooth)}
    configs = [replace(IDEAL, time_step=h) for h in steps]
    if other_contact:
        configs.append(replace(IDEAL, time_step=steps[0], contact="hydroelastic"))
    jobs = [inputs.ideal_job(model, c, path, seconds, name) for name, path in paths.items() for c in configs]
    takes = _simulated(jobs, progress)
    time = np.arange(0.0, seconds - 1e-9, 0.01)
    runs = [Run(ANIMATION, time, body_track(animation(model, recorded), time))]
    for i, name in enumerate(paths):
        own, *others = [body_track(take, time) for take in takes[i * len(configs):(i + 1) * len(configs)]]
        runs.append(Run(name, time, own, tuple(others[:len(steps) - 1]), others[-1] if other_contact else None))
    return runs


def animation(model: RobotModel, recorded: Take) -> Take:
    """The recording played back: the model posed at each frame, no contact, no dynamics."""
    return Simulation(model, SimulationConfig(drive="playback")).play_back(recorded)


def _simulated(jobs: list[Job], progress: Callable[[str, float | None], None]) -> list[Take]:
    """Takes in the jobs' order; the longest first, so that no core waits for it at the end."""
    order = sorted(range(len(jobs)), key=lambda i: jobs[i].config.time_step / (4 if jobs[i].config.contact != "point" else 1))
    done = simulate_batch([jobs[i] for i in order], progress=lambda n, of: progress(f"simulating {of} runs", n / of))
    return [take for _, take in sorted(zip(order, done), key=lambda pair: pair[0])]
