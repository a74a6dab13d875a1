"""What a servo's own angles tell as one number: gravity against torque.

Angles do not change if all torques and inertias grow alike. A load, a centre of mass elsewhere, another supply and a stronger
motor are therefore told apart by what was known before alone, however small the errors that a fit claims: stick and slip answer
small changes with noise, which differences take for information. So an effect that does what other torques would do is believed
by no more than the prior odds of both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from workbench.identify.evidence.fit import Fitted
from workbench.identify.evidence.hypothesis import Prior, log_odds
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.region import Region
from workbench.identify.parameters import Candidate

TORQUES = ("torque_at_full_duty", "back_emf", "coulomb_friction", "viscous_friction", "reflected_inertia")
"""Numbers of the nominal law that are torques, or make them."""


@dataclass(frozen=True)
class AsTorque:
    """An effect beside all torques of the servo. by: of these the change that does most like it, of the logarithm; alike: share
    of what the effect does that this does; share: probability that it is the effect, where both explain the same."""

    by: float
    alike: float
    share: float

    @property
    def sentence(self) -> str:
        """For a person: what else it could be, and what would tell."""
        more = "less" if self.by < 0 else "more"
        percent = 100 * abs(math.expm1(self.by))
        return (f" Or the servo's torques are {percent:.0f} % {more}: angles tell gravity over torque alone. "
                "A known weight hung on the link tells them apart.")


def as_torque(region: Region, options: EvidenceOptions, f: Fitted, c: Candidate) -> AsTorque | None:
    """Of a fit's effect; None where it is no such, or no other torques do what it does."""
    h, prior = f.hypothesis, Prior.of(f.hypothesis, options)
    known = [k for k, n in enumerate(h.numbers) if n.name in TORQUES]
    if c.effect.tied != "gravity against torque" or not known or not c.size:
        return None
    own = h.slices()[h.effects.index(c)]
    sds = np.array([h.numbers[k].sd for k in known])
    precision = region.likelihood.precision(f.r, f.discrepancy)
    does, torques = f.J[:, own] @ h.theta[own], f.J[:, known] @ (1.0 / sds)
    both, size = float(does @ (precision * torques)), float(torques @ (precision * torques))
    by, alike = both / max(size, 1e-12), both**2 / max(size * float(does @ (precision * does)), 1e-12)
    if alike < options.alike:
        return None
    z = h.z[known]
    torque = -0.5 * float(np.sum(np.square(z + by / sds) - np.square(z)))
    nothing = h.theta.copy()
    nothing[own] = prior.center[own]
    H = (f.J[:, own].T * precision) @ f.J[:, own] + np.diag(prior.precision(h.theta)[own])
    density = float(prior.log(h.theta) - prior.log(nothing)) + float(np.sum(prior.at_center[own]))
    occam = 0.5 * c.size * math.log(2 * math.pi) - 0.5 * float(np.linalg.slogdet(H)[1])
    effect = density + occam + log_odds(len(region.candidates), options.expected)
    return AsTorque(by, alike, 1.0 / (1.0 + math.exp(min(torque - effect, 700.0))))
