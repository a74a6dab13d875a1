"""The requirements of a gait: direction, speed, and what to optimise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args

from workbench.files import InputError
from workbench.files.option_checks import check_choice
from workbench.gait.limits import GaitLimits
from workbench.gait.measure import GaitMeasure
from workbench.robot import EffectSpec, RobotModel

Way = Literal["forward", "backward", "sideways", "turn", "arc"]
SIDED = ("sideways", "turn", "arc")
"""Ways that can go to the right, too."""
Aim = Literal["speed", "gentleness", "energy", "smoothness"]


@dataclass(frozen=True)
class Request:
    """One request for a gait. InputError for a value that is not among those listed, or out of range.

    way: "forward", "backward", "sideways", "turn" (in place) or "arc" (forward, curved); the last three to the left, or with
    `right` to the right. speed: at least that much [m/s, for a turn rad/s]; None: as fast as possible. radius: of an arc [m], of
    nothing else. slope: uphill [rad], negative downhill, within 60 deg. aim: quantity that is optimised once all limits and the
    speed are kept: "speed", "gentleness" (largest RMS torque by its limit), "energy" (electrical power) or "smoothness" (jerk of
    the base); all but "speed" need a speed. built_knees: whether knees bend only as in the robot's neutral pose. bias: change of
    heading by distance [rad/m], to the left, that the robot at hand has of its own: a motion that is trimmed for it turns by as
    much to the other side on a robot that has none. limits: to keep.
    """

    way: Way = "forward"
    speed: float | None = None
    radius: float | None = None
    right: bool = False
    slope: float = 0.0
    aim: Aim = "speed"
    built_knees: bool = False
    bias: float = 0.0
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
        if self.right and self.way not in SIDED:
            raise InputError(None, f"right: expected {', '.join(SIDED[:-1])} or {SIDED[-1]}, got {self.way}")
        if not -math.pi / 3 < self.slope < math.pi / 3:
            raise InputError(None, f"slope: expected within 60 deg, got {math.degrees(self.slope):g}")
        if not abs(self.bias) < math.inf or (self.bias and self.way == "turn"):
            raise InputError(None, f"bias: expected a finite number, and none of a turn in place, got {self.bias:g}")
        if self.speed is None and self.aim != "speed":
            raise InputError(None, f"the aim is {self.aim}: expected a speed to keep")

    def to_plain(self) -> dict[str, Any]:
        """Plain types, for a certificate."""
        return asdict(self)

    @staticmethod
    def from_plain(content: Mapping[str, Any]) -> Request:
        """What `to_plain` gave. InputError, TypeError or KeyError where it holds another thing."""
        return Request(**{**content, "limits": GaitLimits(**content["limits"])})

    @property
    def side(self) -> float:
        """1 for a request to the left, -1 to the right."""
        return -1.0 if self.right else 1.0

    @property
    def unit(self) -> str:
        """Unit of the speed: "m/s", for a turn "rad/s"."""
        return "rad/s" if self.way == "turn" else "m/s"

    def on_slope(self, model: RobotModel) -> RobotModel:
        """The robot on the requested slope, uphill ahead."""
        if not self.slope:
            return model
        tilt = EffectSpec("ground_tilt", (), {"forward": -math.degrees(self.slope), "left": 0.0})
        return model.with_effect(tilt)

    def progress(self, m: GaitMeasure) -> float:
        """Speed of a run in the requested direction [m/s, for a turn rad/s]; 0 for one that fell."""
        if m.fell:
            return 0.0
        forward, left = m.velocity
        return {"forward": forward, "backward": -forward, "sideways": self.side * left, "turn": self.side * m.turn_rate,
                "arc": forward}[self.way]

    def __str__(self) -> str:
        if self.way == "turn":
            asked = "turn in place" + (f" at {math.degrees(self.speed):.0f} deg/s" if self.speed else " as fast as can be")
        else:
            way = self.way if self.radius is None else f"an arc of {self.radius:g} m"
            asked = f"{way}{f' at {self.speed:g} m/s' if self.speed else ' as fast as can be'}"
        asked += " to the right" if self.right else ""
        asked += f", {'up' if self.slope > 0 else 'down'} {math.degrees(abs(self.slope)):g} deg" if self.slope else ""
        own = f"{math.degrees(abs(self.bias)):.3g} deg/m to the {'left' if self.bias > 0 else 'right'}"
        asked += f", trimmed for a robot that turns by {own}" if self.bias else ""
        asked += f", RMS torque at most {self.limits.rms:g} N m" if self.limits.rms is not None else ""
        best = {"speed": "", "gentleness": "", "energy": ", least electrical energy", "smoothness": ", smoothest"}
        return asked + best[self.aim]
