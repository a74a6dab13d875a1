"""Results of the nominal robot in a certificate, as types: each field under a key of the file with its unit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from typing import Any, TypeVar, get_type_hints

T = TypeVar("T")


def _key(name: str) -> Any:
    """A field that stands under this key in the file."""
    return field(metadata={"key": name})


@dataclass(frozen=True)
class Nominal:
    """The nominal robot over the cycles after the first, tilt and peak current from power-on. speed: in the direction of the
    request, in `unit` (m/s, or rad/s of a turn); the others in the units of their keys. rms: by joint."""

    speed: float = _key("speed")
    unit: str = _key("unit")
    heading: float = _key("heading deg/m")
    forward: float = _key("forward m/s")
    left: float = _key("left m/s")
    turning: float = _key("turning deg/s")
    power: float = _key("electrical power W")
    mechanical_power: float = _key("mechanical power W")
    cost_of_transport: float = _key("electrical cost of transport")
    mechanical_cost_of_transport: float = _key("mechanical cost of transport")
    current: float = _key("mean supply current A")
    peak_current: float = _key("peak supply current A")
    jerk: float = _key("jerk of the base m/s^3")
    tilt: float = _key("tilt deg")
    slip: float = _key("slip m/s")
    clearance: float = _key("foot clearance mm")
    tipping: float = _key("tipping margin deg")
    rms: Mapping[str, float] = _key("RMS torque N m")

    @property
    def largest_rms(self) -> float:
        """RMS torque of the joint that has most [N m]."""
        return max(self.rms.values())


@dataclass(frozen=True)
class Stretch:
    """One section of the run from power-on. seconds [s]; torque: the largest of any joint that lasts 10 ms [N m]; tilt: largest
    [deg]; jerk: RMS of the base's [m/s^3]."""

    seconds: float = _key("seconds")
    torque: float = _key("peak torque N m")
    tilt: float = _key("tilt deg")
    jerk: float = _key("jerk of the base m/s^3")


@dataclass(frozen=True)
class Rest:
    """After the stop. speed: largest of the base [m/s]; tilt, off: of the base and of the joint that is farthest from neutral
    [deg]."""

    speed: float = _key("speed m/s")
    tilt: float = _key("tilt deg")
    off: float = _key("largest angle off neutral deg")


@dataclass(frozen=True)
class Ways:
    """The way in, the gait, the way out, and the rest. smooth: whether neither way jerks the base more than half as much again as
    the gait does."""

    start: Stretch = field(metadata={"key": "start"})
    gait: Stretch = field(metadata={"key": "gait"})
    stop: Stretch = field(metadata={"key": "stop"})
    rest: Rest = field(metadata={"key": "at rest"})
    smooth: bool = _key("without a jerk")

    @property
    def torque(self) -> float:
        """The largest of any joint from power-on on [N m]."""
        return max(part.torque for part in (self.start, self.gait, self.stop))


@dataclass(frozen=True)
class Steadiness:
    """How the gait repeats. speed [m/s], heading [deg]: standard deviations from cycle to cycle on the nominal robot;
    heading_of_draws [deg]: the median over draws. watched: cycles of each run that entered or disturbed the gait otherwise; back:
    of each, after how many it walked as from its own start, None where it did not; fell: those that lay down."""

    speed: float = _key("speed m/s, standard deviation")
    heading: float = _key("heading deg, standard deviation")
    heading_of_draws: float | None = field(
        default=None, metadata={"key": "heading deg, standard deviation, median of draws"})
    watched: int = field(default=0, metadata={"key": "watched"})
    back: Mapping[str, int | None] | None = field(default=None, metadata={"key": "cycles until it is back"})
    fell: tuple[str, ...] = field(default=(), metadata={"key": "fell"})

    @property
    def lost(self) -> tuple[str, ...]:
        """The entries from which it did not come back."""
        return tuple(entry for entry, cycles in (self.back or {}).items() if cycles is None)

    @property
    def slowest(self) -> int | None:
        """Cycles until it is back from every entry; None where it is not from one, or nobody looked."""
        known = [cycles for cycles in (self.back or {}).values() if cycles is not None]
        return max(known) if known and not self.lost else None


def to_plain(record: Any) -> dict[str, Any]:
    """A record under the keys of the file; fields with their default are left out."""
    out = {}
    for f in fields(record):
        value = getattr(record, f.name)
        if value != f.default:
            out[f.metadata["key"]] = to_plain(value) if is_dataclass(value) else value
    return out


def from_plain(kind: type[T], content: Mapping[str, Any]) -> T:
    """What `to_plain` gave, numbers that are not known as NaN. KeyError for a key that is missing or that nobody knows."""
    hints, known = get_type_hints(kind), {f.metadata["key"]: f for f in fields(kind)}  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for key, value in content.items():
        f = known[key]
        inner: Any = hints[f.name]
        nested = isinstance(inner, type) and is_dataclass(inner)
        values[f.name] = (from_plain(inner, value) if nested else tuple(value) if isinstance(value, list)
                          else math.nan if value is None and inner is float else value)
    for key, f in known.items():
        if f.name not in values and f.default is MISSING:
            raise KeyError(key)
    return kind(**values)
