"""The limits of a gait, as constraints with names, joints and margins."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np

from workbench.device.tables.table_file import most_poses, other_family
from workbench.files.option_checks import check_positive
from workbench.gait.limit_cycle import LimitCycle
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import GaitMeasure
from workbench.gait.self_contact import Nearness
from workbench.gait.table import GaitTable


@dataclass(frozen=True)
class GaitLimits:
    """Limits that a gait has to keep. Each field: unit and reason. InputError for a number that is not positive.

    rms: torque of each servo [N m], RMS over the gait; None: half the torque at full duty at standstill. ROBOTIS advises a fifth,
    which its own walk of the puppy exceeds by far (the tail's 0.80 N m of 1.39); half is below the need of that walk and gives
    I²R heat of a quarter of a stalled servo's, for minutes and not for hours. The fifth is reported as advice. torque: share of
    the torque-speed line that may be used for 10 ms or longer; beyond it a servo stops following. fuse: supply current [A]
    (CM-530: 10 A). reach: distance of feet from their path [m]: a millimetre is within play and rounding. clearance: between
    links [m]: 2 mm for cables and screw heads. lift: height of each foot above the ground, at least once in each cycle [m]: 3 mm,
    twice the sag from a degree of play in a knee; where feet drag, the floor decides how they move. slip: speed over the
    ground of feet that touch it, by the body's, on the nominal robot: 0.3; a gait that slides depends on friction, which is the
    least known. slip_on_draws: the same on other robots: 0.6; zero offsets of 1.5 deg and a friction of 0.3 make feet slide at
    0.36 of the speed or more in every one of 100 gaits. bus: bit rate of the servo bus [1/s]. tilt: of the base [rad], 30 deg,
    where the feet's track no longer holds the centre of mass over them. drift: change of heading by distance on the nominal robot
    [rad/m]: 3 deg. spread: the same, RMS over draws [rad/m]: 45 deg. A turn that comes from a robot's own zero offsets and
    latency is seen on its first metre, and another `turn` corrects it. trimmed: the residual after three recorded metres and
    three corrections, RMS over draws [rad/m]: 10 deg; a tenth of a right angle in a metre is for a controller. aside: sideways
    speed by forward speed. back: cycles within which the gait walks as before when it was entered or disturbed otherwise: 8, two
    to four seconds.
    """

    rms: float | None = None
    torque: float = 1.0
    fuse: float = 10.0
    reach: float = 1e-3
    clearance: float = 2e-3
    lift: float = 3e-3
    slip: float = 0.3
    slip_on_draws: float = 0.6
    bus: float = 1e6
    tilt: float = float(np.radians(30))
    drift: float = float(np.radians(3))
    spread: float = float(np.radians(45))
    trimmed: float = float(np.radians(10))
    aside: float = 0.1
    back: int = 8

    def __post_init__(self) -> None:
        check_positive(self, *(f.name for f in fields(self) if getattr(self, f.name) is not None))


Kind = Literal["table", "run", "speed", "straying", "slope"]
"""Dependence of a limit: on the table alone, known without a simulation; on a run; on the required speed; on a turn that steering
can remove; on the slope, for which there is no nearest table."""


@dataclass(frozen=True)
class Margin:
    """Margin of a limit. name: of the limit. value, limit: in `unit`; the unit of a lower limit mentions that. where: a joint, a
    foot, two links, or the robot. use: value divided by limit; above 1 the limit is broken. advice: whether it is only a
    recommendation. kind: its dependence."""

    name: str
    where: str
    value: float
    limit: float
    unit: str
    use: float
    advice: bool = False
    kind: Kind = "run"

    @property
    def margin(self) -> float:
        """Remaining margin, as a share of the limit; negative where it is broken."""
        return 1.0 - self.use

    def __str__(self) -> str:
        return f"{self.name}, {self.where}: {self.value:.3g} of {self.limit:.3g} {self.unit}"


def allowed_rms(machine: GaitMachine, limits: GaitLimits) -> np.ndarray:
    """RMS torque (n,) [N m] that each servo may take."""
    law = machine.law
    return np.full(len(law.full_torque), limits.rms) if limits.rms is not None else law.full_torque / 2


def table_margins(machine: GaitMachine, table: GaitTable, limits: GaitLimits) -> list[Margin]:
    """Limits that need no simulation: ranges, moving speeds, reach, self-contact, bus time, the controller's memory."""
    model, out = machine.model, []
    for part in (table.cycle, table.start, table.stop):
        angles = part.angles()
        for i, joint in enumerate(model.joints):
            r = machine.ranges[joint]
            k = int(np.argmax(np.where(angles[:, i] > 0, angles[:, i] / r.upper, angles[:, i] / r.lower)))
            bound = r.upper if angles[k, i] > 0 else r.lower
            out.append(_of("range", joint, np.degrees(angles[k, i]), np.degrees(bound), "deg", float(angles[k, i] / bound)))
    no_load = machine.law.line.no_load_speed
    for i, joint in enumerate(model.joints):
        asked = float(table.cycle.rates()[:, i].max())
        out.append(_of("moving speed", joint, asked, float(no_load[i]), "rad/s"))
    for i, leg in enumerate(machine.legs):
        out.append(_of("reach", leg.foot, 1000 * float(table.reach[:, i].max()), 1000 * limits.reach, "mm from the path"))
    if not other_family(table.cycle):  # only the CM-530's program, which plays no other family, holds a table in its memory
        poses = len(table.whole)
        out.append(_of("poses", "table", poses, most_poses(len(model.joints)), "poses"))
    packet = 10 * (5 * len(model.joints) + 8) / limits.bus  # a Sync Write of goal and speed: ID and four bytes a servo
    out.append(_of("bus time", "robot", 1000 * packet, float(table.cycle.dwells_ms.min()), "ms of the shortest dwell"))
    return [replace(m, kind="table") for m in _worst(out)]


def contact_margin(near: Nearness, limits: GaitLimits) -> Margin:
    """The margin of links against each other."""
    where = " and ".join(near.links) if near.links[0] else "robot"
    return least("self-contact", where, 1000 * near.distance, 1000 * limits.clearance, "mm of clearance", "table")


def run_margins(machine: GaitMachine, measure: GaitMeasure, limits: GaitLimits) -> list[Margin]:
    """Limits that a run on the nominal robot shows: torque, RMS, current, tilt; and ROBOTIS's advice."""
    out, law = [], machine.law
    allowed = allowed_rms(machine, limits)
    for i, joint in enumerate(machine.model.joints):
        out.append(_of("RMS torque", joint, measure.rms[i], float(allowed[i]), "N m"))
        out.append(_of("torque-speed line", joint, 100 * measure.torque_use[i], 100 * limits.torque, "% of the torque available"))
        out.append(_of("RMS torque, ROBOTIS's fifth", joint, measure.rms[i], float(law.full_torque[i]) / 5, "N m", advice=True))
    if np.isfinite(measure.clearance):
        out.append(clearance_margin(limits, measure))
    out.append(_of("supply current", "robot", measure.peak_current, limits.fuse, "A"))
    out.append(_of("tilt", "robot", float(np.degrees(measure.tilt)), float(np.degrees(limits.tilt)), "deg"))
    return out


def clearance_margin(limits: GaitLimits, m: GaitMeasure) -> Margin:
    """How high the foot that is lifted least comes, at least once in each cycle."""
    return least("foot clearance", "robot", 1000 * m.clearance, 1000 * limits.lift, "mm")


def return_margin(cycle: LimitCycle, limits: GaitLimits) -> Margin:
    """The margin of the entry from which it takes the robot longest to walk as it does after its own start."""
    slowest = cycle.slowest
    if slowest.cycles is None:
        use = max(2.0, cycle.watched / limits.back)
        unit = "cycles, fell" if slowest.fell else "cycles, not returned"
        return Margin("way back to its cycle", slowest.entry, float(cycle.watched), float(limits.back), unit, use)
    return _of("way back to its cycle", slowest.entry, slowest.cycles, limits.back, "cycles")


def binding(margins: Iterable[Margin]) -> Margin | None:
    """The limit that leaves least, advice left out."""
    return max((m for m in margins if not m.advice), key=lambda m: m.use, default=None)


def violation(margins: Iterable[Margin]) -> float:
    """Sum of how many times, as a logarithm, limits are exceeded; 0 where all are kept. Of logarithms, since a drift of ten times
    the limit is not ten times as far from a good gait as one of twice the limit."""
    return sum(math.log(min(m.use, 1e3)) for m in margins if m.use > 1.0 and not m.advice)


def _of(name: str, where: str, value: float, limit: float, unit: str, use: float | None = None, advice: bool = False
        ) -> Margin:
    share = use if use is not None else value / limit if limit > 0 else np.inf
    return Margin(name, where, float(value), float(limit), unit, float(share), advice)


def least(name: str, where: str, value: float, limit: float, unit: str, kind: Kind = "run") -> Margin:
    """A lower limit: use is 1 where the value is just sufficient, and grows by the deficit, as a share of the limit; 0 from
    twice the limit on."""
    return Margin(name, where, float(value), float(limit), f"{unit}, at least", max(2.0 - float(value / limit), 0.0),
                  kind=kind)


def _worst(margins: Sequence[Margin]) -> list[Margin]:
    """The worst margin of each name and place."""
    worst: dict[tuple[str, str], Margin] = {}
    for m in margins:
        if (m.name, m.where) not in worst or m.use > worst[m.name, m.where].use:
            worst[m.name, m.where] = m
    return list(worst.values())


def each(margins: Iterable[Margin]) -> Iterator[tuple[str, Margin]]:
    """For each name the margin that leaves least."""
    by_name: dict[str, Margin] = {}
    for m in margins:
        if m.name not in by_name or m.use > by_name[m.name].use:
            by_name[m.name] = m
    yield from by_name.items()
