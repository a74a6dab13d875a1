"""What of the nominal law was recalibrated, for the report."""

from __future__ import annotations

import math
from collections.abc import Mapping

from workbench.identify.evidence.hypothesis import Uncertain
from workbench.identify.evidence.nuisance import UNITS, ZERO, nominal_value
from workbench.identify.results.findings import Recalibrated
from workbench.robot import RobotModel


def what_changed(model: RobotModel, z: Mapping[Uncertain, float]) -> tuple[Recalibrated, ...]:
    """Nominal and recalibrated values, those that went furthest first."""
    out = []
    for number, by in z.items():
        nominal = 0.0 if number.name == ZERO else nominal_value(model.servo(number.joint), number.name)
        value = number.sd * by if number.name == ZERO else nominal * math.exp(number.sd * by)
        out.append(Recalibrated(number.name, (number.joint,), nominal, value, number.sd * (nominal or 1.0), UNITS[number.name]))
    return tuple(sorted(out, key=lambda r: -abs(r.sigmas)))
