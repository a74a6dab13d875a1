"""Figures of the filters' study."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from studies.filters.measure import NAMES, Result
from studies.inputs import JOINT
from workbench.view.figures import style

COLOURS = dict(zip(NAMES, ("#AAAAAA", *style.OTHERS[:3], style.ACCENT)))


@style.styled
def draw_velocities(result: Result, file: Path, zoom: tuple[float, float] | None = None) -> None:
    """Angle, velocity and acceleration of JOINT under each filter (thesis, figures 6.6 and 7.7)."""
    figure = style.new_figure(11, 9)
    axes: list[Axes] = list(figure.subplots(3, 1, sharex=True))
    label, reference = result.reference
    time = reference.time
    zoom = zoom or (time[-1] / 3, time[-1] / 2)
    shown = (time >= zoom[0]) & (time <= zoom[1])
    for panel, (what, unit) in zip(axes, (("q", "angle [deg]"), ("v", "velocity [deg/s]"), ("a", "acceleration [deg/s²]"))):
        for name, path in result.paths.items():
            width = 0.8 if name in ("unfiltered", "window 91") else 1.8
            y = np.degrees(getattr(path, what)[shown, path.column(JOINT)])
            panel.plot(time[shown], y, color=COLOURS[name], lw=width, label=name)
        y = np.degrees(getattr(reference, what)[shown, reference.column(JOINT)])
        panel.plot(time[shown], y, color="#222222", lw=1.0, ls="--", label=label)
        panel.set_ylabel(unit)
    steady = np.degrees(result.paths["window 1001"].a[shown, reference.column(JOINT)])
    axes[2].set_ylim(2 * steady.min(), 2 * steady.max())
    axes[2].set_xlabel("time [s]")
    axes[0].set_title(f"{result.title}: {JOINT}")
    style.legend_above(axes[1])
    figure.savefig(file)


@style.styled
def draw_bodies(results: list[Result], file: Path) -> None:
    """Where the body goes under each filter, with the numerical floor (thesis, figure 7.8)."""
    figure = style.new_figure(12, 8.5)
    grid = figure.subplots(3, 2, sharex=True, sharey="row")
    for column, result in enumerate(results):
        time = np.linspace(0, result.seconds, len(result.floor[0]))
        floor = np.array(result.floor)
        for row in range(3):
            panel = grid[row, column]
            low, high = floor[:, :, row].min(axis=0), floor[:, :, row].max(axis=0)
            panel.fill_between(time, low, high, color=style.FLOOR, alpha=0.5, lw=0, label="unfiltered, other steps and solvers")
            for name, track in result.tracks.items():
                panel.plot(time, track[:, row], color=COLOURS[name], label=name)
        grid[0, column].set_title(result.title)
        grid[2, column].set_xlabel("time [s]")
    for row, label in enumerate(("forward [cm]", "to the left [cm]", "heading, left [deg]")):
        grid[row, 0].set_ylabel(label)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6)
    figure.savefig(file)
