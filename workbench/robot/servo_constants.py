"""Nominal constants of a position servo (docs/formats.md, section 4)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from workbench.files import InputError
from workbench.files.yaml_file import read_yaml
from workbench.physical import LEAST_KNOWN, SERVO, STRONGEST, doubts
from workbench.robot.law_covariance import LawCovariance, law_covariance
from workbench.robot.torque_speed import TorqueSpeedLine
from workbench.robot.torque_table import TorqueTable, torque_tables

COUNT = math.radians(300 / 1023)
"""One count of goal position [rad] (AX-12A manual, 0 to 1023 over 300 degrees)."""
SPEED_UNIT = 0.111 * 2 * math.pi / 60
"""One count of moving speed [rad/s] (AX-12A manual, 0.111 rpm)."""


@dataclass(frozen=True, kw_only=True)
class ServoConstants:
    """Constants of one servo (docs/formats.md, section 4).

    model: name of the servo. stall_torque [N m] and no_load_speed [rad/s] at rated_voltage [V]; supply_voltage [V].
    coulomb_friction [N m], viscous_friction [N m s/rad] and reflected_inertia [kg m^2] at the joint. Either compliance_slope and
    compliance_margin (counts of 300/1023 deg) and punch (of 1023), or proportional_gain (duty per radian), with minimum_duty at
    the edge of the dead_zone [deg each side of the goal].

    Further behaviour of real servos, each zero unless given: goal_delay [s] after which a goal acts, goal_ramp [deg/s] at which
    the servo's own goal moves at most, command_filter [s] as the time constant of its first-order lag, derivative_gain [duty per
    rad/s] against the joint's speed, load_friction as a share of the torque that the gear transmits. torque_tables: repeatable
    torques without a name, added to all these. torque_tolerance, back_emf_tolerance: standard deviation of the natural logarithm
    of torque at full duty and of back-EMF; None: as follows from stall torque, supply and no-load speed. covariance: joint
    uncertainty of the law's constants from an earlier diagnosis. sd: standard deviation of a constant, by key, in its unit; of
    others the share in SHARES_KNOWN. InputError names the key and the expected value.
    """

    model: str = "AX-12A"
    stall_torque: float = 1.5
    no_load_speed: float = 6.18
    rated_voltage: float = 12.0
    supply_voltage: float = 11.1
    coulomb_friction: float = 0.06
    viscous_friction: float = 0.01
    reflected_inertia: float = 0.0065
    compliance_slope: float | None = 32
    compliance_margin: float | None = 1
    punch: float | None = 32
    proportional_gain: float | None = None
    minimum_duty: float = 0.0
    dead_zone: float = 0.0
    goal_delay: float = 0.0
    goal_ramp: float = 0.0
    command_filter: float = 0.0
    derivative_gain: float = 0.0
    load_friction: float = 0.0
    torque_tables: tuple[TorqueTable, ...] = ()
    torque_tolerance: float | None = None
    back_emf_tolerance: float | None = None
    covariance: LawCovariance | None = None
    sd: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        compliance = (self.compliance_slope, self.compliance_margin, self.punch)
        if self.proportional_gain is None:
            if any(v is None for v in compliance):
                raise InputError(None, "expected compliance_slope, compliance_margin and punch, or proportional_gain")
            for name, instead in (("minimum_duty", "punch"), ("dead_zone", "compliance_margin")):
                if getattr(self, name):
                    raise InputError(None, f"{name} belongs to proportional_gain; with compliance_slope expected {instead}")
        elif any(v is not None for v in compliance):
            raise InputError(None, "proportional_gain excludes compliance_slope, compliance_margin and punch")
        object.__setattr__(self, "torque_tables", torque_tables(self.torque_tables))
        for f in fields(self):
            v = getattr(self, f.name)
            if f.name in ("sd", "covariance", "torque_tables"):
                continue
            if f.name == "model":
                if not isinstance(v, str):
                    raise InputError(None, "model: expected the servo's name as text")
                continue
            if v is None and f.name in (*_LAW, *TOLERANCES):
                continue
            problem = SERVO[f.name].problem(v)
            if problem is not None:
                raise InputError(None, f"{f.name}: {problem}")

    @property
    def margin(self) -> float:
        """Half width of the dead band [rad]."""
        return (self.compliance_margin or 0.0) * COUNT + math.radians(self.dead_zone)

    @property
    def gain(self) -> float:
        """Steepness of the law outside the margin [duty per radian]."""
        if self.proportional_gain is not None:
            return self.proportional_gain
        assert self.compliance_slope is not None
        return (1 - self.punch_duty) / (self.compliance_slope * COUNT)

    @property
    def punch_duty(self) -> float:
        """Duty at the edge of the margin."""
        return (self.punch or 0.0) / 1023 + self.minimum_duty

    @property
    def ramp(self) -> float:
        """Speed of the servo's own goal [rad/s]; infinite where it follows at once."""
        return math.radians(self.goal_ramp) if self.goal_ramp else math.inf

    @property
    def torque_at_full_duty(self) -> float:
        """Stall torque at the supply voltage [N m]."""
        return self.stall_torque * self.supply_voltage / self.rated_voltage

    @property
    def back_emf(self) -> float:
        """Torque lost per joint speed by the motor's back-EMF [N m s/rad]."""
        return self.stall_torque / self.no_load_speed

    @property
    def line(self) -> TorqueSpeedLine:
        """The torque-speed line at full duty and the supply voltage."""
        return TorqueSpeedLine(self.torque_at_full_duty, self.back_emf, self.viscous_friction, self.coulomb_friction)

    def share_known(self, key: str) -> float:
        """Standard deviation of a number, as a share of its value; 0 where it is taken to be exact, or is 0. Besides the keys
        "torque_at_full_duty" and "back_emf", of which a tolerance is the standard deviation of the natural logarithm."""
        if key in _TOLERANCE_OF and getattr(self, _TOLERANCE_OF[key]) is not None:
            return float(getattr(self, _TOLERANCE_OF[key]))
        if key == "torque_at_full_duty":
            return math.hypot(self.share_known("stall_torque"), self.share_known("supply_voltage"))
        if key == "back_emf":
            return self.share_known("no_load_speed")
        value, given = float(getattr(self, key) or 0.0), dict(self.sd)
        if key not in given:
            return SHARES_KNOWN.get(key, 0.0)
        return given[key] / value if value else 0.0

    def constants(self) -> dict[str, Any]:
        """The constants by key, None for keys of the other position law; what only some servos do is left out where this one does
        not."""
        out = {key: getattr(self, key) for key in KEYS
               if key != "covariance" and (key not in _OPTIONAL or getattr(self, key) != _OPTIONAL[key])}
        return out | ({"torque_tables": [t.as_dict() for t in self.torque_tables]} if self.torque_tables else {})

    def as_dict(self) -> dict[str, Any]:
        """Content of servo.yaml."""
        known = dict(self.sd)
        together = {} if self.covariance is None else {"covariance": self.covariance.as_dict()}
        return {k: {"value": v, "sd": known[k]} if k in known else v
                for k, v in self.constants().items() if v is not None} | together

    def updated(self, changes: dict[str, Any]) -> ServoConstants:
        """The constants with some keys replaced; a switch between the two position laws drops the other's keys."""
        changes = dict(changes)
        if changes.get("proportional_gain") is not None:
            for key in ("compliance_slope", "compliance_margin", "punch"):
                changes.setdefault(key, None)
        elif any(changes.get(k) is not None for k in ("compliance_slope", "compliance_margin", "punch")):
            changes.setdefault("proportional_gain", None)
            changes = {"minimum_duty": 0.0, "dead_zone": 0.0} | changes
        unknown = sorted(set(changes) - set(KEYS))
        if unknown:
            raise InputError(None, f"unknown key '{unknown[0]}'; known: {', '.join(KEYS)}")
        return replace(self, **changes)


    @property
    def doubts(self) -> tuple[str, ...]:
        """Values that no hobby servo has, though they are not impossible: mostly in a wrong unit."""
        out = doubts(SERVO, {name: getattr(self, name) for name in SERVO})
        if (power := self.stall_torque * self.no_load_speed) > STRONGEST:
            out.append(f"stall_torque times no_load_speed: {power:.0f} W is more than any hobby servo "
                       f"has ({STRONGEST:g} W); is the torque in kg cm (0.098 N m), or the speed in another unit than rad/s?")
        if self.coulomb_friction >= self.torque_at_full_duty:
            out.append(f"coulomb_friction: {self.coulomb_friction:g} N m holds the servo against its whole torque "
                       f"({self.torque_at_full_duty:.3g} N m at {self.supply_voltage:g} V): it cannot move")
        out += [f"{key}: sd {sd:g} is more than {MOST_UNKNOWN:g} times its value: was a share meant, or another number?"
                for key, sd in self.sd if sd > MOST_UNKNOWN * abs(float(getattr(self, key) or math.inf))]
        return tuple(out)


