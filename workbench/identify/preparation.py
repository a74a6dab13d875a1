"""From recordings to evidence: takes beside the model's rollouts, registered, walks cut into windows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.compare.compare_session import Rollouts, roll_out, run_of
from workbench.compare.session import Session
from workbench.compare.session_takes import LeftOut, Progress, ReadTake, register_takes
from workbench.identify.options import PROBLEM
from workbench.identify.problem import TakeEvidence, gather
from workbench.identify.shooting import base_states
from workbench.recording.take import Take
from workbench.robot import InputError
from workbench.simulation import SimulationConfig
from workbench.simulation.steady import BaseStates


@dataclass(frozen=True)
class Prepared:
    """Takes beside a model's rollouts: evidence, by take the rollout of a robot left to itself, takes left out and why."""

    evidence: list[TakeEvidence]
    nominal: dict[str, Take]
    left_out: LeftOut


def prepared(session: Session, takes: Sequence[ReadTake], config: SimulationConfig, n_jobs: int, progress: Progress) -> Prepared:
    """Rolls the session's model out beside each take, registers the takes against these rollouts, and puts walks back to the
    recorded base at the beginning of each window."""
    def rolled(these: Sequence[ReadTake], steadied: Mapping[str, BaseStates | None], floors: bool = True) -> dict[str, Rollouts]:
        runs = [run_of(t, steadied.get(t.spec.name)) for t in these]
        return {r.name: of for r, of in zip(runs, roll_out(runs, config, progress=progress, n_jobs=n_jobs, floors=floors))}

    rollouts = (rolled([t for t in takes if t.spec.base != "free"], {})
                | rolled([t for t in takes if t.spec.base == "free"], {}, floors=False))
    nominal = {name: r.nominal for name, r in rollouts.items()}
    registered, left_out = register_takes(session, takes, nominal, progress)
    walking = [t for t in registered if t.spec.base == "free"]
    steadied = {t.spec.name: base_states(t.recorded) for t in walking}
    rollouts |= rolled(walking, steadied)  # held takes are judged by what they were registered with
    return Prepared(gather(registered, rollouts, steadied), nominal, left_out)


def check_duration(session: Session, evidence: Sequence[TakeEvidence]) -> None:
    """InputError where takes are so short that no conclusion could be drawn, whatever they show."""
    least = PROBLEM.block * len(PROBLEM.uses)
    longest = max(float(np.ptp(e.take.recorded.time[e.moving])) if e.moving.any() else 0.0 for e in evidence)
    if longest < least and not any(e.take.spec.use for e in evidence):
        raise InputError(session.path, f"nothing can be concluded: no take shows more than {longest:.1f} s after its first "
                                       f"command, but fitting, choosing and validating take {least:.1f} s")
