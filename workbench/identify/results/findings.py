"""Results of a diagnosis (docs/formats.md, section 6), typed: the verdict, the gap, its explanation, and the unexplained rest.
`to_json` of each type is its entry in findings.json."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from workbench.effects.base import Family, Layer
from workbench.files.reading import write_together
from workbench.identify.options import CONCLUSIONS
from workbench.identify.results.reasons import Description, Reason
from workbench.robot import Posterior, RobotModel
from workbench.robot.model_file import model_text

if TYPE_CHECKING:
    from workbench.identify.results.servo_law import GravityOverTorque, Recalibrated, UnknownTorque

Verdict = Literal["no_gap", "explained", "partly_explained", "unexplained"]
Vector: TypeAlias = tuple[float, float, float]
FINDINGS, MODEL, NOMINAL = "findings.json", "model.yaml", "nominal.yaml"


@dataclass(frozen=True)
class Change:
    """Error (RMS of recorded less simulated) before and after an effect is added, in `unit` ("deg" or "m")."""

    before: float
    after: float
    unit: str

    def to_json(self) -> dict[str, Any]:
        return {"before": _number(self.before), "after": _number(self.after), "unit": self.unit}


@dataclass(frozen=True)
class Estimate:
    """A parameter in the units of docs/formats.md, section 7 (degrees). value, low, high: a number, or three of a vector; low and
    high bound 90 %, infinite where the data give no bound."""

    value: float | Vector
    low: float | Vector
    high: float | Vector
    unit: str

    def __post_init__(self) -> None:
        value, low, high = (x if isinstance(x, tuple) else (x,) for x in (self.value, self.low, self.high))
        if not len(value) == len(low) == len(high) in (1, 3):
            raise ValueError("expected value, low and high of the same shape: one number each, or three")
        for v, a, b in zip(value, low, high):
            if not (math.isfinite(v) and a <= v <= b):
                raise ValueError(f"expected a finite value between its bounds, got {a} <= {v} <= {b}")

    def to_json(self) -> dict[str, Any]:
        return {"value": _numbers(self.value), "low": _numbers(self.low), "high": _numbers(self.high), "unit": self.unit}


@dataclass(frozen=True)
class Alternative:
    """An effect that the data cannot separate from the finding's. confidence: its probability, 0 to 1."""

    effect: str
    where: tuple[str, ...]
    confidence: float

    def __post_init__(self) -> None:
        _check_confidence(self.confidence)

    def to_json(self) -> dict[str, Any]:
        return {"effect": self.effect, "where": list(self.where), "confidence": _number(self.confidence)}


@dataclass(frozen=True)
class FamilyBelief:
    """Probability that any effect of a family, which do nearly the same, is there."""

    name: Family
    confidence: float

    def __post_init__(self) -> None:
        _check_confidence(self.confidence)

    def to_json(self) -> dict[str, Any]:
        return {"name": self.name, "confidence": _number(self.confidence)}


@dataclass(frozen=True)
class Finding:
    """One effect that the nominal model lacks. where: joints, links, feet or rigid bodies; empty: the whole robot. confidence:
    probability (0 to 1) that it is there. parameters: estimates by name, each with its unit. fit: error on the frames that were
    fitted; validation: on those that neither selection nor parameters saw. alternatives: at most one, which the data cannot
    separate from it. evidence: the same in words. family: probability of any effect of its family. of_tie: where the finding is
    one of several names of a ratio in `Diagnosis.tied`, the probability that one of these is there; confidence is then this
    name's share of it."""

    effect: str
    where: tuple[str, ...]
    confidence: float
    parameters: Mapping[str, Estimate]
    fit: Change
    validation: Change
    alternatives: tuple[Alternative, ...] = ()
    evidence: str = ""
    family: FamilyBelief | None = None
    of_tie: float | None = None

    def __post_init__(self) -> None:
        _check_confidence(self.confidence)
        if self.of_tie is not None:
            _check_confidence(self.of_tie)
        if len(self.alternatives) > 1:
            raise ValueError(f"a tie is one finding with at most one alternative, got {len(self.alternatives)}")

    @property
    def tie(self) -> Alternative | None:
        """The other name of a tie of two."""
        if self.of_tie is not None:
            return None
        return next((a for a in self.alternatives if a.confidence >= CONCLUSIONS.tied * self.confidence), None)

    @property
    def together(self) -> float:
        """The finding's confidence: of a tie, that one of the two is there; the data do not say which."""
        return self.confidence + (self.tie.confidence if self.tie else 0.0)

    @property
    def likely(self) -> bool:
        """Whether the effect, or its alternative, or one of the names of its tie, is more likely there than not."""
        return max(self.of_tie or 0.0, self.confidence + sum(a.confidence for a in self.alternatives)) >= CONCLUSIONS.likely

    def to_json(self) -> dict[str, Any]:
        return {"effect": self.effect, "where": list(self.where), "confidence": _number(self.together),
                **({} if self.of_tie is None else {"of_tie": _number(self.of_tie)}),
                **({} if self.family is None else {"family": self.family.to_json()}),
                "parameters": {name: p.to_json() for name, p in self.parameters.items()},
                "alternatives": [a.to_json() for a in self.alternatives],
                "fit": self.fit.to_json(), "validation": self.validation.to_json(), **_optional("evidence", self.evidence)}


