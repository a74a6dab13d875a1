"""The best gaits of a search, one after the other, on robots that the search did not see: the first that holds is certified."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from workbench.gait.draws import draw_margins
from workbench.gait.evaluate import SEARCH, Candidate, Evaluator
from workbench.gait.examine import CertifyOptions, Examiner, vendor_table
from workbench.gait.limits import Margin, return_margin
from workbench.gait.machine import GaitMachine
from workbench.gait.request import Request
from workbench.gait.requirements import FALLS
from workbench.gait.search import Found, steer
from workbench.gait.space import space_of
from workbench.gait.table import gait_table
from workbench.robot import RobotModel
from workbench.types import Progress

TRIMMED = 4
"""How often a finalist is steered at most until it keeps the limit on drift: a search allows ten times that limit."""


@dataclass(frozen=True)
class Screening:
    """How finalists are tried before one is certified. rounds: on so many fresh robots in all, one round after the other; a
    gait that breaks a limit in one meets no more, where a few robots may break one by chance. certified: how many gaits may be
    certified at most, which takes as long as a small search. Fresh robots are neither the search's nor the certificate's."""

    rounds: tuple[int, ...] = (8, 24)
    certified: int = 3


def finalists(machine: GaitMachine, request: Request, found: Found, fresh: Sequence[RobotModel], screening: Screening,
              options: CertifyOptions, memory: Path | None, n_jobs: int, progress: Progress) -> Iterator[Candidate]:
    """Gaits of a search that keep every limit as long and as finely as the certificate walks: trimmed on the nominal robot, which
    then has to come back to its cycle from every entry, and in rounds on fresh robots. Gaits that break a limit are yielded,
    too, with `good` false, so that the limit can be named."""
    config, space = replace(SEARCH, time_step=options.step), space_of(machine, request)
    nominal = Evaluator(machine, request, (), memory, n_jobs, config, options.seconds)
    others = Evaluator(machine, request, fresh, memory, n_jobs, config, options.draw_seconds)
    candidates = [c for c in (found.best, *found.others) if c.nominal is not None]
    for k, candidate in enumerate(candidates):
        progress(f"finalist {k + 1} of {len(candidates)}: trimmed on the nominal robot", None)
        (walked,) = steer(nominal, space, nominal.judge([candidate.shape], 0), TRIMMED)
        if walked.good and options.watched:
            progress(f"finalist {k + 1} of {len(candidates)}: back to its cycle", None)
            walked = replace(walked, margins=(*walked.margins, _way_back(machine, request, walked, options)))
        for count in screening.rounds:
            if not walked.good or not fresh:
                break
            progress(f"finalist {k + 1} of {len(candidates)}: on {count} fresh robots", None)
            (drawn,) = others.judge([walked.shape], count, list)
            lenient = draw_margins(machine, request, drawn.draws, screen=True)
            walked = _with_draws(walked, replace(drawn, margins=replace_margins(drawn.margins, lenient)))
        yield walked


def _way_back(machine: GaitMachine, request: Request, gait: Candidate, options: CertifyOptions) -> Margin:
    """The certificate's limit on the way back to the cycle, on the nominal robot. It takes seconds, where fresh robots and the
    rest of a certificate take minutes."""
    examiner = Examiner(request.on_slope(machine.model), machine.legs, gait_table(machine, gait.shape), options)
    return return_margin(examiner.limit_cycle(vendor_table(machine.model)), request.limits)


def replace_margins(margins: Sequence[Margin], others: Sequence[Margin]) -> tuple[Margin, ...]:
    """Margins of which those with the names of others make way for them."""
    names = {m.name for m in others}
    return (*(m for m in margins if m.name not in names), *others)


def _with_draws(nominal: Candidate, drawn: Candidate) -> Candidate:
    """Results of a gait from the longer walk of the nominal robot, together with those from others."""
    own = {m.name for m in nominal.margins} - {FALLS}
    margins = [m for m in nominal.margins if m.name in own] + [m for m in drawn.margins if m.name not in own]
    return replace(nominal, margins=tuple(margins), draws=drawn.draws, cost=drawn.cost)
