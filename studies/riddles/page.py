"""The page that every riddle gets: hypotheses, what the recording would show, which measurement decides, what is excluded."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.common import publish, sign
from studies.riddles.apart import Number
from studies.riddles.hypotheses import Hypothesis, Progress
from workbench.compare.footfalls import foot_phases
from workbench.recording.take import Take
from workbench.robot import RobotModel, puppy_model
from workbench.view.figures import style
from workbench.view.figures.stance import intervals
from workbench.view.report.page import Part, Picture, Provenance, Report, Section, Table

METHOD = (
    "Everything here is simulated with the puppy that ships and the ROBOTIS walk of the thesis's figure 3.4. Each recording is "
    "what the thesis's cameras would have written of such a robot: 14 rigid bodies at 120 Hz, noise of 0.12 deg and 0.1 mm about "
    "and along each axis, the start between two frames, the robot put down 7 deg askew; it is registered as any recording is. "
    "**Sigma** is the root of noise², numerical floor² (step halved and quartered) and spread² (the other contact model): noise "
    "alone gives 1 or less, and below 1.3 nothing is claimed. No number here is a measurement of the robot.")

COLOURS = (style.SIMULATED, style.RECORDED, style.ACCENT, *style.OTHERS[:3], style.COMMAND, style.OTHERS[3], style.FLOOR)

T = TypeVar("T")


@dataclass(frozen=True)
class Answer:
    """What a riddle's study found. shows, decides, excluded, open: parts of the page under those heads."""

    title: str
    headline: str
    question: str
    hypotheses: Sequence[Hypothesis]
    shows: Sequence[Part]
    decides: Sequence[Part]
    excluded: Sequence[Part]
    open: Sequence[Part]
    numbers: Mapping[str, object]
    figures: Mapping[str, Figure] = field(default_factory=dict)


def run_subject(out: Path, quick: bool, measure: Callable[[RobotModel], T], answer: Callable[[T, RobotModel], Answer]) -> str:
    """Measures on the puppy, and writes the page of what was found."""
    began = time.monotonic()
    model = puppy_model()
    return publish_answer(out, model, answer(measure(model), model), time.monotonic() - began, quick)


def publish_answer(out: Path, model: RobotModel, answer: Answer, seconds: float, quick: bool) -> str:
    """The page with its figures and numbers, whole or not at all."""
    where = Provenance.of(model, seconds=seconds, quick="yes: numbers mean nothing" if quick else "no")
    report = Report(answer.title, answer.headline, f"{answer.question}\n\n{METHOD}", provenance=where)
    table = Table(("hypothesis", "what it says"), [[h.name, h.says] for h in answer.hypotheses])
    for title, parts in (("Hypotheses and rivals", [table]), ("What the recording would show", answer.shows),
                         ("Which measurement decides", answer.decides), ("What today's data already exclude", answer.excluded),
                         ("What stays open", answer.open)):
        if parts:
            report.add(Section(title, parts))
    json.dumps(answer.numbers, allow_nan=False)  # a NaN is a measurement that failed, not a number
    return publish(out, model, report, answer.numbers, answer.figures)


def picture(figures: dict[str, Figure], name: str, figure: Figure, caption: str) -> Picture:
    """A figure for the page that is also written as a file."""
    figures[name] = figure
    return Picture(figure, caption)


def told(n: Number, digits: int = 1, scale: float = 1.0) -> str:
    """A number with its floor and spread together, where they are known."""
    value = sign(scale * n.value, digits)
    return f"{value} ± {scale * n.doubt:.{digits}f}" if np.isfinite(n.floor) else value


def times(value: float) -> str:
    """A ratio of sigmas: whole numbers from ten on."""
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}"


def shade_stance(axes: Iterable[Axes], take: Take, model: RobotModel, foot: str) -> None:
    """Shades when a foot stands."""
    phases = foot_phases(take, model)
    if foot not in phases:
        return
    for k, (a, b) in enumerate(intervals(take.since_start, phases[foot].stance)):
        for panel in axes:
            panel.axvspan(a, b, color=style.STANCE, lw=0, zorder=0.5, label=f"{foot} on the ground" if k == 0 else None)


def listed(names: Sequence[str]) -> str:
    """a, b and c."""
    return " and ".join((", ".join(names[:-1]), names[-1])) if len(names) > 1 else "".join(names)


__all__ = ["COLOURS", "METHOD", "Answer", "Progress", "listed", "picture", "publish_answer", "shade_stance", "times", "told"]
