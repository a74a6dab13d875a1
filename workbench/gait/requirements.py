"""How far runs of a gait are from what a request requires, and the cost that a search makes small."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.gait.limits import Margin, least
from workbench.gait.measure import GaitMeasure
from workbench.gait.request import Request

STANDING = 0.03
"""Speed [m/s] that a turn in place may have."""
SLOWEST = 0.02
"""Speed [m/s] from which drift is computed by distance: a gait that stands has none."""
ROBUST = 0.6
"""Share of the required speed that the worse half of the draws must keep on average."""
FALLEN = 100.0
"""Use of the limit on falls beyond one, by the share of robots that fell: none may, and one in a hundred is twice too many."""


def direction_margins(request: Request, m: GaitMeasure) -> list[Margin]:
    """How far a run is from the required direction: heading and sideways motion, of a turn its speed, of an arc its curvature."""
    forward, left = m.velocity
    if request.way == "turn":
        return [_margin("speed while turning", float(np.hypot(forward, left)), STANDING, "m/s")]
    along, across = (left, forward) if request.way == "sideways" else (forward, left)
    out = [_margin("motion across the way", abs(across), request.limits.aside * max(abs(along), 0.01), "m/s")]
    if request.radius is not None:
        bend = m.turn_rate * request.radius / max(forward, 0.01)
        return [_margin("curvature off the arc", abs(bend - 1), request.limits.aside, "of it")]
    turned, allowed = np.degrees([abs(drift(request, m)), request.limits.drift])
    return [*out, _margin("drift", float(turned), float(allowed), "deg/m")]


def drift(request: Request, m: GaitMeasure) -> float:
    """Change of heading by distance beyond what the request requires [rad/m]; of a turn, 0."""
    if request.way == "turn":
        return 0.0
    return excess_turning(request, m) / max(abs(request.progress(m)), SLOWEST)


def excess_turning(request: Request, m: GaitMeasure) -> float:
    """Rate of turning beyond what the request requires [rad/s], to the left; of a turn, 0."""
    if request.way == "turn":
        return 0.0
    return m.turn_rate - (0.0 if request.radius is None else max(abs(request.progress(m)), SLOWEST) / request.radius)


def speed_margins(request: Request, nominal: GaitMeasure, draws: Sequence[GaitMeasure]) -> list[Margin]:
    """Whether the required speed is reached, on the nominal robot and over draws; whether draws fall or change their heading."""
    fell, count = sum(m.fell for m in (nominal, *draws)), 1 + len(draws)
    out = [Margin("falls", f"of {count} robots", float(fell), 0.0, "allowed", 1.0 + FALLEN * fell / count if fell else 0.0)]
    if request.speed is not None:
        out.append(least("speed", "robot", request.progress(nominal), request.speed, request.unit))
    if draws:
        if request.speed is not None:
            out.append(least("speed of the worse half of draws", "robot", worse_half([request.progress(m) for m in draws]),
                              ROBUST * request.speed, request.unit))
        if request.way != "turn":
            spread = float(np.sqrt(np.mean([min(drift(request, m), 10.0) ** 2 for m in draws])))
            out.append(_margin("drift over draws", np.degrees(spread), np.degrees(request.limits.spread), "deg/m RMS"))
    return out


def cost(request: Request, nominal: GaitMeasure, draws: Sequence[GaitMeasure], worst_rms: float) -> float:
    """What is made small among gaits that keep all limits. worst_rms: largest RMS torque, as a share of its limit."""
    if request.aim == "speed":
        return -worse_half([request.progress(m) for m in (draws or [nominal])])
    if request.aim == "energy":
        return nominal.power
    if request.aim == "smoothness":
        return nominal.jerk
    return worst_rms


def worse_half(values: Sequence[float]) -> float:
    """Mean of the lower half."""
    ordered = np.sort(np.asarray(values, dtype=float))
    return float(ordered[:max(1, (len(ordered) + 1) // 2)].mean())


def _margin(name: str, value: float, limit: float, unit: str) -> Margin:
    return Margin(name, "robot", float(value), float(limit), unit, float(value / limit))
