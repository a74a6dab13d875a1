"""Of the best gaits of a search, the one that keeps its limits in the certificate's longer and finer run, too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from workbench.gait.evaluate import SEARCH, Candidate, Evaluator
from workbench.gait.examine import CertifyOptions
from workbench.gait.machine import GaitMachine
from workbench.gait.request import Request
from workbench.gait.search import Found, steered
from workbench.gait.space import space_of


def finely(machine: GaitMachine, request: Request, found: Found, options: CertifyOptions, memory: Path | None, n_jobs: int
           ) -> Found:
    """A search sees two seconds at 2 ms, in which a gait may not yet have found its rhythm. The best gaits are walked as long and
    at the step that the certificate has, on the nominal robot, and steered by that; the first that keeps every limit is the best
    then. Where none does, the search's best stays."""
    evaluator = Evaluator(machine, request, (), memory, n_jobs, replace(SEARCH, time_step=options.step), options.seconds)
    best = [found.best, *found.others]
    walked = steered(evaluator, space_of(machine, request), evaluator.judged([c.shape for c in best], 0))
    kept = [_with_draws(fine, c) for fine, c in zip(walked, best) if fine.good]
    return replace(found, best=kept[0]) if kept else found


def _with_draws(fine: Candidate, c: Candidate) -> Candidate:
    """What is known of a gait on the nominal robot, with what the search knows of it on others."""
    told = {m.name for m in fine.margins}
    return replace(fine, margins=(*fine.margins, *(m for m in c.margins if m.name not in told)), draws=c.draws, cost=c.cost)
