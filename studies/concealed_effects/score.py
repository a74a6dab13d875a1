"""Scores one diagnosis against the truth: name, place, size and confidence, by the rules by which the project is judged.

Named: the effect is the finding's own, or its one alternative (a tie of two). Placed: the true place is in `where`, with its
credit divided by the number of places listed. Findings below confidence 0.5 are not
counted; each one without a match is a false alarm, unless
something outside the vocabulary is hidden there, which no name fits: such a session asks for a verdict other than "explained".
`soft_ground` is neither hit nor false alarm: contact is each engine's own.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.files import InputError
from workbench.files.reading import read_text
from workbench.recording import read_recording
from workbench.recording.recording import Recording
from workbench.types import Array

NEUTRAL = frozenset({"soft_ground"})
COUNTS = 0.5
"""Confidence from which a finding counts."""
CHANCE = frozenset({"dropped_command", "power_dips"})
"""Effects that no prediction of an unseen take can know."""
SIZE = {
    "backlash": "gap", "joint_compliance": "stiffness", "coulomb_friction": "torque", "viscous_friction": "coefficient",
    "stribeck_friction": "torque", "load_friction": "coefficient", "supply_voltage": "voltage", "supply_sag": "drop",
    "torque_ceiling": "torque", "torque_saturation": "torque", "thermal_fade": "rate", "servo_gain": "ratio",
    "dead_band": "margin", "friction_asymmetry": "ratio",
    "reflected_inertia": "inertia", "joint_stop": "upper", "zero_offset": "angle", "parallel_spring": "stiffness",
    "command_delay": "delay", "timing_drift": "per_pose", "clock_rate": "ratio", "dropped_command": "probability",
    "loose_mount": "play", "link_length": "change", "payload": "mass", "ground_friction": "friction",
    "foot_friction": "friction", "ground_tilt": "forward",
}
"""The scalar parameter by which an effect's size is judged."""
ZERO = {"clock_rate": 1.0, "friction_asymmetry": 1.0}
"""Value at which an effect vanishes, where errors relative to the value itself would be meaningless."""
PARENTS = {"tail": "body"} | {
    f"{leg}{part}": f"{leg}{above}" if above else "tail" if leg[0] == "B" else "body"
    for leg in ("BL", "BR", "FL", "FR") for part, above in (("btm", "mid"), ("mid", "top"), ("top", ""))}
"""The rigid body next to each, towards the body."""
FLOOR = {"fixed": np.deg2rad(0.3), "free": np.deg2rad(0.4), "log": np.deg2rad(0.05)}
"""What two engines and the noise leave between a good prediction and the recording [rad]."""


@dataclass(frozen=True)
class EffectScore:
    """One true effect. called: its own name, that of another finding at its place, "abstained", or "failed" without a result.
    tie: it is the alternative of the finding with this name. share: of the true place in `where`; None where it was missed."""

    effect: str
    where: list[str]
    called: str
    tie: bool
    share: float | None

    @property
    def named(self) -> bool:
        """Exactly, or as one of a tie of two."""
        return self.tie or self.called == self.effect


@dataclass(frozen=True)
class ParameterScore:
    """A size that was found, its 90 % interval (infinite where it has no end) and the true one."""

    effect: str
    value: float
    low: float
    high: float
    truth: float

    @property
    def scale(self) -> float:
        """What errors are relative to."""
        return abs(self.truth - ZERO.get(self.effect, 0.0))

    @property
    def error(self) -> float:
        """Relative."""
        return abs(self.value - self.truth) / self.scale

    @property
    def inside(self) -> bool:
        """Whether the true one is in the interval."""
        return self.low <= self.truth <= self.high


