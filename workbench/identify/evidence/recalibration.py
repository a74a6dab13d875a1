"""Recalibrated numbers of the nominal law, and the zeros that were found besides, as results state them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from workbench.identify.evidence.hypothesis import FAR, ZERO, Hypothesis, factor_of
from workbench.identify.evidence.nuisance import UNITS, as_mapping, changed_by, mixing, nominal_value
from workbench.identify.results.servo_law import Recalibrated
from workbench.robot import RobotModel
from workbench.types import Array

if TYPE_CHECKING:
    from workbench.identify.evidence.fit import Fitted
    from workbench.identify.evidence.options import EvidenceOptions
    from workbench.identify.evidence.region import Region


def as_stated(f: Fitted, region: Region, options: EvidenceOptions) -> tuple[Hypothesis, Array]:
    """A fit's hypothesis and the covariance of its theta (k, k), as results state them. Of a zero that is recalibrated and found
    as well, the recordings show the sum alone, so that each of its two numbers is the whole zero; such a hypothesis is not to be
    simulated."""
    h = f.hypothesis
    whole, moved = np.eye(len(h.theta)), mixing(h.numbers)
    for k, i in _found_zeros(h):
        unit = h.adds(i, k)
        whole[i, :len(moved)] = moved[k] / unit
        whole[k, i] = unit / h.numbers[k].sd
    return h.at(whole @ h.theta), whole @ f.covariance(region, options) @ whole.T


def _found_zeros(h: Hypothesis) -> list[list[int]]:
    """Pairs of theta that are one zero."""
    return [[k, i] for k, i in h.alike() if h.numbers[k].name == ZERO]


def list_changes(model: RobotModel, h: Hypothesis) -> tuple[Recalibrated, ...]:
    """Nominal and recalibrated values, those that went furthest first; without the zeros that were found."""
    z, found = as_mapping(h.numbers, h.z), {(h.numbers[k].joint, ZERO) for k, _ in _found_zeros(h)}
    sds = {(n.joint, n.name): float(sd) for n, sd in zip(z, np.linalg.norm(mixing(list(z)), axis=1))}
    ended = {(n.joint, n.name) for n, by in z.items() if math.isclose(abs(by), FAR, rel_tol=1e-3)}
    out = []
    for (joint, name), by in changed_by(z).items():
        if (joint, name) in found:
            continue
        nominal = 0.0 if name == ZERO else nominal_value(model.servo(joint), name)
        value = by if name == ZERO else nominal * float(factor_of(name, by))
        out.append(Recalibrated(name, (joint,), nominal, value, sds[joint, name] * (nominal or 1.0), UNITS[name],
                                (joint, name) in ended))
    return tuple(sorted(out, key=lambda r: -abs(r.sigmas)))
