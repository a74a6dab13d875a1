"""Time to fit two frictions of one joint to a log, by this library and by MuJoCo's toolbox."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.arm import EXTRA, ODD, SERVO, TRUE_STEP, Log, arm, goals, measured, session
from benchmarks.figure import Figure, in_turns, median_and_quartiles
from workbench.compare.compare_session import roll_out, run_of
from workbench.compare.session import Session
from workbench.compare.session_takes import read_takes, register_takes
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.options import PROBLEM
from workbench.identify.preparation import gather
from workbench.identify.problem import TakeEvidence
from workbench.identify.proposals import candidates
from workbench.identify.rollouts.evaluator import RolloutEvaluator
from workbench.identify.selection.options import SUBSETS
from workbench.simulation import SimulationConfig
from workbench.types import Array

if TYPE_CHECKING:
    from studies.other_engine.sysid import Identified

NAME = "fit_against_mujoco_sysid"
MEANING = ("wall seconds of this library's fit of two frictions of one joint over those of mujoco.sysid, at the same step, from "
           "the same log and the same nominal robot")
FRICTION = SERVO["coulomb_friction"], SERVO["viscous_friction"]
"""Nominal Coulomb [N m] and viscous [N m s/rad] friction."""
TRUTH = FRICTION[0] + EXTRA[0], FRICTION[1] + EXTRA[1]
CONFIG = SimulationConfig(settle=0.6, contact_period=0, time_step=PROBLEM.time_step)
"""Simulation settings with which `diagnose` fits."""


@dataclass(frozen=True)
class Ours:
    """This library's fit. friction: Coulomb [N m] and viscous [N m s/rad]. residual: RMS [rad]. rollouts: how many it took."""

    fit: Fit
    friction: tuple[float, float]
    residual: float
    rollouts: int


def fit_against_mujoco_sysid(duration: float, repeats: int, seed: int, iterations: int = SUBSETS.most_steps) -> Figure:
    """duration: of the log [s]. The log is simulated by MuJoCo in steps of TRUE_STEP, so that nothing in it favours this library.
    iterations: the most that this library's fit makes."""
    try:
        from studies.other_engine.sysid import Identification
    except ImportError as e:
        return Figure(NAME, MEANING, skipped=f'MuJoCo\'s twin is in the source tree, its toolbox in "mujoco[sysid]" ({e})')
    with TemporaryDirectory() as place:
        folder = Path(place)
        model, told = arm(folder), goals(duration)
        truth = Identification(model, ODD, told.commands, TRUE_STEP).played(TRUTH, told.time)
        log = measured(told, truth, seed)
        theirs = Identification(model, ODD, log.commands, PROBLEM.time_step)
        finer = Identification(model, ODD, log.commands, PROBLEM.time_step * PROBLEM.fine)
        mine = session(folder, log)
        began = time.perf_counter()
        evidence = _evidence(mine)
        before = time.perf_counter() - began
        nominal_rms = _rms(log, theirs.played(FRICTION, log.time))
        ours_kept: list[Ours] = []
        theirs_kept: list[Identified] = []
        cpu: dict[str, list[float]] = {"ours": [], "theirs": []}

        def clocked(name: str, run: Callable[[], object]) -> None:
            start = time.process_time()
            run()
            cpu[name].append(time.process_time() - start)

        runs = {"ours": lambda: clocked("ours", lambda: ours_kept.append(_fitted(mine, evidence, iterations))),
                "theirs": lambda: clocked("theirs", lambda: theirs_kept.append(theirs.fitted(log.time, log.angles)))}
        seconds = in_turns(runs, repeats, time.perf_counter, warm=False)
        our, their = ours_kept[-1], theirs_kept[-1]
        (last, last_seconds), (fine, fine_seconds) = (
            _timed(lambda: _refined(mine, evidence, our.fit)), _timed(lambda: finer.fitted(log.time, log.angles)))
    value, quartiles = median_and_quartiles(seconds["ours"] / seconds["theirs"])

    def row(r: Ours | Identified) -> dict[str, Any]:
        return {"error": {n: f / t - 1 for n, f, t in zip(("coulomb", "viscous"), r.friction, TRUTH)},
                "residual_rms_deg": float(np.degrees(r.residual)), "rollouts": r.rollouts}

    def clocks(name: str, rollouts: int) -> dict[str, float]:
        used = float(np.median(cpu[name]))
        return {"wall_seconds": float(np.median(seconds[name])), "process_seconds": used,
                "process_milliseconds_per_rollout": used / rollouts * 1e3}

    spent = {n: float(np.median(c)) for n, c in cpu.items()}
    details = {
        "log_seconds": duration, "turns": repeats, "n_jobs": 1, "step_seconds": PROBLEM.time_step,
        "truth": {"coulomb": TRUTH[0], "viscous": TRUTH[1]}, "nominal": {"coulomb": FRICTION[0], "viscous": FRICTION[1]},
        "residual_rms_deg_before": float(np.degrees(nominal_rms)),
        "ours": row(our) | clocks("ours", our.rollouts), "mujoco_sysid": row(their) | clocks("theirs", their.rollouts),
        "process_seconds_ratio": spent["ours"] / spent["theirs"], "our_preparation_wall_seconds": before,
        f"at_{1e3 * PROBLEM.time_step * PROBLEM.fine:g}_ms": {"ours": row(last) | {"wall_seconds_more": last_seconds},
                                         "mujoco_sysid": row(fine) | {"wall_seconds": fine_seconds}},
        "differs": f"the log is MuJoCo's at {1e3 * TRUE_STEP:g} ms. Ours: a damped Gauss-Newton with long differences and "
                   "Broyden updates, few rollouts, each of a newly built Drake station; the error of its step on the nominal "
                   "robot, known from finer rollouts in the preparation, is subtracted, and a lag of up to 2 ms is allowed. "
                   "Theirs: new differences in each step, all in one call of C, on one thread here; the error of the step is "
                   "not corrected, and each joint is weighted by its own RMS. Both times include building the models."}
    return Figure(NAME, MEANING, value, quartiles, details=details)


