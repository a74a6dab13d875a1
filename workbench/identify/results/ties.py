"""Ties of a session, and how it observed the robot: all that the design of the next experiment needs of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from workbench.compare.session import Base
from workbench.identify.problem import TakeEvidence
from workbench.robot import RobotModel


@dataclass(frozen=True)
class ObservationModel:
    """How a recording sees the robot, on one base.

    sigma: joint -> standard deviation of a frame's angle, noise and numerical floor [rad]; joints not named are not seen.
    captured: by cameras, which see the links' angles, zeroed at rest, and not the first command's time; else the servos' own log.
    rate: frames a second.
    """

    sigma: Mapping[str, float]
    captured: bool = True
    rate: float = 120.0


@dataclass(frozen=True)
class Tie:
    """Two models of one session: with a finding, and with its most probable rival instead; probability: of the rival."""

    found: RobotModel
    rival: RobotModel
    probability: float


def observation_models(evidence: Sequence[TakeEvidence]) -> dict[Base, ObservationModel]:
    """How these takes see the robot, by base; of several on one base, the last."""
    out: dict[Base, ObservationModel] = {}
    for e in evidence:
        sigma = {j: float(e.sigma[e.channels.index(j)]) for j in e.joints}
        out[e.take.spec.base] = ObservationModel(sigma, e.take.recorded.zeroed, 1.0 / e.frame_time)
    return out
