"""One take before and after the diagnosis, for figures and for people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.compare.metrics import rms
from workbench.recording.take import Take
from workbench.types import Array, Mask


@dataclass(frozen=True)
class TakeReport:
    """One take compared with its simulation by the nominal and by the fitted model.

    recorded, nominal, fitted: the takes (SI, radians, world frame of `Take`), observed the same way, on one clock of N frames.
    channels: (c) names of joints, and for a free base of the body's coordinates. noise: (c,) standard deviation of what sensor
    noise, numerics and contact models alone cause [rad or m]. before, after: (N, c) recorded less simulated by the nominal and by
    the fitted model, divided by `noise`; NaN where not recorded or before the first command. unseen: (N,) frames held out from
    the choice of effects and from every fit. ValueError where shapes differ.
    """

    recorded: Take
    nominal: Take
    fitted: Take
    channels: tuple[str, ...]
    noise: Array
    before: Array
    after: Array
    unseen: Mask

    def __post_init__(self) -> None:
        shape = (len(self.recorded), len(self.channels))
        for name, length in (("before", np.shape(self.before)), ("after", np.shape(self.after))):
            if length != shape:
                raise ValueError(f"{name}: expected residuals of shape {shape}, got {length}")
        if not len(self.nominal) == len(self.fitted) == len(self.unseen) == len(self.recorded):
            raise ValueError("expected nominal, fitted and unseen on the recording's frames")

    @property
    def name(self) -> str:
        """Name of the take."""
        return self.recorded.name

    @property
    def time(self) -> Array:
        """Since the first command (N,) [s]."""
        return self.recorded.since_start

    @property
    def judged(self) -> Mask:
        """Frames (N,) on which a model is evaluated: the unseen ones, or all where there are none."""
        return self.unseen if self.unseen.any() else np.ones(len(self.unseen), dtype=bool)

    def ratios(self, residual: Array) -> dict[str, float]:
        """RMS of `before` or `after` on the frames `judged`, by channel; NaN where never seen."""
        return {c: float(rms(residual[self.judged, i])) for i, c in enumerate(self.channels)}

    def sigma(self, joint: str) -> float:
        """Standard deviation of a joint's residual from noise and numerics alone [rad]; NaN where it was never seen."""
        column = self.channels.index(joint)
        return float(self.noise[column]) if np.isfinite(self.before[:, column]).any() else float("nan")