def _evidence(mine: Session) -> list[TakeEvidence]:
    """The log as `diagnose` weights it, but with every frame used for the fit, as in MuJoCo's toolbox."""
    takes, _ = read_takes(mine)
    by_name = dict(zip((t.spec.name for t in takes), roll_out([run_of(t) for t in takes], CONFIG, n_jobs=1)))
    registered, _ = register_takes(mine, takes, {name: r.nominal for name, r in by_name.items()})
    return [replace(e, uses={"fit": e.moving, "choose": np.zeros_like(e.moving), "validate": np.zeros_like(e.moving)})
            for e in gather(registered, by_name)]


def _fitted(mine: Session, evidence: list[TakeEvidence], iterations: int) -> Ours:
    """A fit from the nominal robot that reuses no earlier rollout."""
    evaluator = RolloutEvaluator(evidence, CONFIG, 1)
    search = Search(evaluator, mine.model)
    pool = {c.name: c for c in candidates(mine.model, evidence) if c.joint == ODD}
    start = search.evaluate([(pool[name], np.zeros(1)) for name in ("coulomb_friction", "viscous_friction")])
    return _told(evaluator, search.refit(start, search.fitted, iterations))


def _refined(mine: Session, evidence: list[TakeEvidence], fit: Fit) -> Ours:
    evaluator = RolloutEvaluator(evidence, CONFIG, 1)
    return _told(evaluator, Search(evaluator, mine.model).refine(fit))


def _told(evaluator: RolloutEvaluator, fit: Fit) -> Ours:
    (coulomb,), (viscous,) = (c.values(x) for c, x in fit.sizes())
    left = np.sqrt(np.nanmean(np.square(fit.residuals[0] * evaluator.evidence[0].sigma)))
    return Ours(fit, (FRICTION[0] + coulomb, FRICTION[1] + viscous), float(left), evaluator.memory.rollouts)


def _timed(run: Callable[[], Any]) -> tuple[Any, float]:
    began = time.perf_counter()
    return run(), time.perf_counter() - began


def _rms(log: Log, angles: Array) -> float:
    return float(np.sqrt(np.mean(np.square(log.angles - angles))))