MOST_UNKNOWN = 3.0
"""Standard deviation of a constant by its value: guesses are known to a factor of 3."""
SHARES_KNOWN = {"supply_voltage": 0.10, "no_load_speed": 0.10, "coulomb_friction": 0.5, "viscous_friction": 0.5,
                "reflected_inertia": 0.15}
"""How well a hobby servo's numbers are known where its servo.yaml does not say: supply and motor constant to what servos of one
type differ by and a battery loses, friction to a factor of 1.6, as it changes with wear and grease."""
KEYS = tuple(f.name for f in fields(ServoConstants) if f.name != "sd")
"""Of servo.yaml."""
TOLERANCES = ("torque_tolerance", "back_emf_tolerance")
_TOLERANCE_OF = {"torque_at_full_duty": "torque_tolerance", "back_emf": "back_emf_tolerance"}
_OPTIONAL = {f.name: f.default for f in fields(ServoConstants) if f.name in (
    "minimum_duty", "dead_zone", "goal_delay", "goal_ramp", "command_filter", "derivative_gain", "load_friction", "covariance",
    "torque_tables", *TOLERANCES)}
_LAW = ("compliance_slope", "compliance_margin", "punch", "proportional_gain")


def load_servo_constants(path: str | Path) -> ServoConstants:
    """Reads `servo.yaml`; InputError names the file and the key."""
    return servo_constants(read_yaml(path), Path(path))


