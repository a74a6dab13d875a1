"""Ranges of the physical constants that a user gives: beyond the possible ones an error, beyond the likely ones a warning."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from types import MappingProxyType
from typing import Any

from workbench.files.errors import InputError


@dataclass(frozen=True)
class PhysicalRange:
    """Range of a constant, in `unit`.

    least, most: possible values; a value beyond them is a mistake. above_least: whether `least` itself is impossible. low, high:
    values that small robots have; others are used with a warning. why: what the likely bounds are taken from. perhaps: the unit
    or mistake that a value above the likely ones suggests. infinite: whether infinity is a value.
    """

    unit: str
    least: float = 0.0
    most: float = math.inf
    low: float = -math.inf
    high: float = math.inf
    why: str = ""
    perhaps: str = "in another unit"
    above_least: bool = False
    infinite: bool = False

    def problem(self, value: Any) -> str | None:
        """What was expected of a value that cannot be this constant; None for one that can."""
        number = isinstance(value, Real) and not isinstance(value, bool) and not math.isnan(float(value))
        if not number or (math.isinf(float(value)) and not self.infinite):
            return f"expected a number, got {value!r}"
        if not self.infinite and value > self.most:
            return f"expected at most {_in(self.most, self.unit)}, got {value:g}"
        if value < self.least or (self.above_least and value == self.least):
            if self.least == 0:
                return f"expected a {'positive' if self.above_least else 'non-negative'} number, got {value}"
            return f"expected at least {_in(self.least, self.unit)}, got {value:g}"
        return None

    def doubt(self, value: float) -> str | None:
        """Why a possible value is unlikely; None for a likely one."""
        if value > self.high:
            return f"{_in(value, self.unit)} is more than {self.why} ({_in(self.high, self.unit)}); is it {self.perhaps}?"
        if value < self.low:
            return f"{_in(value, self.unit)} is less than {self.why} ({_in(self.low, self.unit)}); is it in another unit?"
        return None


def _in(value: float, unit: str) -> str:
    return f"{value:g} {unit}".strip()


_HOBBY = "any hobby servo has"
SERVO: Mapping[str, PhysicalRange] = MappingProxyType({
    "stall_torque": PhysicalRange("N m", most=200.0, low=0.02, high=12.0, why=_HOBBY, perhaps="in kg cm", above_least=True),
    "no_load_speed": PhysicalRange("rad/s", most=200.0, low=0.5, high=25.0, why=_HOBBY, perhaps="in rpm or deg/s",
                                   above_least=True),
    "rated_voltage": PhysicalRange("V", most=100.0, low=2.0, high=30.0, why=_HOBBY, perhaps="in mV", above_least=True),
    "supply_voltage": PhysicalRange("V", most=100.0, low=2.0, high=30.0, why=_HOBBY, perhaps="in mV", above_least=True),
    "coulomb_friction": PhysicalRange("N m", most=100.0, high=2.0, why=_HOBBY, perhaps="in kg cm"),
    "viscous_friction": PhysicalRange("N m s/rad", most=100.0, high=1.0, why=_HOBBY),
    "reflected_inertia": PhysicalRange("kg m^2", most=10.0, high=0.2, why=_HOBBY),
    "compliance_slope": PhysicalRange("counts", most=1023.0, above_least=True),
    "compliance_margin": PhysicalRange("counts", most=1023.0),
    "punch": PhysicalRange("of 1023", most=1023.0),
    "proportional_gain": PhysicalRange("duty per radian", most=1e4, high=100.0, why=_HOBBY, perhaps="in the register's own units",
                                       above_least=True),
    "minimum_duty": PhysicalRange("(full duty)", most=1.0),
    "dead_zone": PhysicalRange("deg", most=90.0),
    "goal_delay": PhysicalRange("s", most=1.0),
    "goal_ramp": PhysicalRange("deg/s", most=1e5),
    "command_filter": PhysicalRange("s", most=1.0),
    "derivative_gain": PhysicalRange("duty per rad/s", most=100.0),
    "load_friction": PhysicalRange("of the load", most=2.0),
    "torque_tolerance": PhysicalRange("(of the logarithm)", most=3.0),
    "back_emf_tolerance": PhysicalRange("(of the logarithm)", most=3.0),
})
"""Constants of a servo (docs/formats.md, section 4). Possible: ten times beyond any servo of a small robot. Likely: XH540 (11.7
N m), fast hobby servos (0.06 s/60 deg, 17 rad/s), six cells (25 V), XL-330 at its highest gain (47); at the other end servos of
2 g (0.05 N m), geared down to a turn in ten seconds, one cell."""
STRONGEST = 75.0
"""Stall torque times speed without load [W]: XH540 52, the strongest servos of model cars 66."""

LEAST_KNOWN = 100.0
"""Largest standard deviation of a servo's constant, by its value, or of its logarithm: whoever knows less should not give it."""

GROUND: Mapping[str, PhysicalRange] = MappingProxyType({
    "friction": PhysicalRange("", most=5.0, low=0.02, high=1.5, why="feet on floors have", perhaps="a typing mistake"),
    "stiffness": PhysicalRange("N/m", least=10.0, low=200.0, why="floors that robots walk on have", infinite=True),
    "dissipation": PhysicalRange("s/m", most=1e5, high=1e3, why="floors have", perhaps="in s/mm"),
})
"""The floor. Friction: PTFE on steel has 0.04, wet ice 0.02, rubber on dry concrete 0.6 to 1.2, soft racing tyres 1.7; beyond 5
it is adhesion. Stiffness: soft foam under a foot has some 1000; on 10 N/m a robot of 100 g would sink by 10 cm. Dissipation:
Hunt and Crossley's, the reciprocal of the speed from which an impact does not rebound; 1000 does not from 1 mm/s on."""

MASS = PhysicalRange("kg", most=5.0)
"""A weight attached to a link, known or found: more than any robot on hobby servos carries; a greater number is in grams."""

TIME_STEP = PhysicalRange("s", least=1e-5, most=0.01)
"""Step of a discrete simulation: with longer ones contact and servos are meaningless, with shorter ones it never ends."""


def check_ranges(ranges: Mapping[str, PhysicalRange], values: Mapping[str, Any]) -> None:
    """InputError that names the first constant whose value is impossible. None stands for one that is not given."""
    for name, value in values.items():
        text = None if value is None else ranges[name].problem(value)
        if text is not None:
            raise InputError(None, f"{name}: {text}")


def doubts(ranges: Mapping[str, PhysicalRange], values: Mapping[str, float | None]) -> list[str]:
    """A line for each constant whose value is possible but unlikely."""
    out = []
    for name, value in values.items():
        text = None if value is None else ranges[name].doubt(value)
        if text is not None:
            out.append(f"{name}: {text}")
    return out
