"""The limits of a gait over the robots of an ensemble: each limit has to be kept by nine robots of ten, and none may fall."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.gait.feet import FeetMeasure
from workbench.gait.limits import Margin, allowed_rms, clearance_margin
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import GaitMeasure
from workbench.gait.request import Request
from workbench.gait.requirements import SLOWEST, drift, worse_half
from workbench.robot import RobotModel

SHARE = 0.9
"""Of the robots that must keep each limit: of 64 drawn robots six may break one, which bounds the true share at 18 % (95 %)."""
CHANCE = 0.3
"""Largest probability with which a screening may refuse a gait that nine of ten robots keep."""
OVER_DRAWS = " over draws"
"""Ends the name of a limit that is judged on draws."""
CONFIDENCE = 0.95
"""Of the bound on the share of robots that fall."""
QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)
FEWEST = 20
"""Draws from which a 5th percentile says more than the smallest value: of fewer, less than one robot is below it."""


def draw_margins(machine: GaitMachine, request: Request, draws: Sequence[GaitMeasure], screen: bool = False) -> list[Margin]:
    """Limits of the run as the robot sees them that nine in ten do better than: tilt, RMS torque, torque-speed line, foot
    clearance, slip, and contact of anything but feet. Robots that fell are counted elsewhere and left out here; none where all
    fell, or none were drawn. screen: whether only what contradicts nine in ten counts, and not what chance may do to a few."""
    standing = [m for m in draws if not m.fell]
    if not standing:
        return []
    limits = request.limits
    allowed = allowed_rms(machine, limits)

    def tilt(m: GaitMeasure) -> Margin:
        return _margin("tilt", math.degrees(m.tilt), math.degrees(limits.tilt), "deg")

    def torque(m: GaitMeasure) -> Margin:
        j = int(np.argmax(np.asarray(m.rms) / allowed))
        return _margin("RMS torque", m.rms[j], float(allowed[j]), "N m", machine.model.joints[j])

    def line(m: GaitMeasure) -> Margin:
        j = int(np.argmax(m.torque_use))
        joint = machine.model.joints[j]
        return _margin("torque-speed line", 100 * m.torque_use[j], 100 * limits.torque, "% of the torque available", joint)

    def slip(m: GaitMeasure) -> Margin:
        return slip_margin(machine, request, m, limits.slip_on_draws)

    def clearance(m: GaitMeasure) -> Margin:
        return clearance_margin(limits, m)

    judges: list[Callable[[GaitMeasure], Margin]] = [tilt, torque, line, slip]
    if all(np.isfinite(m.clearance) for m in standing):
        judges.append(clearance)
    needed = screened_count(len(standing)) if screen else _required_count(len(standing))
    out = [_ninth([judge(m) for m in standing], needed) for judge in judges]
    touched = sum(m.touched for m in standing)
    allowed_count = len(standing) - needed
    use = touched / max(allowed_count, 1) if touched <= allowed_count else 1.0 + touched / len(standing)
    out.append(Margin("other contact" + OVER_DRAWS, f"of {len(standing)} robots", float(touched), float(allowed_count),
                      "robots whose links touch", use))
    return out


def slip_margin(machine: GaitMachine, request: Request, m: GaitMeasure, allowed: float | None = None) -> Margin:
    """Speed over the ground of feet that touch it, by the speed of the body, or of the feet around it in a turn. allowed: None:
    as on the nominal robot."""
    limit = 100 * (request.limits.slip if allowed is None else allowed)
    if not np.isfinite(m.slip):
        return _margin("slip", 0.0, limit, "% of the speed")
    return _margin("slip", 100 * m.slip / max(foot_speed(machine, request, m), SLOWEST), limit, "% of the speed")


def foot_speed(machine: GaitMachine, request: Request, m: GaitMeasure) -> float:
    """Mean speed at which the body passes over a standing foot [m/s]."""
    if request.way != "turn":
        return float(np.hypot(*m.velocity))
    return abs(m.turn_rate) * machine.arm


def bound(events: int, count: int) -> float:
    """Largest probability of an event that `events` in `count` trials leave open at CONFIDENCE (Clopper and Pearson)."""
    from scipy.stats import beta

    return 1.0 if count <= events else float(beta.ppf(CONFIDENCE, events + 1, count - events))


def _required_count(count: int) -> int:
    """How many of `count` robots have to keep a limit."""
    return math.ceil(SHARE * count - 1e-9)


def screened_count(count: int) -> int:
    """How many of a few robots have to keep a limit so that nine of ten still may: of eight 7, of 24 21. A gait that nine of ten
    keep does worse with a probability of less than CHANCE."""
    from scipy.stats import binom

    return int(binom.ppf(CHANCE, count, SHARE))


def _ninth(margins: list[Margin], needed: int) -> Margin:
    """The worst margin among the best `needed`."""
    m = sorted(margins, key=lambda m: m.use)[needed - 1]
    where = f"{needed} of {len(margins)} robots"
    return replace(m, name=m.name + OVER_DRAWS, where=where if m.where == "robot" else f"{m.where}, {where}")


def _margin(name: str, value: float, limit: float, unit: str, where: str = "robot") -> Margin:
    return Margin(name, where, float(value), float(limit), unit, float(value / limit))


@dataclass(frozen=True)
class Drawn:
    """One robot of the ensemble. robot: description. measure, feet: of its run, by the compiled station, or
    by Drake where that gave up; incident: what happened, where something did."""

    robot: str
    measure: GaitMeasure
    feet: FeetMeasure
    incident: str = ""


def record_draw(model: RobotModel, measure: GaitMeasure, feet: FeetMeasure, gave_up: bool) -> Drawn:
    """The record of a run. gave_up: whether the compiled station did, because something other than a foot touched, and Drake
    played it."""
    incident = ""
    if measure.fell:
        incident = f"fell: tilt {math.degrees(measure.tilt):.0f} deg"
    elif gave_up:
        went = f"{float(np.hypot(*measure.velocity)):.2f} m/s, tilt {math.degrees(measure.tilt):.0f} deg"
        incident = f"something other than a foot touched; it went on at {went}"
    kept = replace(measure, clearance=feet.clearance, slip=feet.slip, touched=gave_up and not measure.fell)
    return Drawn(describe_robot(model), kept, feet, incident)


def describe_robot(model: RobotModel) -> str:
    """What stands out of a drawn robot: its floor and its supply."""
    words = {"ground_friction": ("friction", "friction {:.2f}"), "supply_voltage": ("voltage", "{:.1f} V"),
             "supply_sag": ("drop", "{:.2f} V sag a servo")}
    drawn_effects = [(words[e.effect], e.parameters) for e in model.effects if e.effect in words and not e.where]
    words_of = [form.format(parameters[name]) for (name, form), parameters in drawn_effects]
    return ", ".join(words_of) or "the nominal robot"


def summary(request: Request, robots: Sequence[Drawn]) -> dict[str, Any]:
    """Summary of draws for a certificate: quantiles where there are FEWEST or more, else the extremes and the median alone;
    counts with their confidence bound; and the incident of each robot that had one."""
    if not robots:
        return {"count": 0}
    measures = [d.measure for d in robots]
    standing = [d for d in robots if not d.measure.fell] or list(robots)
    values = {
        f"speed {request.unit}": [request.progress(m) for m in measures],
        "heading deg/m": [math.degrees(drift(request, d.measure)) for d in standing],
        "slip m/s": [d.feet.slip for d in standing], "foot clearance mm": [1000 * d.feet.clearance for d in standing],
        "tilt deg": [math.degrees(d.measure.tilt) for d in standing],
        "tipping margin deg": [math.degrees(d.feet.tipping) for d in standing],
        "electrical power W": [d.measure.power for d in standing],
        "largest RMS torque N m": [max(d.measure.rms) for d in standing]}
    out: dict[str, Any] = {k: _quantiles(np.array(v), len(robots)) for k, v in values.items()}
    falls = sum(m.fell for m in measures)
    out["heading deg/m RMS"] = float(np.sqrt(np.mean(np.square(values["heading deg/m"]))))
    out["worse half of speeds"] = worse_half(values[f"speed {request.unit}"])
    incidents = [{"draw": k + 1, "robot": d.robot, "what": d.incident} for k, d in enumerate(robots) if d.incident]
    return out | {"count": len(robots), "falls": falls, "falls at most": bound(falls, len(robots)), "quantiles": list(QUANTILES),
                  "incidents": incidents}


def _quantiles(values: NDArray[np.float64], count: int) -> list[float | None]:
    """Values at QUANTILES; None for those that so few draws cannot determine."""
    return [float(np.quantile(values, q)) if count >= FEWEST or q in (0.0, 0.5, 1.0) else None for q in QUANTILES]
