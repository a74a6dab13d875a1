"""Gravity against torque: servo logs determine their ratio only.

Angles do not change if all torques and inertias grow by one factor. A load, a moved centre of mass, another supply and a stronger
motor can therefore be separated by prior knowledge alone, however small the errors that a fit claims: stick and slip answer
small changes with noise, which differences take for information. So an effect that does what other torques would do is believed
by no more than the prior odds of both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.identify.evidence.fit import Fitted
from workbench.identify.evidence.hypothesis import Prior, Uncertain, log_odds
from workbench.identify.evidence.nuisance import mixing
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.region import Region
from workbench.identify.parameters import Candidate
from workbench.types import Array

GRAVITY = "gravity against torque"
"""The tie of what gravity does with what all torques do."""
TORQUES = ("torque_at_full_duty", "back_emf", "coulomb_friction", "viscous_friction", "reflected_inertia")
"""Numbers of the nominal law that are torques, or make them."""


@dataclass(frozen=True)
class AsTorque:
    """An effect compared with a change of the servo's torque scale. by: the change of its logarithm that resembles the effect
    most; similarity: the share of the effect's response that this change reproduces; share: probability of the effect, where
    both explain the same; known: standard deviation of the logarithm of the servo's common torque scale in the prior."""

    by: float
    similarity: float
    share: float
    known: float

    def covariance(self, formal: Array, size: Array) -> Array:
        """Covariance of the effect's sizes (k, k): no better known along `size` (k,) than the torques are that do the same,
        whatever a fit claims (`formal`), as no angle tells the two apart."""
        along = size / max(float(np.linalg.norm(size)), 1e-12)
        least = self.similarity * float(size @ size) * (self.known / max(abs(self.by), 1e-6))**2
        return np.asarray(formal + max(0.0, least - float(along @ formal @ along)) * np.outer(along, along))

    @property
    def sentence(self) -> str:
        """For a person: what else it could be, and what would tell."""
        more = "less" if self.by < 0 else "more"
        percent = 100 * abs(math.expm1(self.by))
        return (f" Or the servo's torques are {percent:.0f} % {more}: angles determine only the ratio of gravity to "
                "torque. A known weight hung on the link separates the two.")


def competes(c: Candidate) -> bool:
    """Whether an effect is of this tie, or can look like one of its effects."""
    return GRAVITY in (c.effect.tied, c.effect.resembles)


def as_torque(region: Region, options: EvidenceOptions, f: Fitted, c: Candidate) -> AsTorque | None:
    """A fit's effect as a change of torque; None where it is not of this tie, or no change of torque resembles it."""
    h, prior = f.hypothesis, Prior.of(f.hypothesis, options)
    more = all_torques(h.numbers)
    if c.effect.tied != GRAVITY or not more.any() or not c.size:
        return None
    own = h.slices()[h.effects.index(c)]
    precision = region.likelihood.precision(f.r, f.discrepancy)
    does, torques = f.J[:, own] @ h.theta[own], f.J[:, :len(more)] @ more
    both, size = float(does @ (precision * torques)), float(torques @ (precision * torques))
    by, similarity = both / max(size, 1e-12), both**2 / max(size * float(does @ (precision * does)), 1e-12)
    if similarity < options.similarity:
        return None
    torque = -0.5 * float(np.sum(np.square(h.z + by * more) - np.square(h.z)))
    nothing = h.theta.copy()
    nothing[own] = prior.center[own]
    H = (f.J[:, own].T * precision) @ f.J[:, own] + np.diag(prior.precision(h.theta)[own])
    density = float(prior.log(h.theta) - prior.log(nothing)) + float(np.sum(prior.at_center[own]))
    occam = 0.5 * c.size * math.log(2 * math.pi) - 0.5 * float(np.linalg.slogdet(H)[1])
    effect = density + occam + log_odds(len(region.candidates), options.expected)
    return AsTorque(by, similarity, 1.0 / (1.0 + math.exp(min(torque - effect, 700.0))), float(1.0 / np.linalg.norm(more)))


def all_torques(numbers: Sequence[Uncertain]) -> Array:
    """Standard deviations by which the numbers (k,) have to move for all torques to grow by a factor of e, and nothing else to
    change; zero where none of them is a torque."""
    target = np.array([float(n.name in TORQUES) for n in numbers])
    return np.asarray(np.linalg.solve(mixing(numbers), target)) if target.any() else target
