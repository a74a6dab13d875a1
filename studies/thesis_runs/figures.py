"""Position and rotation of the body over time, as in the thesis's figures 7.4, 7.5 and 7.6."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.common import COORDINATES, LABELS, REAL, SIMULATED_M, SIMULATED_OWN
from studies.thesis_runs.runs import ANIMATION, Run
from workbench.view.figures import style

COLOURS = {ANIMATION: style.RECORDED, "robotis M": style.SIMULATED, "robotis": style.OTHERS[1], "mocap M": style.OTHERS[0],
           "mocap": style.ACCENT}
_ENDS = {ANIMATION: REAL, "robotis M": SIMULATED_M, "robotis": SIMULATED_OWN}


@style.styled
def draw_runs(runs: Sequence[Run], title: str) -> Figure:
    """x, y, z on the left, rotations about them on the right; each simulation in the band of its finer steps.

    The thesis's ends are triangles at the right edge.
    """
    figure = style.new_figure(12, 8.5)
    grid = figure.subplots(3, 2, sharex=True)
    for i, label in enumerate(LABELS):
        axes: Axes = grid[i % 3, i // 3]
        for run in runs:
            _draw(axes, run, i)
        axes.set_ylabel(label)
        axes.margins(x=0)
    for axes in grid[2]:
        axes.set_xlabel("time since the first command [s]")
    grid[0, 0].set_title(title)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _draw(axes: Axes, run: Run, i: int) -> None:
    colour = COLOURS[run.name]
    shown = "recording (synthetic), played back" if run.name == ANIMATION else run.name
    if run.finer:
        all_steps = np.array([run.track, *run.finer])[:, :, i]
        axes.fill_between(run.time, all_steps.min(axis=0), all_steps.max(axis=0), color=colour, alpha=0.2, lw=0)
    axes.plot(run.time, run.track[:, i], color=colour, lw=3 if run.name == ANIMATION else 1.5, label=shown)
    if COORDINATES[i] in ("x", "y", "z") and run.name in _ENDS:
        axes.plot(1.0, _ENDS[run.name][i], "<", transform=axes.get_yaxis_transform(), color=colour, ms=9, clip_on=False,
                  label=f"thesis: {'real robot' if run.name == ANIMATION else run.name}", zorder=5)
