"""Rolls out proposed segments, and checks that the robot can execute them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.experiment.limits import Reach
from workbench.experiment.options import EXPERIMENT
from workbench.experiment.projection import ObservationModel
from workbench.experiment.segment import Segment, join
from workbench.motion import Motion
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig
from workbench.simulation.batch import Job, simulate_batch
from workbench.types import Array, Progress


class Runs:
    """Rollouts at 2 ms on one base, observed at the rate of the future recording."""

    def __init__(self, reach: Reach, base: str, sight: ObservationModel, n_jobs: int, progress: Progress) -> None:
        self.reach, self.base, self.sight, self.n_jobs, self.progress = reach, base, sight, n_jobs, progress
        self.config = SimulationConfig(time_step=EXPERIMENT.time_step, base=base, settle=0.6, contact_period=0)

    def motion(self, segments: Sequence[Segment]) -> Motion:
        """Segments as one motion."""
        whole = join(segments)
        return Motion(whole.name, whole.times, self.reach.model.joints, whole.angles, "next experiment", units=self.reach.units)

    def play_all(self, models: Sequence[RobotModel], motions: Sequence[Sequence[Segment]], what: str = "",
               time_step: float = EXPERIMENT.time_step) -> list[list[Take]]:
        """For each motion, given as its segments, the takes of every model. A model's jobs are consecutive, so that its station
        is reused. Frames are at the same times within a segment whether it is rolled out alone or among others."""
        config = replace(self.config, time_step=time_step, log_period=self.config.logged_every)
        jobs = []
        for model in models:
            for segments in motions:
                times = self._frames(segments)
                jobs.append(
                    Job(
                        model,
                        config,
                        self.motion(segments).commands(),
                        float(times[-1]) + EXPERIMENT.after,
                        EXPERIMENT.rest,
                        times=times,
                    )
                )
        takes = simulate_batch(jobs, self.n_jobs, (lambda n, of: self.progress(what, n / of)) if what else None)
        return [takes[i::len(motions)] for i in range(len(motions))]

    def _frames(self, segments: Sequence[Segment]) -> Array:
        starts = np.cumsum([0.0, *(s.duration for s in segments)])
        frames = [start + np.arange(0, s.duration, 1 / self.sight.rate) for start, s in zip(starts, segments)]
        return np.concatenate([[-EXPERIMENT.rest, -EXPERIMENT.rest / 2, -1e-3], *frames])

    def sound(self, takes: Sequence[Take]) -> bool:
        """Whether the robot stayed upright and its links stayed apart in all of them."""
        return all(map(self._sound, takes))

    def _sound(self, take: Take) -> bool:
        if not np.isfinite(take.q).all() or not self.reach.clear(take.q[::6], share=EXPERIMENT.near).all():
            return False
        if take.base != "free":
            return True
        assert take.quat_WB is not None
        up = Rotation.from_quat(take.quat_WB, scalar_first=True).as_matrix()[:, 2, 2]
        return bool(up.min() > EXPERIMENT.upright)


def spans(segments: Sequence[Segment], rate: float) -> Mapping[str, slice]:
    """Frames of each segment, by name, in a take of them all, after the rest."""
    out, at = {}, 0
    for s in segments:
        n = len(np.arange(0, s.duration, 1 / rate))
        out[s.name] = slice(at, at + n)
        at += n
    return out
