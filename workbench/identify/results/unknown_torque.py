"""A repeatable torque that the recordings show and no known effect describes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from workbench.identify.results.findings import Change
from workbench.robot.torque_table import UNITS, TorqueTable


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
        """The entry in findings.json."""
        tables = [t.as_dict() | {"unit": UNITS[t.depends_on], "sd": list(sd)} for t, sd in zip(self.tables, self.sd)]
        return {"joint": self.joint, "confidence": float(self.confidence), "rms": float(self.rms), "unit": "N m",
                "tables": tables, "fit": self.fit.to_json(), "validation": self.validation.to_json(), "evidence": self.evidence}


def list_arguments(names: Sequence[str]) -> str:
    """The arguments of a torque in a sentence: "angle, and on duty and direction"."""
    return ", and on ".join(names)
