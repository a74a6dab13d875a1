"""Is a gait that was searched for on the diagnosed model better on the real robot than one searched for on the nominal model?

    python -m studies.gait_from_diagnosis [--out runs/studies/sealed_predictions] [--quick]

OUT is the folder of `python -m studies.sealed_predictions`, which makes and diagnoses the robots, and which runs first where
OUT holds none. For each robot, two searches with the same budget and the same seed look for the fastest gait that keeps every
limit, one on the diagnosed and one on the nominal model; both gaits are then played on the concealed robot in MuJoCo. The page
is OUT/gaits/index.html; a study that was stopped resumes with the robot that it was at.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from studies import sealed_predictions
from studies.common import kept_result, publish, run_study
from studies.concealed_effects.sealed import Vault
from studies.other_engine.as_take import mujoco_take
from studies.sealed_predictions import CYCLES, DIAGNOSES, Played, hidden_robot, predicted, went
from workbench.compare.session import load_session
from workbench.gait.certificate import PUPPY_CLAIM
from workbench.gait.ensemble import load_ensemble
from workbench.gait.evaluate import Candidate, Evaluator
from workbench.gait.machine import GaitMachine
from workbench.gait.request import Request
from workbench.gait.search import Budget, search
from workbench.identify.results.findings import MODEL
from workbench.robot import RobotModel, load_model
from workbench.view.report.page import Provenance, Report, Section, Table

BUDGET = Budget(seeds=60, screened=6, starts=1, generations=10, draws=4)
"""Half a minute to a minute of one core, about a sixth of what `workbench optimize` takes."""
QUICK = Budget(seeds=4, screened=2, starts=1, generations=0, draws=0)
WORSE = 0.05
"""Share of the speed by which a gait is called worse than another."""


def fastest(model: RobotModel, budget: Budget, seed: int, tell: Callable[[str], None]) -> Candidate:
    """The fastest gait forward that a search finds on a model and the robots that the ensemble draws around it."""
    machine = GaitMachine(model)
    with TemporaryDirectory(prefix="workbench-") as folder:
        draws = load_ensemble().draws(model, budget.draws, seed, Path(folder), even=True)
        found = search(Evaluator(machine, Request(), draws, n_jobs=1), budget, seed, lambda what, _: tell(what))
    return found.nearest or found.best


def one(vault: Vault, name: str, out: Path, budget: Budget, tell: Callable[[str], None]) -> dict[str, Any]:
    """Both gaits of one robot, as predicted and as the robot walks."""
    session = load_session(out / "sessions" / name / "session.yaml")
    real, row = hidden_robot(vault, name, session.model), dict[str, Any]()
    for who, model in (("diagnosed", load_model(out / DIAGNOSES / name / MODEL)), ("nominal", session.model)):
        gait = fastest(model, budget, int(name[-2:]), lambda what, who=who: tell(f"{name}: {who} model: {what}"))  # type: ignore[misc]
        table = gait.table
        played = Played(table.commands(CYCLES), table.start_seconds, table.period)
        said = predicted(model, {name: played})[name]
        true = went(mujoco_take(real, played.commands, played.seconds), real, played)
        row[who] = {"keeps every limit": gait.good, "predicted": vars(said), "true": vars(true)}
    return {"name": name, "hidden": [e.effect for e in real.effects], **row}


def speed(row: Mapping[str, Any], who: str) -> float:
    """Speed of a gait on the concealed robot [m/s]; 0 for a fall."""
    true = row[who]["true"]
    return 0.0 if true["fell"] else float(true["speed"])


def study(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Robot by robot; the page is written after each."""
    if not _robots(out):
        sealed_predictions.study(out, quick, progress)
    names = _robots(out)[:1 if quick else None]
    vault, rows, said = Vault(out / "sealed"), list[dict[str, Any]](), ""
    for k, name in enumerate(names):
        def tell(what: str, k: int = k) -> None:
            progress(what, k / len(names))

        rows.append(kept_result(out / "gaits" / f"{name}.json", partial(one, vault, name, out, QUICK if quick else BUDGET, tell)))
        model = load_session(out / "sessions" / name / "session.yaml").model
        said = publish(out / "gaits", model, _report(model, rows), {"robots": rows}, {})
    return f"{summary(rows)} {said}"


def _robots(out: Path) -> list[str]:
    return sorted(p.stem for p in (out / "results").glob("robot??.json"))


def summary(rows: Sequence[Mapping[str, Any]]) -> str:
    """The counts in a line."""
    diagnosed, nominal = (np.array([speed(r, who) for r in rows]) for who in ("diagnosed", "nominal"))
    fell = [sum(r[who]["true"]["fell"] for r in rows) for who in ("diagnosed", "nominal")]
    faster, slower = int((diagnosed > nominal).sum()), int((diagnosed < (1 - WORSE) * nominal).sum())
    return (f"{len(rows)} robots: the gait from the diagnosed model is faster than the one from the nominal model on {faster}, "
            f"and slower by more than {100 * WORSE:.0f} % on {slower}; medians "
            f"{np.median(diagnosed):.3f} and {np.median(nominal):.3f} m/s; falls {fell[0]} and {fell[1]}.")


def _report(model: RobotModel, rows: Sequence[Mapping[str, Any]]) -> Report:
    report = Report("A gait from the diagnosed model", summary(rows), f"{__doc__}\n\n{PUPPY_CLAIM}", [], Provenance.of(model))
    report.add(Section("Robots", [Table(
        ["robot", "hidden", "diagnosed model: predicted [m/s]", "true [m/s]", "nominal model: predicted [m/s]", "true [m/s]"],
        [[r["name"], ", ".join(r["hidden"]),
          *(cell for who in ("diagnosed", "nominal")
            for cell in (f"{r[who]['predicted']['speed']:.3f}", "fell" if r[who]["true"]["fell"] else f"{speed(r, who):.3f}"))]
         for r in rows], "Speed over ten cycles without the first, on the concealed robot in MuJoCo.")]))
    return report


if __name__ == "__main__":
    raise SystemExit(run_study("gait_from_diagnosis", __doc__, study))
