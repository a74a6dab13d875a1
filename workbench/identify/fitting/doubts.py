"""Doubts about fitted effects, as physics that the vocabulary lacks can look like a known one: like an effect whose parameter
drifts within a take, or like a force straight down. A cable pulls up or aside, a load has inertia; a vertical force without
inertia is a hanging mass."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import si_values
from workbench.identify.options import CONCLUSIONS, FIT
from workbench.identify.problem import in_file_units
from workbench.identify.results.findings import Unexplained
from workbench.identify.results.reasons import DownwardPull, ParameterDrift
from workbench.robot import GRAVITY
from workbench.types import Array

if TYPE_CHECKING:
    from workbench.identify.fitting.fit import Fit, Slopes
    from workbench.identify.fitting.fits import Search
    from workbench.identify.parameters import Candidate
    from workbench.identify.problem import TakeEvidence
    from workbench.identify.rollouts.evaluator import RolloutEvaluator


@dataclass(frozen=True)
class Drift:
    """A parameter (its index) that fixed-base takes require to change: its values at a take's beginning and end; the RMS error
    over sigma caused by a constant value, and by chance, one standard error."""

    effect: Candidate
    number: int
    first: float
    last: float
    rms: float
    chance: float

    def as_unexplained(self, evidence: Sequence[TakeEvidence]) -> Unexplained:
        """The drift as an unexplained residual, since a constant number does not explain it."""
        p, joint = self.effect.parameters[self.number], self.effect.joint
        e = next((e for e in evidence if joint is None or joint in e.channels), evidence[0])
        channel = joint if joint in e.channels else e.joints[0]
        sigma, unit = in_file_units(float(e.sigma[e.channels.index(channel)]), channel)
        return Unexplained(() if joint is None else (joint,), self.rms * sigma, self.chance * sigma, unit,
                           ParameterDrift(self.effect.name, self.effect.where, p.name, self.first, self.last, p.unit))


def drifts(search: Search, fit: Fit) -> list[Drift]:
    """Numbers that fixed-base takes identified (floating-base takes bend them), and tell differently early and late."""
    out: list[Drift] = []
    of_number = [(c, x, k) for c, x in fit.sizes() for k in range(c.size)]
    for s in fit.slopes:
        if set(s.takes) <= set(search.fixed_base):
            for t in _trends(search.evaluator, fit, s):
                c, x, k = of_number[int(s.numbers[t.column])]
                found = drift(c, x, k, t)
                out += [] if found is None else [found]
    return out


def drift(c: Candidate, x: Array, k: int, t: Trend) -> Drift | None:
    """The drift of number k of an effect's sizes x, where a trend is a good part of it."""
    if c.read_off and c.effect.free_play:
        return None  # a loose mount rattles by chance, and nothing else is seen across an axis
    if c.shapes[k] or not abs(t.change) > FIT.drift * abs(x[k]):
        return None
    way = np.eye(len(x))[k] * t.change / 2
    low, high = c.bounds()
    first, last = (c.values(np.clip(x + w, low, high))[k] for w in (-way, way))
    return Drift(c, k, first, last, abs(t.change) * t.rms, t.error * t.rms)


class Trend(NamedTuple):
    """For the parameter of one column of slopes: its significant change over a take, the standard error of that, and the RMS
    over sigma caused by a change of one."""

    column: int
    change: float
    error: float
    rms: float


def _trends(evaluator: RolloutEvaluator, fit: Fit, s: Slopes) -> Iterator[Trend]:
    r = evaluator.vector({i: fit.residuals[i] for i in s.takes}, "fit", s.joint)
    clocks = {}
    for i in s.takes:
        e = evaluator.evidence[i]
        clocks[i] = np.repeat((e.since / e.since[-1] - 0.5)[:, None], len(e.channels), axis=1)
    return trends(r, s.J, evaluator.vector(clocks, "fit", s.joint), evaluator.stretches(s.takes, s.joint))


def trends(r: Array, J: Array, clock: Array, stretches: NDArray[np.int_]) -> Iterator[Trend]:
    """Parameters that significantly change over a take: a test of constancy against a linear trend, with standard errors over
    stretches (J. Nyblom, JASA 84, 1989; clusters as in `covariance_of`). r (n,): residuals of a fit, over sigma; J (n, k):
    derivatives of r by the parameters; clock (n,): -1/2 at a take's beginning, 1/2 at its end."""
    _, which = np.unique(stretches, return_inverse=True)
    for n, slope in enumerate(J.T):
        z = slope * clock
        z = z - J @ np.linalg.lstsq(J, z, rcond=1e-9)[0]
        power = float(z @ z)
        if power < 1e-9:
            continue
        change = -float(z @ r) / power
        by_stretch = np.asarray(np.bincount(which, weights=z * (r + change * z)), dtype=float)
        error = float(np.linalg.norm(by_stretch)) / power
        if abs(change) >= FIT.drift_sure * error and change**2 * power >= FIT.least_gain:
            yield Trend(n, change, error, float(np.sqrt(power / int(np.count_nonzero(r)))))


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
