"""Every threshold in the design of the next experiment, with unit, meaning and reason, in one place."""

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
    """Least gain of another piece, in the logarithm of the log-likelihood ratio, summed over pairs."""
    kept: int = 4
    """Number of pieces for which sensitivities are computed: these cost a rollout for each number."""
    widest: float = math.radians(110)
    """Largest angle from neutral to which a joint is sent [rad]."""
    margin: float = math.radians(5)
    """Distance kept from a joint's limits, as links overshoot [rad]."""
    speed_share: float = 0.9
    """Share used of the speed that a servo reaches unloaded against its own friction."""
    clear: float = 0.02
    """Distance that links keep from each other, if they have it in neutral [m]."""
    nearer: float = 0.6
    """If they are closer than that in neutral, this share of their distance there."""
    points: int = 4
    """Number of points on each bone of a link, from its joint to the next ones, at which distances are computed."""
    rounds: int = 2
    """How often rivals are fitted to each other."""
    settled: float = 0.99
    """Share of chi squared: a round that leaves more of it has converged."""
    together: float = 0.05
    """Frames within this time have correlated errors and count as one [s]."""
    zero: float = math.radians(0.3)
    """Error of a joint's assumed angle, due to dry friction, when angles are zeroed [rad]."""
    start: float = 0.01
    """Uncertainty of the first command's time if cameras see the robot [s]."""
    freedom: float = 0.5
    """Standard deviation of a parameter that the session has fitted, as a share of its size."""
    step: float = 0.2
    """Step for sensitivities, as a share of that."""
    time_step: float = PROBLEM.time_step
    """Time step of the rollouts [s], as in the search."""
    rest: float = PROBLEM.rest
    """Rest before the first command [s], as in the search."""
    after: float = 0.02
    """Time simulated after the last frame [s]."""
    upright: float = 0.94
    """Cosine of the tilt beyond which a robot counts as falling."""
    near: float = 0.5
    """Share of the distance commanded between links that moving links have to keep."""
    slow: float = math.radians(50)
    """Speed of sweeps [rad/s]."""
    quick: float = math.radians(150)
    """Speed from one posture to another [rad/s]."""
    pause: float = 0.2
    """Rest in each posture [s], in which the joints settle."""
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
