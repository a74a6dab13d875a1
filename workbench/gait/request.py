"""What is asked of a gait: which way, how fast, and what to make best."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np

from workbench.gait.limits import GaitLimits, Margin
from workbench.gait.measure import GaitMeasure
from workbench.robot import EffectSpec, InputError, RobotModel
from workbench.robot.option_checks import check_choice

Way = Literal["forward", "backward", "sideways", "turn", "arc"]
Aim = Literal["speed", "gentleness", "energy", "smoothness"]

STANDING = 0.03
"""Speed [m/s] that a turn in place may have."""
SLOWEST = 0.02
"""Speed [m/s] from which drift is told by distance: a gait that stands has none to tell."""
ROBUST = 0.6
"""Share of the speed asked for that the worse half of the draws must keep on average."""
FALLEN = 100.0
"""Use of the limit on falls beyond one, by the share of robots that fell: none may, and one in a hundred is twice too many."""


@dataclass(frozen=True)
class Request:
    """One request. way: where to. speed: at least that much [m/s, for a turn rad/s]; None: as much as can be. radius: of an arc
    to the left [m]. slope: uphill [rad]. aim: what is made best once all limits and the speed are kept. built_knees: only
    knees as the robot has them in neutral (all back). limits: to keep."""

    way: Way = "forward"
    speed: float | None = None
    radius: float | None = None
    slope: float = 0.0
    aim: Aim = "speed"
    built_knees: bool = False
    limits: GaitLimits = field(default_factory=GaitLimits)

    def __post_init__(self) -> None:
        check_choice("way", self.way, get_args(Way))
        check_choice("aim", self.aim, get_args(Aim))
        if self.speed is not None and not 0 < self.speed < math.inf:
            raise InputError(None, f"speed: expected a positive number, got {self.speed:g}")
        if (self.way == "arc") != (self.radius is not None):
            raise InputError(None, "radius: an arc has one, nothing else")
        if self.radius is not None and not 0 < self.radius < math.inf:
            raise InputError(None, f"radius: expected a positive number of metres, got {self.radius:g}")
        if not 0 <= self.slope < math.pi / 3:
            raise InputError(None, f"slope: expected 0 to 60 deg, got {math.degrees(self.slope):g}")
        if self.speed is None and self.aim != "speed":
            raise InputError(None, f"what is made best is {self.aim}: expected a speed to keep")

    @property
    def unit(self) -> str:
        """Of the speed."""
        return "rad/s" if self.way == "turn" else "m/s"

    def on_slope(self, model: RobotModel) -> RobotModel:
        """The robot on the slope asked for, uphill ahead."""
        if not self.slope:
            return model
        tilt = EffectSpec("ground_tilt", (), {"forward": -math.degrees(self.slope), "left": 0.0})
        return model.with_effect(tilt)

    def progress(self, m: GaitMeasure) -> float:
        """Speed in the way asked for [m/s, for a turn rad/s]; nothing for a run that fell."""
        if m.fell:
            return 0.0
        forward, left = m.velocity
        return {"forward": forward, "backward": -forward, "sideways": left, "turn": m.turn_rate, "arc": forward}[self.way]

    def strays(self, m: GaitMeasure) -> list[Margin]:
        """How far a run is from the way asked for: heading and sideways motion, of a turn its speed, of an arc its curvature."""
        forward, left = m.velocity
        if self.way == "turn":
            return [_margin("speed while turning", float(np.hypot(forward, left)), STANDING, "m/s")]
        along, across = (left, forward) if self.way == "sideways" else (forward, left)
        out = [_margin("motion across the way", abs(across), self.limits.aside * max(abs(along), 0.01), "m/s")]
        if self.radius is not None:
            bend = m.turn_rate * self.radius / max(forward, 0.01)
            return [_margin("curvature off the arc", abs(bend - 1), self.limits.aside, "of it")]
        return [*out, _margin("drift", float(np.degrees(abs(self.drift(m)))), float(np.degrees(self.limits.drift)), "deg/m")]

    def drift(self, m: GaitMeasure) -> float:
        """Change of heading by distance that was not asked for [rad/m]; of a turn, 0."""
        if self.way == "turn":
            return 0.0
        return self.excess_turning(m) / max(abs(self.progress(m)), SLOWEST)

    def excess_turning(self, m: GaitMeasure) -> float:
        """Turning that was not asked for [rad/s], to the left; of a turn, 0."""
        if self.way == "turn":
            return 0.0
        return m.turn_rate - (0.0 if self.radius is None else max(abs(self.progress(m)), SLOWEST) / self.radius)

    def wanted(self, nominal: GaitMeasure, draws: Sequence[GaitMeasure]) -> list[Margin]:
        """Whether the speed is there, on the nominal robot and over draws; whether draws fall or wander."""
        fell, count = sum(m.fell for m in (nominal, *draws)), 1 + len(draws)
        out = [Margin("falls", f"of {count} robots", float(fell), 0.0, "allowed", 1.0 + FALLEN * fell / count if fell else 0.0)]
        if self.speed is not None:
            out.append(_least("speed", self.progress(nominal), self.speed, self.unit))
        if draws:
            if self.speed is not None:
                out.append(_least("speed of the worse half of draws", worse_half([self.progress(m) for m in draws]),
                                  ROBUST * self.speed, self.unit))
            if self.way != "turn":
                spread = float(np.sqrt(np.mean([min(self.drift(m), 10.0) ** 2 for m in draws])))
                out.append(_margin("drift over draws", np.degrees(spread), np.degrees(self.limits.spread), "deg/m RMS"))
        return out

    def cost(self, nominal: GaitMeasure, draws: Sequence[GaitMeasure], worst_rms: float) -> float:
        """What is made small among gaits that keep all limits. worst_rms: largest RMS torque by what is allowed."""
        if self.aim == "speed":
            return -worse_half([self.progress(m) for m in (draws or [nominal])])
        if self.aim == "energy":
            return nominal.power
        if self.aim == "smoothness":
            return nominal.jerk
        return worst_rms

    def __str__(self) -> str:
        if self.way == "turn":
            asked = "turn in place" + (f" at {math.degrees(self.speed):.0f} deg/s" if self.speed else " as fast as can be")
        else:
            way = self.way if self.radius is None else f"an arc of {self.radius:g} m"
            asked = f"{way}{f' at {self.speed:g} m/s' if self.speed else ' as fast as can be'}"
        asked += f", up {math.degrees(self.slope):g} deg" if self.slope else ""
        asked += f", RMS torque at most {self.limits.rms:g} N m" if self.limits.rms is not None else ""
        best = {"speed": "", "gentleness": "", "energy": ", least electrical energy", "smoothness": ", smoothest"}
        return asked + best[self.aim]


def worse_half(values: Sequence[float]) -> float:
    """Mean of the lower half."""
    ordered = np.sort(np.asarray(values, dtype=float))
    return float(ordered[:max(1, (len(ordered) + 1) // 2)].mean())


def with_rms(request: Request, rms: float | None) -> Request:
    """The request with another limit on RMS torque [N m]."""
    return replace(request, limits=replace(request.limits, rms=rms))


def _margin(name: str, value: float, limit: float, unit: str) -> Margin:
    return Margin(name, "robot", float(value), float(limit), unit, float(value / limit))


def _least(name: str, value: float, least: float, unit: str) -> Margin:
    """A limit from below: use is 1 where the value is just enough, and grows by what is missing."""
    return Margin(name, "robot", float(value), float(least), f"{unit}, at least", float(2.0 - value / least))
