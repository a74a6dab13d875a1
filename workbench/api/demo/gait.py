"""The last part of the demo: a new gait, searched for in seconds, certified and exported."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from workbench.device import export
from workbench.gait.engines import other_engine
from workbench.gait.ensemble import load_ensemble
from workbench.gait.finalists import Screening
from workbench.gait.machine import GaitMachine
from workbench.gait.optimize import Optimized, OptimizeOptions, optimize, options_of, write_gait
from workbench.gait.refine import RefineOptions
from workbench.gait.request import Request
from workbench.motion import load_motion
from workbench.robot import RobotModel
from workbench.types import Progress
from workbench.view.report.gait import write_gait_page
from workbench.view.report.page import Part, Section, Text

SPEED = 0.10
"""Speed that the demo requests [m/s]: four times that of the ROBOTIS walk on this model."""


def demo_options() -> OptimizeOptions:
    """Options for a search that takes seconds: few seeds; four robots of the ensemble in the search and twenty in the
    certificate, the fewest that give a 5th percentile; no time step below half a millisecond; neither refined nor
    straightened."""
    first = options_of(1)
    return replace(first, budget=replace(first.budget, seeds=30, screened=5, generations=6, population=8, draws=4, enough=1),
                   certify=replace(first.certify, draws=20, seconds=4.0, draw_seconds=2.0, variants=("2 ms", "1 ms", "0.5 ms"),
                                   trimmed=0),
                   screening=Screening((8,), certified=2), refine=RefineOptions(iterations=0))


def gait_section(folder: Path, model: RobotModel, progress: Progress) -> Section:
    """Searches for a gait, writes it with its certificate and page into `folder`, and its firmware tables if its certificate is
    good."""
    request = Request(speed=SPEED)
    result = optimize(GaitMachine(model), request, load_ensemble(), demo_options(),
                      lambda what, done: progress(f"a new gait: {what}", done), None, other_engine())
    parts: list[Part] = [Text(_describe(result))]
    if result.table is not None and result.certified is not None:
        write_gait(folder, result.table, result.certified)
        progress("a new gait: drawing its page", None)
        write_gait_page(folder, model, result)
        if result.met:
            export(load_motion(folder / "gait.csv", model), model, folder / "firmware", result.certified.take)
            parts.append(Text("`gait/report.html` shows it in 3D, with every limit; `gait/firmware/` holds the tables for the "
                              "robot. `workbench optimize --help` lists the other requests."))
    return Section("A new gait", parts)


def _describe(result: Optimized) -> str:
    if not result.met:
        return result.problem
    assert result.certified is not None
    return "\n\n".join(result.certified.certificate.summary().splitlines())
