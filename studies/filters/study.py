"""The thesis's input filters (chapters 6.7, 6.8 and 7.2.2): what each window does to a motion, and to the walk that comes of it.

    python studies/filters/study.py [--out runs/studies/filters]

Two inputs, as there: the ROBOTIS walk, looped, and a capture of it at 120 Hz. The capture is synthetic, the servo-law simulation
with noise, so that its true velocity is known.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from studies.filters.figures import draw_bodies, draw_velocities
from studies.filters.measure import capture, robotis, study
from studies.filters.report import report
from workbench.robot import puppy_model
from workbench.robot.files import write_whole


def main() -> None:
    """Runs the study and writes figures, table and numbers."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("runs/studies/filters"))
    out = parser.parse_args().out
    model = puppy_model()
    angles, spline = robotis()
    raw, truth, alone = capture(model)
    results = [study(model, "ROBOTIS angles", angles, ("a smooth spline", spline)),
               study(model, "capture (synthetic)", raw, ("the truth", truth))]
    write_whole(out / "filters.md", report(results, alone))
    content = {r.title: {"rows": [vars(row) for row in r.rows], "time_constant_like_window": r.like} for r in results}
    write_whole(out / "filters.json", json.dumps(content, indent=1))
    draw_velocities(results[0], out / "robotis_velocity.png")
    draw_velocities(results[1], out / "capture_velocity.png")
    draw_bodies(results, out / "body.png")
    print(f"wrote {out}: filters.md, filters.json, robotis_velocity.png, capture_velocity.png, body.png")


if __name__ == "__main__":
    main()