def servo_constants(content: Any, path: Path, place: str = "") -> ServoConstants:
    """Constants from keys and values at `place` in the file `path`; InputError names file, place and key."""
    at = f"{place}: " if place else ""
    if not isinstance(content, Mapping):
        raise InputError(path, f"{at}expected a mapping of servo constants")
    for key in content:
        if key not in KEYS:
            raise InputError(path, f"{at}unknown key '{key}'; expected one of {', '.join(sorted(KEYS))}")
    missing = sorted(REQUIRED - set(content))
    if missing:
        raise InputError(path, f"{at}key '{missing[0]}' is missing")
    empty = [key for key in content if content[key] is None]
    if empty:
        raise InputError(path, f"{at}{empty[0]}: is empty; expected a value, or no such key")
    values, sd = dict(content), []
    for key, value in content.items():
        if key == "covariance":
            values[key] = law_covariance(value, path, f"{at}{key}: ", (*KEYS, *_TOLERANCE_OF, "zero"))
        elif isinstance(value, Mapping):
            values[key], known = _value_and_sd(value, path, f"{at}{key}: ")
            sd.append((key, known))
    try:
        return ServoConstants(**(dict.fromkeys(_LAW) | values), sd=tuple(sd))
    except ValueError as e:
        raise InputError(path, f"{at}{e}") from None


def _value_and_sd(content: Mapping[Any, Any], path: Path, at: str) -> tuple[Any, float]:
    """A number written {value: 11.1, sd: 1.1}."""
    if set(content) != {"value", "sd"}:
        raise InputError(path, f"{at}expected a number, or {{value: number, sd: number}}")
    sd = content["sd"]
    if isinstance(sd, bool) or not isinstance(sd, (int, float)) or not (math.isfinite(sd) and sd >= 0):
        raise InputError(path, f"{at}sd: expected a non-negative number, got {sd!r}")
    value = content["value"]
    if isinstance(value, (int, float)) and value and sd > LEAST_KNOWN * abs(value):
        raise InputError(path, f"{at}sd: expected at most {LEAST_KNOWN:g} times the value, got {sd:g}")
    return content["value"], float(sd)


REQUIRED = {"stall_torque", "no_load_speed", "rated_voltage", "supply_voltage", "coulomb_friction", "viscous_friction",
            "reflected_inertia"}