@dataclass(frozen=True)
class Score:
    """One session. verdict: "failed" without a result, with the reason in `complaint`. hidden: all hidden effects, in words;
    outside: names of those outside the vocabulary; effects: those that should be named. said: the findings, in words.
    false_alarms: findings that match nothing. calibration: (confidence, true) of each finding. closed: unseen take -> share of
    the gap closed. seconds of wall and of processor, memory [bytes], code: of the version that was run."""

    name: str
    robot: str
    verdict: str
    masked: bool
    hidden: list[str]
    outside: list[str]
    effects: list[EffectScore]
    said: list[str] = field(default_factory=list)
    false_alarms: list[str] = field(default_factory=list)
    calibration: list[tuple[float, bool]] = field(default_factory=list)
    parameters: list[ParameterScore] = field(default_factory=list)
    closed: dict[str, float | None] = field(default_factory=dict)
    complaint: str = ""
    seconds: float = float("nan")
    processor_seconds: float = float("nan")
    memory: float = float("nan")
    code: str = ""

    @property
    def quiet(self) -> bool:
        """Nothing is hidden."""
        return not self.hidden

    @property
    def wrongly_explained(self) -> bool:
        """A verdict of "explained" over physics that has no name."""
        return bool(self.outside) and self.verdict in ("explained", "no_gap")

    def to_json(self) -> dict[str, Any]:
        """Plain types; an open end of an interval is null."""
        return json.loads(json.dumps(_finite(asdict(self))))  # type: ignore[no-any-return]

    @staticmethod
    def from_json(kept: Mapping[str, Any]) -> Score:
        """What to_json made, back."""
        ends = {"low": -np.inf, "high": np.inf}
        sizes = [ParameterScore(**{k: ends.get(k, v) if v is None else v for k, v in p.items()}) for p in kept["parameters"]]
        measured = {k: float("nan") if kept[k] is None else kept[k] for k in ("seconds", "processor_seconds", "memory")}
        return Score(**{**kept, **measured, "parameters": sizes, "effects": [EffectScore(**e) for e in kept["effects"]],
                        "calibration": [(float(c), bool(t)) for c, t in kept["calibration"]]})


def score(truth: Mapping[str, Any], findings: Mapping[str, Any], closed: Mapping[str, float | None] | None = None) -> Score:
    """`truth`: the sealed truth.json; `findings`: findings.json. InputError where the latter violates the contract."""
    found = [f for f in _list(findings, "findings") if f["confidence"] >= COUNTS and f["effect"] not in NEUTRAL]
    outside = set(truth["outside"])
    used: set[int] = set()
    effects, parameters = [], []
    for e in _asked(truth):
        best = max(_matches(e, found, used), default=None)
        if best is None:
            effects.append(EffectScore(e["effect"], e["where"], _instead(e, found, used), False, None))
            continue
        own, share, i = best
        used.add(i)
        effects.append(EffectScore(e["effect"], e["where"], found[i]["effect"], not own, share))
        if own and e["effect"] in SIZE:
            parameters += _size(e, found[i])
    strange = {w for e in truth["effects"] if e["effect"] in outside for w in e["where"]}
    extra = [f for i, f in enumerate(found) if i not in used]
    alarms = [f for f in extra if not (outside and (not strange or strange & set(f["where"])))]
    return Score(
        name=truth["name"], robot=truth["robot"], verdict=findings["verdict"], masked=truth["masked"],
        hidden=[_words(e) for e in truth["effects"]], outside=sorted(outside), effects=effects,
        said=[f"{_words(f)} {f['confidence']:.2f}" for f in found], false_alarms=[_words(f) for f in alarms],
        calibration=[(float(f["confidence"]), i in used) for i, f in enumerate(found)], parameters=parameters,
        closed=dict(closed or {}))


def score_nothing(truth: Mapping[str, Any], why: str) -> Score:
    """Of a session whose diagnosis failed: all that is hidden was missed."""
    effects = [EffectScore(e["effect"], e["where"], "failed", False, None) for e in _asked(truth)]
    return Score(truth["name"], truth["robot"], "failed", truth["masked"], [_words(e) for e in truth["effects"]],
                 sorted(truth["outside"]), effects, complaint=why)


def score_folder(answer: Mapping[str, bytes], results: Path, work: Path) -> Score:
    """`answer`: a session's opened seal; `results`: what `workbench diagnose` wrote; `work`: folder for the unseen takes."""
    truth = json.loads(answer["truth.json"])
    findings = json.loads(read_text(results / "findings.json"))
    closed: dict[str, float | None] = {}
    for take in truth["takes"]:
        if f"{take}.csv" in answer and not {e["effect"] for e in truth["effects"]} & CHANCE:
            closed[take] = _closed(take, truth["takes"][take]["lead"], answer, results, work)
    return score(truth, findings, closed)


