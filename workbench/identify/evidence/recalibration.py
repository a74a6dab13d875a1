"""Recalibrated numbers of the nominal law, for the report."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from workbench.identify.evidence.hypothesis import FAR, ZERO, Uncertain
from workbench.identify.evidence.nuisance import UNITS, changed_by, mixing, nominal_value
from workbench.identify.results.servo_law import Recalibrated
from workbench.robot import RobotModel


def list_changes(model: RobotModel, z: Mapping[Uncertain, float]) -> tuple[Recalibrated, ...]:
    """Nominal and recalibrated values, those that went furthest first."""
    sds = {(n.joint, n.name): float(sd) for n, sd in zip(z, np.linalg.norm(mixing(list(z)), axis=1))}
    ended = {(n.joint, n.name) for n, by in z.items() if math.isclose(abs(by), FAR, rel_tol=1e-3)}
    out = []
    for (joint, name), by in changed_by(z).items():
        nominal = 0.0 if name == ZERO else nominal_value(model.servo(joint), name)
        value = by if name == ZERO else nominal * math.exp(by)
        out.append(Recalibrated(name, (joint,), nominal, value, sds[joint, name] * (nominal or 1.0), UNITS[name],
                                (joint, name) in ended))
    return tuple(sorted(out, key=lambda r: -abs(r.sigmas)))
