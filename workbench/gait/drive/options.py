"""Weights and limits of the controller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from workbench.files.option_checks import check_choice, check_positive, check_whole

Law = Literal["mpc", "proportional"]


@dataclass(frozen=True)
class DriveOptions:
    """How the controller weighs and limits.

    law: "mpc", or "proportional" with the same observer. horizon: cycles looked ahead; a robot that walks 5 cm a cycle needs 0.6
    m to move 10 cm aside. most: largest turn [rad per stance]. most_change: from one cycle to the next [rad]; beyond it the feet
    of two tables no longer meet. most_side, most_side_change: the same of the sideways stride [m per stance], which moves the
    puppy aside by 1.6 times as much in a cycle: random puppies walk aside by up to 7 mm on their own. aside, turned: errors that
    weigh the same [m], [rad]: 3 cm and 6 deg. change, side_change: change of turn [rad] and of sideways stride [m] that weighs as
    much. reach: distance over which the proportional law removes a lateral error [m]; below 0.5 m the two cycles of delay make it
    oscillate. drift: how fast the robot's own bias may change [rad per cycle], with voltage and floor. first_bias: standard
    deviation of the bias before the first observation [rad per cycle]. first_gain: standard deviation of the share by which the
    robot's response to a turn differs from the map's; random puppies have 0.86 to 1.2 times the nominal gain. noise: of a
    captured heading [rad]. stride_gain: share of the difference between a measured step and its estimate by which the estimate
    changes; at 0.2 the scatter of a step, about 3 mm, leaves an estimate within 1 mm. lost: cycles without a pose after which the
    robot stops; it walks 20 cm in four. clearance: from a disc to the robot's origin beyond the disc's radius [m]: half of the
    puppy's width with its feet, 12 cm. inside: weight of 1 m inside a disc's clearance, as a multiple of the cost of the error
    weights; large, so that a disc is entered only where the limits leave no other way.
    """

    law: Law = "mpc"
    horizon: int = 12
    most: float = 0.15
    most_change: float = 0.08
    most_side: float = 0.008
    most_side_change: float = 0.003
    aside: float = 0.03
    turned: float = 0.1
    change: float = 0.1
    side_change: float = 0.004
    reach: float = 0.6
    drift: float = 0.002
    first_bias: float = 0.05
    first_gain: float = 0.15
    noise: float = 0.0021
    stride_gain: float = 0.2
    blind: float = 1.5
    clearance: float = 0.12
    inside: float = 1000.0

    def __post_init__(self) -> None:
        check_choice("law", self.law, ("mpc", "proportional"))
        check_whole(self, horizon=2)
        check_positive(self, "most", "most_change", "most_side", "most_side_change", "aside", "turned", "change", "side_change",
                       "reach", "drift", "first_bias", "first_gain", "noise", "stride_gain", "blind", "clearance", "inside")