def _asked(truth: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The effects that are to be named."""
    return [e for e in truth["effects"] if e["effect"] not in NEUTRAL | set(truth["outside"])]


def _words(e: Mapping[str, Any]) -> str:
    """`backlash` at ["flm"] -> "backlash flm"; with a finding's alternative behind a stroke."""
    tie = "".join(f"/{a['effect']}" for a in e.get("alternatives", [])[:1])
    return " ".join([e["effect"] + tie, *e["where"]])


def _finite(x: Any) -> Any:
    if isinstance(x, dict):
        return {k: _finite(v) for k, v in x.items()}
    if isinstance(x, (list, tuple)):
        return [_finite(v) for v in x]
    return None if isinstance(x, float) and not np.isfinite(x) else x


def _list(findings: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    value = findings.get(key)
    if not isinstance(value, list) or "verdict" not in findings:
        raise InputError(None, f"findings.json: '{key}': expected a list, and a 'verdict' with it")
    return value


def _matches(e: Mapping[str, Any], found: Sequence[Mapping[str, Any]], used: set[int]) -> list[tuple[bool, float, int]]:
    out = []
    for i, f in enumerate(found):
        tie = any(a["effect"] == e["effect"] for a in f.get("alternatives", [])[:1])
        if i not in used and (f["effect"] == e["effect"] or tie):
            out.append((f["effect"] == e["effect"], _share(e["where"], f["where"]), i))
    return out


def _share(true: Sequence[str], said: Sequence[str]) -> float:
    if not true:
        return 1.0
    return len(set(true) & set(said)) / len(said) if said else 0.0


def _instead(e: Mapping[str, Any], found: Sequence[Mapping[str, Any]], used: set[int]) -> str:
    """Name given to a missed effect: that of a finding at the same place that matches no other; else abstained."""
    for i, f in enumerate(found):
        if i not in used and _share(e["where"], f["where"]) > 0:
            return str(f["effect"])
    return "abstained"


def _size(e: Mapping[str, Any], finding: Mapping[str, Any]) -> list[ParameterScore]:
    parameter = SIZE[e["effect"]]
    got = finding["parameters"].get(parameter)
    if not got:
        return []
    low = -np.inf if got["low"] is None else float(got["low"])
    high = np.inf if got["high"] is None else float(got["high"])
    return [ParameterScore(e["effect"], float(got["value"]), low, high, float(e["parameters"][parameter]))]


def _closed(take: str, lead: float, answer: Mapping[str, bytes], results: Path, work: Path) -> float | None:
    """Share of the gap that the prediction closes, over the channels where the hidden physics shows; None where it does not.

    0 where nothing was predicted.
    """
    paths = {}
    for name in (f"{take}.csv", f"{take}.nominal.csv"):
        paths[name] = work / name
        paths[name].write_bytes(answer[name])
    recorded, nominal = (read_recording(p) for p in paths.values())
    gap = _error(nominal, recorded, lead)
    floor = FLOOR["log" if not recorded.rigid_bodies else "fixed" if "stand" in take else "free"]
    shows = [c for c in gap if gap[c] > 1.5 * floor]
    if not shows:
        return None
    path = results / "predict" / f"{take}.csv"
    if not path.exists():
        return 0.0
    fit = _error(read_recording(path), recorded, lead)
    before, after = (float(np.sqrt(np.mean([x[c] ** 2 for c in shows]))) for x in (gap, fit))
    return (before - max(after, floor)) / (before - floor)


def _error(a: Recording, b: Recording, start: float) -> dict[str, float]:
    """RMS [rad] after `start` [s]: of logs' positions, by joint; of the rotation between a rigid body and the next, by asset."""
    n = min(len(a.time), len(b.time))
    use = b.time[:n] >= start
    if not b.rigid_bodies:
        channels = [c for c in b.channels if c.startswith("position.")]
        return {c: _rms((a.channels[c][:n] - b.channels[c][:n])[use]) for c in channels}
    out = {}
    for asset in set(b.rigid_bodies) & set(PARENTS):
        between = np.einsum("nij,nij->n", _to_next(a, asset, n), _to_next(b, asset, n))
        out[asset] = _rms(np.arccos(np.clip((between - 1) / 2, -1, 1))[use])
    return out


def _to_next(recording: Recording, asset: str, n: int) -> Array:
    def matrices(name: str) -> Array:
        quat = recording.rigid_bodies[name].quat[:n]
        seen = np.isfinite(quat).all(axis=1)
        out = np.full((n, 3, 3), np.nan)
        out[seen] = Rotation.from_quat(quat[seen], scalar_first=True).as_matrix()
        return out
    return np.swapaxes(matrices(PARENTS[asset]), 1, 2) @ matrices(asset)


def _rms(x: Array) -> float:
    return float(np.sqrt(np.nanmean(np.square(x))))
