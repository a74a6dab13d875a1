"""The 3D replays of a diagnosis: the fitted model, the recorded robot as a ghost, and the errors at its joints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from workbench.compare.channels import BODY
from workbench.identify.results.findings import Diagnosis
from workbench.identify.results.take_report import TakeReport
from workbench.types import Progress
from workbench.view.figures import film_strip
from workbench.view.figures.errors import LIMIT
from workbench.view.figures.heat import DARKEST
from workbench.view.report.page import Replay
from workbench.view.scene.marks import Errors
from workbench.view.scene.replay import write_replay


def write_replays(diagnosis: Diagnosis, takes: Sequence[TakeReport], folder: Path, progress: Progress) -> list[Replay]:
    """Writes replay-TAKE.html of each take into the folder; returns them as parts of the page."""
    replays = []
    for i, take in enumerate(takes):
        progress(f"drawing {take.name}", i / len(takes))
        path, errors = folder / f"replay-{take.name}.html", _errors(take)
        write_replay(path, diagnosis.model, take.fitted, take.recorded, take.name, errors)
        replays.append(Replay(path, _replay_caption(take, errors), film_strip(diagnosis.model, take.fitted, take.recorded)))
    return replays


def _errors(take: TakeReport) -> list[Errors]:
    """Legend of the replay's error map: that of the nominal model, and on demand that of the fitted one."""
    out = [Errors("error against the nominal model", take.time, take.channels, take.before)]
    if not np.array_equal(take.before, take.after, equal_nan=True):
        out.append(Errors("error against the fitted model", take.time, take.channels, take.after, shown=False))
    return out


def _replay_caption(take: TakeReport, errors: Sequence[Errors]) -> str:
    said = (f"{take.name} in 3D: the fitted model solid, the recorded robot as a ghost. The spheres at its joints show the "
            f"error map above over time: small and pale while a joint is within {LIMIT:g} times noise and numerical error of "
            f"the nominal model, large and dark at {DARKEST:g} times, grey while it was not seen.")
    if any(c in BODY for c in take.channels):
        said += " The sphere at the body shows the error of its tilt and height, the disc under it that of its path and heading."
    return said + (" Tick the error against the fitted model to see the residuals." if len(errors) > 1 else "")
