"""What servo logs say of the servos beyond named effects: constants that were adjusted, torques that no known effect describes,
and the ratio of gravity to torque, which is all that angles determine, with every effect that could have changed it. `to_json`
of each type is its entry in findings.json."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from workbench.robot.torque_table import UNITS, TorqueTable

if TYPE_CHECKING:
    from workbench.identify.results.findings import Change, Estimate


@dataclass(frozen=True)
class Recalibrated:
    """A constant of the servo law (its key in servo.yaml) that was adjusted, as far as its `sd` allows: no finding. at_end:
    whether it went to the end of that, so that the servo's own may lie beyond, and findings there stand for the difference."""

    number: str
    where: tuple[str, ...]
    nominal: float
    value: float
    sd: float
    unit: str
    at_end: bool = False

    @property
    def sigmas(self) -> float:
        """How many standard deviations it was adjusted by."""
        return (self.value - self.nominal) / self.sd

    def to_json(self) -> dict[str, Any]:
        return {"number": self.number, "where": list(self.where), "nominal": self.nominal, "value": self.value, "sd": self.sd,
                "unit": self.unit} | ({"at_end": True} if self.at_end else {})


@dataclass(frozen=True)
class UnknownTorque:
    """A torque at one joint that no effect describes. confidence: probability (0 to 1) that such a torque is there; rms [N m]:
    over the recorded motion; tables: the torque, as model.yaml has it; sd [N m]: standard deviations of each table's torques;
    fit, validation: as in `Finding`."""

    joint: str
    confidence: float
    rms: float
    tables: tuple[TorqueTable, ...]
    sd: tuple[tuple[float, ...], ...]
    fit: Change
    validation: Change

    def __post_init__(self) -> None:
        if not 0 <= self.confidence <= 1:
            raise ValueError(f"confidence: expected a probability, got {self.confidence}")
        if [len(t.torque) for t in self.tables] != [len(s) for s in self.sd]:
            raise ValueError("sd: expected a number for each torque")

    @property
    def depends_on(self) -> tuple[str, ...]:
        """The arguments of the torque."""
        return tuple(t.depends_on for t in self.tables)

    @property
    def evidence(self) -> str:
        """For a person."""
        return f"{self.joint} has a torque of {1e3 * self.rms:.2g} mN m RMS that depends on {list_arguments(self.depends_on)}, " \
               "which no known effect describes."

    def to_json(self) -> dict[str, Any]:
        tables = [t.as_dict() | {"unit": UNITS[t.depends_on], "sd": list(sd)} for t, sd in zip(self.tables, self.sd)]
        return {"joint": self.joint, "confidence": float(self.confidence), "rms": float(self.rms), "unit": "N m",
                "tables": tables, "fit": self.fit.to_json(), "validation": self.validation.to_json(), "evidence": self.evidence}


def list_arguments(names: Sequence[str]) -> str:
    """The arguments of a torque in a sentence: "angle, and on duty and direction"."""
    return ", and on ".join(names)


@dataclass(frozen=True)
class TiedName:
    """One effect that alone would explain the ratio. sentence: for a person, with its size; behind [nats]: how much less likely
    the recordings are with it than with the likeliest cause."""

    effect: str
    where: tuple[str, ...]
    parameters: Mapping[str, Estimate]
    sentence: str
    behind: float

    def to_json(self) -> dict[str, Any]:
        return {"effect": self.effect, "where": list(self.where), "behind": round(self.behind, 1),
                "parameters": {name: p.to_json() for name, p in self.parameters.items()}, "evidence": self.sentence}


@dataclass(frozen=True)
class GravityOverTorque:
    """Gravity over torque of the joints `where`, relative to the robot's files. confidence: probability that one of the effects
    is present, rather than a change of the servo's torques alone; since: whether the files are those of an earlier diagnosis;
    window [nats]: causes this far behind the likeliest are no longer competitive (`EvidenceOptions.occam`); torque_behind [nats]:
    how much less likely other torques of the servo are than the likeliest cause; weighed: whether takes with different known
    weights tell torque from gravity."""

    where: tuple[str, ...]
    ratio: Estimate
    confidence: float
    names: tuple[TiedName, ...]
    since: bool
    window: float = math.inf
    torque_behind: float = 0.0
    weighed: bool = False

    @property
    def competitive(self) -> tuple[TiedName, ...]:
        """The names that the recordings leave possible."""
        return tuple(n for n in self.names if n.behind < self.window)

    @property
    def change(self) -> str:
        """The ratio in a sentence."""
        low, high = self.ratio.low, self.ratio.high
        joints, before = ", ".join(self.where), "earlier model" if self.since else "files"
        ratio = f"{self.ratio.value:.2f} ({low:.2f} to {high:.2f}) times that of the {before}"
        if low <= 1.0 <= high:  # type: ignore[operator]
            return f"Gravity acts differently on {joints} than in the {before}, while the ratio of gravity to torque is {ratio}."
        return f"The ratio of gravity to torque in {joints} is {ratio}."

    @property
    def may_be_torque(self) -> bool:
        """Whether other torques of the servo are a possible cause."""
        return self.torque_behind < self.window

    @property
    def may_be_several(self) -> bool:
        """Whether a cause may account for a part alone, and the servo's torques for the rest: each cause is compared as the only
        one, and nothing but a known weight or an earlier diagnosis tells how strong the servo is."""
        return self.may_be_torque and not self.since and not self.weighed

    def in_words(self) -> str:
        """For a person: the ratio, everything that it may come from, and how to find out."""
        torque = f"all torques of the servo multiplied by {1 / float(self.ratio.value):.2f}"  # type: ignore[arg-type]
        causes = [(torque, self.torque_behind)] if self.may_be_torque else []
        causes += [(n.sentence.rstrip("."), n.behind) for n in self.competitive]
        each = [f"{cause} ({behind:.0f} nats behind)" if behind >= 1 else cause for cause, behind in causes]
        if len(each) == 1 and not self.may_be_several:
            return f"{self.change} The recordings leave only one possible cause: {each[0]}."
        more = "" if self.since else ", or compare with an earlier diagnosis of this servo (`--model`)"
        causes_said = f"Angles alone do not distinguish between the possible causes: {'; '.join(each)}."
        if len(each) == 1:
            causes_said = (f"The recordings leave only one cause that explains it alone: {each[0]}; a load, a displaced centre "
                           "of mass or a spring may account for part of it, since angles determine only the ratio.")
        return f"{self.change} {causes_said} To find out, hang a known weight on the link in some takes (`load:`){more}."

    def to_json(self) -> dict[str, Any]:
        return {"ratio": "gravity over torque", "where": list(self.where), **self.ratio.to_json(),
                "confidence": float(self.confidence), "torque_behind": round(self.torque_behind, 1),
                "names": [n.to_json() for n in self.names], "evidence": self.in_words()}
