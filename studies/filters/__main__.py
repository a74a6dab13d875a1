"""The thesis's input filters (chapters 6.7, 6.8 and 7.2.2): what each window does to a motion, and to the walk that comes of it.

    python -m studies.filters [--out runs/studies/filters] [--quick]

Two inputs, as there: the ROBOTIS walk, looped, and a capture of it at 120 Hz. The capture is synthetic, the servo-law simulation
with noise, so that its true velocity is known. Quick: a second and a half, walks of half a second.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from studies.common import run_study
from studies.filters.figures import draw_bodies, draw_velocities
from studies.filters.measure import capture, study
from studies.filters.report import report
from studies.inputs import SECONDS, first_seconds, robotis
from workbench.files.reading import write_whole
from workbench.robot import puppy_model


def filters(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Runs the study and writes figures, table and numbers."""
    model = puppy_model()
    seconds = 0.5 if quick else SECONDS
    shown = 1.5 if quick else SECONDS
    angles, spline = (first_seconds(path, shown) for path in robotis())
    progress("capturing", None)
    raw, truth, alone = capture(model, shown)
    results = [study(model, "ROBOTIS angles", angles, ("a smooth spline", spline), progress, seconds),
               study(model, "capture (synthetic)", raw, ("the truth", truth), progress, seconds)]
    write_whole(out / "filters.md", report(results, alone))
    content = {r.title: {"rows": [vars(row) for row in r.rows], "time_constant_like_window": r.like} for r in results}
    write_whole(out / "filters.json", json.dumps(content, indent=1))
    draw_velocities(results[0], out / "robotis_velocity.png")
    draw_velocities(results[1], out / "capture_velocity.png")
    draw_bodies(results, out / "body.png")
    return f"wrote {out}: filters.md, filters.json, robotis_velocity.png, capture_velocity.png, body.png"


if __name__ == "__main__":
    raise SystemExit(run_study("filters", __doc__, filters))
