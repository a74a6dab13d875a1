"""Every number that the next experiment is designed with: unit, meaning and reason in one place."""

from __future__ import annotations

import math
from dataclasses import dataclass

from workbench.identify.options import PROBLEM


@dataclass(frozen=True)
class ExperimentOptions:
    """Design of the next experiment."""

    longest: float = 12.0
    """Longest motion [s] that a person can reasonably be expected to record."""
    separated: float = 5.0
    """Log-likelihood ratio from which on names count as separated: odds of 150 to 1."""
    worth: float = 0.2
    """How much another piece has to bring, in the logarithm of the log-likelihood ratio, summed over pairs."""
    kept: int = 4
    """Pieces, of those tried, on which sensitivities are found: these cost a rollout for each number."""
    widest: float = math.radians(110)
    """No joint is sent farther from neutral [rad]."""
    margin: float = math.radians(5)
    """Kept to a joint's ends, as links overshoot [rad]."""
    speed_share: float = 0.9
    """Of the speed that a servo reaches unloaded against its own friction."""
    clear: float = 0.02
    """Distance that links keep from each other, where they have it in neutral [m]."""
    nearer: float = 0.6
    """If they are closer than that in neutral, this share of their distance there."""
    points: int = 4
    """On each bone of a link, from its joint to the next ones, at which distances are taken."""
    rounds: int = 2
    """How often rivals are fitted to each other."""
    settled: float = 0.99
    """Of chi squared: a round that leaves more of it has converged."""
    together: float = 0.05
    """Frames within this time have correlated errors and count as one [s]."""
    zero: float = math.radians(0.3)
    """How far dry friction lets a joint stand from where it is thought to stand when angles are zeroed [rad]."""
    start: float = 0.01
    """How far the first command's time may be off where cameras see the robot [s]."""
    freedom: float = 0.5
    """How far a parameter may still go, as a share of what there is of it: a standard deviation. The session fitted it."""
    step: float = 0.2
    """Of that, for sensitivities."""
    time_step: float = PROBLEM.time_step
    """Of the rollouts [s], as the search's."""
    rest: float = PROBLEM.rest
    """Before the first command [s], as the search's."""
    after: float = 0.02
    """After the last frame [s]."""
    upright: float = 0.94
    """Cosine of the tilt beyond which a robot counts as falling."""
    near: float = 0.5
    """Of the distance that commands keep between links, what moving links have to keep."""
    slow: float = math.radians(50)
    """Speed of sweeps [rad/s]."""
    quick: float = math.radians(150)
    """Speed from one posture to another [rad/s]."""
    rest_at_end: float = 0.3
    """Rest at a segment's end, after which the next one finds the robot as if it had stood in neutral [s]."""
    grid: tuple[float, ...] = (-60.0, -30.0, 0.0, 30.0, 60.0)
    """Angles from which postures are put together [deg]."""
    calm: float = math.radians(90)
    """Speed of calm motions of the body [rad/s]."""
    brisk: float = math.radians(200)
    """Speed of brisk ones [rad/s]."""
    missed: float = 0.05
    """Share of the legs' length by which a foot may miss its place."""


EXPERIMENT = ExperimentOptions()
