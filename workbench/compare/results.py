"""Results of a comparison, and their `comparison.json` (docs/formats.md, section 6)."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from workbench.compare.footfalls import FootPhases
from workbench.files.reading import write_whole
from workbench.recording.take import Take

NAN = float("nan")


@dataclass(frozen=True)
class Channel:
    """One channel of two takes: a joint's angle [rad] or the base's path [m]; NaN where it is not known.

    error: RMS of recorded less simulated after the first command. noise: RMS at rest before it, over all takes of a session.
    floor: RMS between the rollout at its step and at half and a quarter of it, the larger. spread: RMS between rollouts with one
    contact model and the other; all four in rad or m. correlation: Pearson's, -1 to 1. lag: delay of the recording behind the
    simulation [s].
    """

    error: float
    noise: float = NAN
    floor: float = NAN
    spread: float = NAN
    correlation: float = NAN
    lag: float = NAN

    @property
    def over_noise(self) -> float:
        """Error over the root of noise² + floor²; NaN where the error or both of them are not known or zero."""
        below = float(np.hypot(*np.nan_to_num([self.noise, self.floor])))
        return self.error / below if below > 0 else NAN


@dataclass(frozen=True)
class Pair:
    """One number of each take, with the simulation's numerical floor and its spread between contact models, all in one unit (m,
    rad or m/s, as the field that holds it says)."""

    recorded: float
    simulated: float
    floor: float = NAN
    spread: float = NAN


@dataclass(frozen=True)
class TakeComparison:
    """One take, recorded and simulated, both zeroed in the same way and on the recording's clock (`Take`: SI, radians, world axes
    forward, left, up).

    joints: a Channel for each joint [rad]. starts_at_sigma: standard deviation of the start [s]. Of the base link: body (its path
    [m], from where it rested), distance (straight, in the plane) and forward [m], heading (change, positive to the left) [rad],
    speed (distance over the commands' time) [m/s], smoothness (spectral arc length, no unit, at most 0). joint_smoothness: the
    same of each joint. recorded_phases, simulated_phases: when each foot stood, by its height; force_phases: by the simulated
    forces. The base's fields are None where the base is held or was not seen.
    """

    name: str
    recorded: Take
    simulated: Take
    joints: Mapping[str, Channel]
    starts_at_sigma: float = NAN
    body: Channel | None = None
    distance: Pair | None = None
    forward: Pair | None = None
    heading: Pair | None = None
    speed: Pair | None = None
    smoothness: Pair | None = None
    joint_smoothness: Mapping[str, Pair] = field(default_factory=dict)
    recorded_phases: Mapping[str, FootPhases] = field(default_factory=dict)
    simulated_phases: Mapping[str, FootPhases] = field(default_factory=dict)
    force_phases: Mapping[str, FootPhases] = field(default_factory=dict)

    @property
    def starts_at(self) -> float:
        """Time of the first command on the recording's clock [s]."""
        return self.recorded.starts_at

    def joints_by_error(self) -> list[str]:
        """Joints, the largest error over noise and floor first."""
        return by_error(self.joints, {j: c.over_noise for j, c in self.joints.items()})

    def as_dict(self) -> dict[str, Any]:
        """The take's entry in comparison.json (docs/formats.md, section 6), in degrees, metres and seconds, and more fields."""
        out: dict[str, Any] = {"name": self.name, "starts_at": _plain(self.starts_at), "base": self.recorded.base}
        out["starts_at_sigma"] = _plain(self.starts_at_sigma)
        out["joints"] = {j: _channel(self.joints[j], "deg") for j in self.joints_by_error()}
        if self.body is not None:
            out["body"] = _channel(self.body, "m")
        for key, unit in (("distance", "m"), ("heading", "deg"), ("forward", "m"), ("speed", "m/s"), ("smoothness", "SPARC")):
            pair = getattr(self, key)
            if pair is not None:
                out[key] = _pair(pair, unit)
        out["joint_smoothness"] = {j: _pair(p, "SPARC") for j, p in self.joint_smoothness.items()}
        feet = {}
        for foot in self.recorded_phases:
            by = {"recorded": self.recorded_phases, "simulated": self.simulated_phases, "simulated_by_force": self.force_phases}
            feet[foot] = {"duty_factor": {k: _plain(p[foot].duty) for k, p in by.items() if foot in p},
                          "footfalls": {k: [_plain(t) for t in p[foot].falls] for k, p in by.items() if foot in p}}
        if feet:
            out["feet"] = feet
        out["problems"] = [*self.recorded.problems]
        return out


@dataclass(frozen=True)
class Comparison:
    """All takes of a comparison. left_out: (name, reason) of each damaged one. provenance: versions, sha256 of the model, seed
    and seconds."""

    takes: tuple[TakeComparison, ...]
    left_out: tuple[tuple[str, str], ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def joints_by_error(self) -> list[str]:
        """Joints over all takes, by the root mean square of error over noise and floor, the largest first."""
        ratios: dict[str, list[float]] = {}
        for take in self.takes:
            for joint, channel in take.joints.items():
                ratios.setdefault(joint, []).append(channel.over_noise)
        known = {j: [x for x in r if math.isfinite(x)] for j, r in ratios.items()}
        return by_error(ratios, {j: float(np.sqrt(np.mean(np.square(x)))) for j, x in known.items() if x})

    def to_json(self) -> str:
        """Text of `comparison.json`; unknown values are null."""
        content = {"format": 1, "takes": [t.as_dict() for t in self.takes], "joints_by_error": self.joints_by_error(),
                   "left_out": [{"name": n, "reason": r} for n, r in self.left_out], "provenance": dict(self.provenance)}
        return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    def save(self, path: str | Path) -> Path:
        """Writes `comparison.json`, whole or not at all."""
        return write_whole(path, self.to_json())

    def table(self) -> str:
        """The comparison as text: a line for each take, then its joints, the worst first."""
        lines = []
        for take in self.takes:
            sigma = f" ± {1e3 * take.starts_at_sigma:.1f} ms" if math.isfinite(take.starts_at_sigma) else ""
            head = [f"{take.name}: first command at {take.starts_at:.4f} s{sigma}"]
            if take.body is not None:
                head.append(f"body {_mm(take.body.error)} mm (noise {_mm(take.body.noise)}, floor {_mm(take.body.floor)})")
            if take.distance is not None:
                head.append(f"distance {_mm(take.distance.recorded)} mm, simulated {_mm(take.distance.simulated)}")
            if take.heading is not None:
                recorded, simulated = np.rad2deg([take.heading.recorded, take.heading.simulated])
                head.append(f"heading {recorded:.1f} deg, simulated {simulated:.1f}")
            lines.append("; ".join(head))
            lines.append("  joint    error    noise    floor   spread   deg   lag ms")
            for joint in take.joints_by_error():
                c = take.joints[joint]
                values = "".join(f"{_or_dash(np.rad2deg(v), 9, 3)}" for v in (c.error, c.noise, c.floor, c.spread))
                lines.append(f"  {joint:5s}{values}       {_or_dash(1e3 * c.lag, 7, 1)}")
        return "\n".join(lines)


def by_error(names: Iterable[str], ratios: Mapping[str, float]) -> list[str]:
    """Names by falling ratio; those without one last."""

    def rank(name: str) -> tuple[bool, float, str]:
        ratio = ratios.get(name, NAN)
        return math.isnan(ratio), 0.0 if math.isnan(ratio) else -ratio, name

    return sorted(names, key=rank)


def _plain(value: float) -> float | None:
    """A number for JSON, seven digits; null where it is not known."""
    return float(f"{value:.7g}") if math.isfinite(value) else None


def _scale(unit: str) -> float:
    """Factor from radians to degrees; 1 for the units that stay."""
    return 180 / math.pi if unit == "deg" else 1.0


def _channel(c: Channel, unit: str) -> dict[str, Any]:
    scale = _scale(unit)
    out: dict[str, Any] = {k: _plain(scale * getattr(c, k)) for k in ("error", "noise", "floor")}
    out |= {"unit": unit, "spread": _plain(scale * c.spread)}
    return out if unit == "m" else out | {"correlation": _plain(c.correlation), "lag": _plain(c.lag)}


def _pair(p: Pair, unit: str) -> dict[str, Any]:
    scale = _scale(unit)
    return {k: _plain(scale * getattr(p, k)) for k in ("recorded", "simulated", "floor", "spread")} | {"unit": unit}


def _mm(value: float) -> str:
    return _or_dash(1e3 * value, 0, 1)


def _or_dash(value: float, width: int, digits: int) -> str:
    return f"{value:{width}.{digits}f}" if math.isfinite(value) else f"{'-':>{width}s}" if width else "-"
