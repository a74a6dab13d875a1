"""The interface of both searches: the problem they are given, and the result that the rest of a diagnosis uses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from workbench.types import Progress

if TYPE_CHECKING:
    from workbench.identify.conclusions import ReadOff, Residuals
    from workbench.identify.estimators.dropped_commands import DroppedCommands, TakesAsPlayed
    from workbench.identify.evidence.options import EvidenceOptions
    from workbench.identify.fitting.doubts import Drift
    from workbench.identify.parameters import Candidate
    from workbench.identify.problem import TakeEvidence
    from workbench.identify.results.findings import Finding, Rejected, Unexplained
    from workbench.identify.results.servo_law import GravityOverTorque, Recalibrated, UnknownTorque
    from workbench.identify.results.ties import Tie
    from workbench.identify.rollouts.evaluator import RolloutEvaluator
    from workbench.recording.servo_log.duty_register import RegisterLaw
    from workbench.robot import Posterior, RobotModel


@dataclass(frozen=True)
class Problem:
    """The problem for a search. nominal: the robot with the direct estimates; residuals: its residuals, by take; pool: effects
    that may act; played: commands that never arrived, which a search may estimate again; thorough: without a limit of work;
    options: of a search of servo logs; laws: behind the duty registers of the logs, by joint."""

    evaluator: RolloutEvaluator
    nominal: RobotModel
    residuals: Residuals
    pool: Sequence[Candidate]
    played: TakesAsPlayed
    thorough: bool
    progress: Progress
    options: EvidenceOptions
    laws: Mapping[str, RegisterLaw]


@dataclass(frozen=True)
class SearchResult(ABC):
    """Result of a search. nominal: the robot without the effects; looked_at: the takes, as far as the search looked at them;
    missed: commands that never arrived; drifts: parameters that drift within a take; stopped: whether the limit of work ended the
    search."""

    nominal: RobotModel
    looked_at: tuple[TakeEvidence, ...]
    missed: tuple[DroppedCommands, ...]
    drifts: Sequence[Drift]
    stopped: bool

    @property
    @abstractmethod
    def model(self) -> RobotModel:
        """The robot with the effects that were found, in addition to the commands that never arrived."""

    @property
    def calibrated(self) -> RobotModel:
        """The same, with how well its servos' numbers are known now."""
        return self.model

    @property
    def recalibrated(self) -> tuple[Recalibrated, ...]:
        """Numbers of the nominal law that are used otherwise."""
        return ()

    @property
    def tied(self) -> tuple[GravityOverTorque, ...]:
        """What angles tell as one number, with all effects that could be it."""
        return ()

    def takes_of(self, evaluator: RolloutEvaluator) -> RolloutEvaluator:
        """Whole takes with their commands as the search read them."""
        return evaluator

    @abstractmethod
    def left_by(self, evaluator: RolloutEvaluator, progress: Progress) -> tuple[Residuals, Residuals]:
        """Residuals (N, c) and numerical floors (c,) of the model on whole takes, over sigma."""

    @abstractmethod
    def findings(self, evidence: Sequence[TakeEvidence], before: Residuals, after: Residuals) -> tuple[Finding, ...]:
        """The model's effects. before, after: residuals of the nominal model and of this one."""

    def unknown_torques(self, evidence: Sequence[TakeEvidence], before: Residuals, after: Residuals) -> tuple[UnknownTorque, ...]:
        """Torques in the model that no effect describes; before, after as in `findings`."""
        return ()

    @abstractmethod
    def unexplained(self, evidence: Sequence[TakeEvidence], after: Residuals, floors: Residuals) -> tuple[Unexplained, ...]:
        """Residuals beyond noise and numerical error, and doubts about the fitted effects."""

    @abstractmethod
    def is_slight(self) -> bool:
        """Whether all that shows on frames that were searched is too little for a name."""

    @abstractmethod
    def rejected(self, before: Residuals) -> tuple[Rejected, ...]:
        """Effects that were tried and are not in the model, and why."""

    @abstractmethod
    def posterior(self, read_off: Sequence[ReadOff]) -> Posterior:
        """Joint posterior of the model's effects; read_off: those that were estimated directly."""

    @abstractmethod
    def ties(self) -> tuple[Tie, ...]:
        """Findings and their rivals that are worth an experiment."""
