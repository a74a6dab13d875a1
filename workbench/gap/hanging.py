"""A pull straight down: cables pull up or aside, loads resist being moved. What weighs and does neither hangs, and may swing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import GRAVITY, si_values
from workbench.gap.candidate import Candidate
from workbench.gap.findings import Unexplained
from workbench.gap.search import Fit

Array = NDArray[np.float64]
ASIDE = np.tan(np.deg2rad(15.0))
"""Share of a pull's weight that it may pull aside by and still is one straight down."""


def hangs(c: Candidate, x: Array) -> bool:
    """Whether an effect pulls the base straight down."""
    pull = _pull(c, x)
    return pull is not None and bool(np.hypot(pull[0], pull[1]) < -ASIDE * pull[2])


def hanging(fit: Fit) -> Iterator[Unexplained]:
    """Pulls straight down, as something that no effect of the vocabulary is: error is the pull, floor its standard deviation."""
    for (c, x), own in zip(fit.sizes(), fit.slices()):
        if hangs(c, x):
            pull = _pull(c, x)
            assert pull is not None
            down = float(-pull[2])
            slopes = np.array([_pull(c, x + step) - pull for step in 1e-3 * np.eye(len(x))])[:, 2] / 1e-3  # type: ignore[operator]
            deviation = float(np.sqrt(slopes @ np.nan_to_num(fit.covariance[own, own], posinf=1e9) @ slopes))
            yield Unexplained((), down, deviation, "N",
                              f"{c} pulls straight down with the weight of {1e3 * down / GRAVITY:.0f} g that does not resist "
                              "being moved as a load does: something that hangs and swings looks like it")


def _pull(c: Candidate, x: Array) -> Array | None:
    """The force [N] on the base, in the world's axes; None where an effect has none."""
    return c.effect.tether(si_values(c.effect, c.spec(x)))
