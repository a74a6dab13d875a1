"""Constants of the servo law that a diagnosis adjusted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


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
        """The entry in findings.json."""
        return {"number": self.number, "where": list(self.where), "nominal": self.nominal, "value": self.value, "sd": self.sd,
                "unit": self.unit} | ({"at_end": True} if self.at_end else {})
