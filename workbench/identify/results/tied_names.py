"""The ratio of gravity to torque, which is all that servo logs determine, with every effect that could have changed it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from workbench.identify.results.findings import Estimate

COMPETITIVE = 7.0
"""A name this far behind the best of its tie is not mentioned in the sentence [nats]: a thousand times less probable, the same
window in which models count (`EvidenceOptions.occam`). The table lists all."""


@dataclass(frozen=True)
class TiedName:
    """One effect that alone would explain the ratio. sentence: for a person, with its size; behind [nats]: how much less likely
    the recordings are with it than with the best effect of the tie."""

    effect: str
    where: tuple[str, ...]
    parameters: Mapping[str, Estimate]
    sentence: str
    behind: float

    def to_json(self) -> dict[str, Any]:
        """As findings.json has it."""
        return {"effect": self.effect, "where": list(self.where), "behind": round(self.behind, 1),
                "parameters": {name: p.to_json() for name, p in self.parameters.items()}, "evidence": self.sentence}


@dataclass(frozen=True)
class GravityOverTorque:
    """Gravity over torque of the joints `where`, relative to the robot's files. confidence: probability that one of the effects
    is present, rather than a change of the servo's torques alone; since: whether the files are those of an earlier diagnosis."""

    where: tuple[str, ...]
    ratio: Estimate
    confidence: float
    names: tuple[TiedName, ...]
    since: bool

    def in_words(self) -> str:
        """For a person: the ratio, everything that it may come from, and how to find out."""
        low, high = self.ratio.low, self.ratio.high
        told = f"Gravity over torque in {', '.join(self.where)} is {self.ratio.value:.2f} ({low:.2f} to {high:.2f}) times " \
               f"{'that of the earlier model' if self.since else 'that of the files'}"
        each = [f"all torques of the servo times {1 / float(self.ratio.value):.2f}",  # type: ignore[arg-type]
                *(f"{n.sentence.rstrip('.')} ({n.behind:.0f} nats behind)" if n.behind >= 1 else n.sentence.rstrip('.')
                  for n in self.names if n.behind <= COMPETITIVE)]
        more = "" if self.since else ", or compare with an earlier diagnosis of this servo (`--model`)"
        return (f"{told}. Angles alone cannot separate its possible causes: {'; '.join(each)}. To find out, hang a known weight "
                f"on the link in some takes (`load:`){more}.")

    def to_json(self) -> dict[str, Any]:
        """As findings.json has it."""
        return {"ratio": "gravity over torque", "where": list(self.where), **self.ratio.to_json(),
                "confidence": float(self.confidence), "names": [n.to_json() for n in self.names], "evidence": self.in_words()}