@dataclass(frozen=True)
class Rejected:
    """An effect that was tried and not kept, and why."""

    effect: str
    where: tuple[str, ...]
    reason: Reason
    validation: Change | None = None

    def to_json(self) -> dict[str, Any]:
        out = {"effect": self.effect, "where": list(self.where), "reason": self.reason.in_words()}
        return out if self.validation is None else out | {"validation": self.validation.to_json()}


@dataclass(frozen=True)
class GapEntry:
    """Where, when and in which layer a recording differs from the nominal model. when: spans of the take's clock [s]. phase: of
    the gait, empty where there is none. error, floor: RMS there, and of noise and numerics, in `unit`."""

    layer: Layer
    where: tuple[str, ...]
    take: str
    when: tuple[tuple[float, float], ...]
    error: float
    floor: float
    unit: str
    phase: str = ""

    def to_json(self) -> dict[str, Any]:
        return {"layer": self.layer, "where": list(self.where), "take": self.take,
                "when": [[round(_number(a), 4), round(_number(b), 4)] for a, b in self.when], **_optional("phase", self.phase),
                "error": _number(self.error), "floor": _number(self.floor), "unit": self.unit}


@dataclass(frozen=True)
class Unexplained:
    """RMS error of the fitted model, and the floor of noise and numerics, in `unit`; description: the signal it depends on."""

    where: tuple[str, ...]
    error: float
    floor: float
    unit: str
    description: Description

    def to_json(self) -> dict[str, Any]:
        return {"where": list(self.where), "error": _number(self.error), "floor": _number(self.floor), "unit": self.unit,
                "description": self.description.in_words()}


@dataclass(frozen=True)
class NextExperiment:
    """What to record next: motion (file beside findings.json), and the pairs of effects that it separates, with the expected log
    likelihood ratio of each (natural logarithm), where known."""

    motion: str
    base: Literal["free", "fixed"]
    separates: tuple[tuple[str, str], ...]
    log_likelihood_ratios: tuple[float, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The content of findings.json."""
        return {"motion": self.motion, "base": self.base, "separates": [list(pair) for pair in self.separates]}


@dataclass(frozen=True)
class Diagnosis:
    """Everything found in a session.

    verdict: docs/formats.md, section 6. nominal: the session's robot; model: the same with the findings' effects; posterior: of
    their parameters, in the units of section 7. gap: where and when recordings differ from the nominal model, and how much.
    findings, rejected: effects that were kept, and not kept. unexplained: residuals of the fitted model. recalibrated: servo
    constants adjusted within their tolerance. tied: the ratio of gravity to torque, which is all that angles determine. left_out:
    damaged takes, (name, reason). stopped: whether the search reached its limit of work. unknown_torques: torques of the model
    that no effect describes. provenance: versions, seed, seconds; searched: of long sessions, the seconds of each take that were
    used.
    """

    verdict: Verdict
    model: RobotModel
    nominal: RobotModel
    gap: tuple[GapEntry, ...] = ()
    findings: tuple[Finding, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    unexplained: tuple[Unexplained, ...] = ()
    next_experiment: NextExperiment | None = None
    posterior: Posterior = field(default_factory=Posterior)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    left_out: tuple[tuple[str, str], ...] = ()
    stopped: bool = False
    recalibrated: tuple[Recalibrated, ...] = ()
    tied: tuple[GravityOverTorque, ...] = ()
    unknown_torques: tuple[UnknownTorque, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Content of findings.json (docs/formats.md, section 6)."""
        out: dict[str, Any] = {
            "format": 1, "verdict": self.verdict,
            "gap": [g.to_json() for g in self.gap], "findings": [f.to_json() for f in self.findings],
            "rejected": [r.to_json() for r in self.rejected], "unexplained": [u.to_json() for u in self.unexplained],
            "next_experiment": None if self.next_experiment is None else self.next_experiment.to_json(),
            "provenance": dict(self.provenance),
        }
        seldom: dict[str, Any] = {
            "unknown_torques": [u.to_json() for u in self.unknown_torques],
            "recalibrated": [r.to_json() for r in self.recalibrated], "tied": [t.to_json() for t in self.tied],
            "stopped": self.stopped, "left_out": [{"take": name, "reason": reason} for name, reason in self.left_out]}
        return out | {key: entry for key, entry in seldom.items() if entry}

    def save(self, folder: str | Path) -> list[Path]:
        """Writes findings.json, model.yaml and nominal.yaml into `folder`, all or none; returns their paths."""
        folder = Path(folder)
        return write_together(folder, {
            FINDINGS: json.dumps(self.to_json(), indent=1, allow_nan=False, ensure_ascii=False) + "\n",
            MODEL: model_text(self.model, folder, self.posterior, self.provenance),
            NOMINAL: model_text(self.nominal, folder, provenance=self.provenance)})


def _check_confidence(value: float) -> None:
    if not 0 <= value <= 1:
        raise ValueError(f"confidence: expected a probability, got {value}")


def _optional(key: str, text: str) -> dict[str, str]:
    return {key: text} if text else {}


def _number(value: float) -> Any:
    """JSON has no infinity: null."""
    return None if math.isinf(value) else float(value)


def _numbers(value: float | Vector) -> Any:
    return [_number(v) for v in value] if isinstance(value, tuple) else _number(value)
