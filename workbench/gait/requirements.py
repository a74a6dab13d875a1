"""Distance of a gait's runs from the requirements of a request, and the cost that a search minimises."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from workbench.gait.limits import Kind, Margin, allowed_rms, least
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import GaitMeasure
from workbench.gait.request import Request
from workbench.robot import GRAVITY

SPREAD_COST = 0.085
"""Cost of a spread of heading by its size in rad/m: 10 deg/m of it are worth 2 cm/s to the puppy."""
MOST_SPREAD = float(np.radians(90))
"""Of one robot [rad/m]: beyond a quarter turn in a metre more is not worse."""
FALLS = "falls"
"""Name of the limit on falls, which counts the nominal robot and all draws."""
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
        bend = request.side * m.turn_rate * request.radius / max(forward, 0.01)
        return [_margin("curvature off the arc", abs(bend - 1), request.limits.aside, "of it", "straying")]
    turned, allowed = np.degrees([abs(drift(request, m)), request.limits.drift])
    return [*out, _margin("drift", float(turned), float(allowed), "deg/m", "straying")]


def drift(request: Request, m: GaitMeasure) -> float:
    """Change of heading by distance in excess of the request's [rad/m]; of a turn, 0."""
    if request.way == "turn":
        return 0.0
    return excess_turning(request, m) / max(abs(request.progress(m)), SLOWEST)


def excess_turning(request: Request, m: GaitMeasure) -> float:
    """Rate of turning in excess of the request's [rad/s], to the left; of a turn, 0."""
    if request.way == "turn":
        return 0.0
    return m.turn_rate - curvature(request) * max(abs(request.progress(m)), SLOWEST)


def curvature(request: Request) -> float:
    """Change of heading by distance that the request requires of the nominal robot [rad/m], to the left."""
    return (0.0 if request.radius is None else request.side / request.radius) - request.bias


def speed_margins(request: Request, nominal: GaitMeasure, draws: Sequence[GaitMeasure]) -> list[Margin]:
    """Whether the required speed is reached, on the nominal robot and over draws; whether draws fall or change their heading."""
    fell, count = sum(m.fell for m in (nominal, *draws)), 1 + len(draws)
    out = [Margin(FALLS, f"of {count} robots", float(fell), 0.0, "allowed", 1.0 + FALLEN * fell / count if fell else 0.0)]
    if request.speed is not None:
        out.append(least("speed", "robot", request.progress(nominal), request.speed, request.unit, "speed"))
    if draws:
        if request.speed is not None:
            out.append(least("speed of the worse half of draws", "robot", worse_half([request.progress(m) for m in draws]),
                              ROBUST * request.speed, request.unit, "speed"))
        if request.way != "turn":
            spread = float(np.sqrt(np.mean([min(abs(drift(request, m)), 10.0) ** 2 for m in draws])))
            out.append(_margin("drift over draws", np.degrees(spread), np.degrees(request.limits.spread), "deg/m RMS"))
    return out


def floor_margins(request: Request, nominal: GaitMeasure, floor: Mapping[str, Any]) -> list[Margin]:
    """The required speed again, after subtracting the numerical floor of the time step. floor: of a certificate."""
    if request.speed is None:
        return []
    surely = request.progress(nominal) - float(floor["steps"])
    return [least("speed less its numerical floor", "robot", surely, request.speed, request.unit, "speed")]


def cost(machine: GaitMachine, request: Request, nominal: GaitMeasure, draws: Sequence[GaitMeasure]) -> float:
    """Cost of gaits that keep all limits, to be minimised, without unit: speed by the robot's natural one, power by weight times
    that, jerk by gravity times that by leg length, RMS torque by its limit; and how much headings differ over draws."""
    spread = SPREAD_COST * heading_spread(request, nominal, draws)
    natural, gravity = machine.natural_speed, GRAVITY
    if request.aim == "speed":
        natural = natural / machine.arm if request.way == "turn" else natural
        return spread - worse_half([request.progress(m) for m in (draws or [nominal])]) / natural
    if request.aim == "energy":
        return spread + nominal.power / (machine.model.kinematics.mass * gravity * natural)
    if request.aim == "smoothness":
        return spread + nominal.jerk / (gravity * natural / machine.leg_length)
    return spread + max(r / a for r, a in zip(nominal.rms, allowed_rms(machine, request.limits)))


def heading_spread(request: Request, nominal: GaitMeasure, draws: Sequence[GaitMeasure]) -> float:
    """RMS over draws [rad/m] of the heading by distance that they change more than the nominal robot, which is what `turn` cannot
    correct for all of them; a fall counts as MOST_SPREAD."""
    if not draws or request.way == "turn":
        return 0.0
    middle = drift(request, nominal)
    apart = [MOST_SPREAD if m.fell else min(abs(drift(request, m) - middle), MOST_SPREAD) for m in draws]
    return float(np.sqrt(np.mean(np.square(apart))))


def worse_half(values: Sequence[float]) -> float:
    """Mean of the lower half."""
    ordered = np.sort(np.asarray(values, dtype=float))
    return float(ordered[:max(1, (len(ordered) + 1) // 2)].mean())


def _margin(name: str, value: float, limit: float, unit: str, kind: Kind = "run") -> Margin:
    return Margin(name, "robot", float(value), float(limit), unit, float(value / limit), kind=kind)
