"""A map of gaits over speed and turning: how many of 7 × 7 cells are filled, and how many do fresh robots reproduce?

    python -m studies.gait_map [--out runs/studies/gait_map] [--quick]

Needs the extra [map]. The search (pyribs) keeps in each cell the gait whose motion differs least over a few drawn robots; these
gaits are measured on others, and each cell is then played on fresh ones. With a Dask cluster: `with
joblib.parallel_config(backend="dask"): build_map(...)`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure

from studies.common import publish, run_study
from workbench.gait.certificate import PUPPY_CLAIM
from workbench.gait.ensemble import load_ensemble
from workbench.gait.gait_map import GaitMap, MapOptions, build_map
from workbench.robot import puppy_model
from workbench.view.figures.style import in_house_style, new_figure
from workbench.view.report.page import Picture, Provenance, Report, Section, Table

QUICK = MapOptions(generations=2, batch=6, robots=1, measured=1, fresh=1, seconds=1.0)


@in_house_style
def drawn(found: GaitMap) -> Figure:
    """The cells' speeds and turning: filled where fresh robots reproduce them."""
    figure = new_figure(6, 5)
    axes, o = figure.subplots(), found.options
    for cell in found.cells:
        axes.plot(np.degrees(cell.turning), cell.speed, "o", color="C0", fillstyle="full" if cell.reproduced else "none")
    axes.set_xticks(np.degrees(np.linspace(-o.turning, o.turning, o.cells + 1)))
    axes.set_yticks(np.linspace(0.0, o.speed, o.cells + 1))
    axes.grid(True)
    axes.set_xlabel("turning [deg/s]")
    axes.set_ylabel("speed [m/s]")
    return figure


def study(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Builds the map and counts."""
    model, began = puppy_model(), (time.monotonic(), time.process_time())
    with TemporaryDirectory(prefix="workbench-") as folder:
        found = build_map(model, load_ensemble(), Path(folder), options=QUICK if quick else MapOptions(), progress=progress)
    wall, processor = time.monotonic() - began[0], time.process_time() - began[1]
    found.save(out / "map.json")
    o = found.options
    filled = f"{len(found.cells)} of {o.cells**2} cells filled ({100 * found.filled:.0f} %)"
    summary = (f"{filled}, {100 * found.reproduced:.0f} % of them reproduced by {o.fresh} fresh robots; "
               f"{found.rollouts} rollouts, {processor:.0f} s of processor, {wall:.0f} s")
    figure = drawn(found)
    report = Report("A map of gaits", summary, f"{__doc__}\n\n{PUPPY_CLAIM}", [], Provenance.of(model))
    report.add(Section("The map", [Picture(figure, "Full circles: reproduced.")]))
    report.add(Section("Cells", [Table(
        ["speed [m/s]", "turning [deg/s]", "spread [deg/s]", "reproduced"],
        [[f"{c.speed:.3f}", f"{np.degrees(c.turning):.1f}", f"{np.degrees(c.spread):.1f}", "yes" if c.reproduced else "no"]
         for c in sorted(found.cells, key=lambda c: (c.speed, c.turning))])]))
    numbers = {"filled": found.filled, "reproduced": found.reproduced, "rollouts": found.rollouts, "processor s": processor}
    return f"{summary}; {publish(out, model, report, numbers, {'map': figure})}"


if __name__ == "__main__":
    raise SystemExit(run_study("gait_map", __doc__, study))
