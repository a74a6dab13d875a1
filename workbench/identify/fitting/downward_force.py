"""Forces straight down: a cable pulls up or aside, a load has inertia; a vertical force without inertia is a hanging mass."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from workbench.effects.base import si_values
from workbench.identify.fitting.fit import Fit
from workbench.identify.options import CONCLUSIONS, FIT
from workbench.identify.parameters import Candidate
from workbench.identify.results.findings import Unexplained
from workbench.identify.results.reasons import DownwardPull
from workbench.robot import GRAVITY
from workbench.types import Array


def pulls_down(c: Candidate, x: Array) -> bool:
    """Whether an effect pulls the base straight down."""
    aside_x, aside_y, up = _pull(c, x)
    return bool(np.hypot(aside_x, aside_y) < -CONCLUSIONS.aside * up)


def downward_pulls(fit: Fit) -> Iterator[Unexplained]:
    """Pulls straight down, as something that no effect of the vocabulary is: error is the pull, floor its standard deviation."""
    for (c, x), own in zip(fit.sizes(), fit.slices()):
        if pulls_down(c, x):
            down = -float(_pull(c, x)[2])
            slopes = np.array([-_pull(c, x + step)[2] - down for step in FIT.slope_step * np.eye(len(x))]) / FIT.slope_step
            deviation = float(np.sqrt(slopes @ np.nan_to_num(fit.covariance[own, own], posinf=1e9) @ slopes))
            yield Unexplained((), down, deviation, "N", DownwardPull(c.name, down / GRAVITY))


def _pull(c: Candidate, x: Array) -> Array:
    """The force (3,) [N] on the base, in the world's axes; zero of an effect that has none."""
    pull = c.effect.tether(si_values(c.effect, c.spec(x), c.lowest))
    return np.zeros(3) if pull is None else pull
