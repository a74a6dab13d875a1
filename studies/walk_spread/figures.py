"""The cloud of ends, what each level does to it, and which factor explains how much."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.common import COORDINATES, REAL, SIMULATED_M, SIMULATED_OWN
from studies.walk_spread.analysis import Shares, cloud
from studies.walk_spread.design import FACTORS, Design
from studies.walk_spread.runs import Ends
from workbench.view.figures import style

COLOURS = {"servo": style.SIMULATED, "ideal": style.ACCENT}
NAMES = {"servo": "servo law", "ideal": "ideal joints"}
MARKERS = {"point": "o", "hydroelastic": "^"}
THESIS_TURNS = (-10.9, 4.8)
"""Final headings of the thesis's simulations, left [deg]: one, and the mean of the other three (7.2.2)."""
_X, _TURN = COORDINATES.index("x"), COORDINATES.index("ry")


@style.styled
def draw_cloud(ends: Ends) -> Figure:
    """Distance against heading, a point a run, with both marginal distributions; excursions are crosses."""
    figure = style.new_figure(11, 7.5)
    grid = figure.subplots(2, 2, width_ratios=(4, 1), height_ratios=(1, 4), sharex="col", sharey="row")
    plane: Axes = grid[1, 0]
    for (drive, contact), colour, marker in ((k, COLOURS[k[0]], MARKERS[k[1]]) for k in _groups(ends)):
        mine = np.array([e for c, e in ends.items() if (c.drive, c.contact) == (drive, contact) and not c.excursion])
        plane.plot(mine[:, _X], mine[:, _TURN], marker, color=colour, ms=6, alpha=0.55, mec="none",
                   label=f"{NAMES[drive]}, {contact}")
    for case, end in ends.items():
        if case.excursion:
            plane.plot(end[_X], end[_TURN], "x", color=COLOURS[case.drive], ms=9, mew=2)
            above = case.drive == "servo" and case.excursion.startswith("friction")  # clear of the ideal joints' below
            plane.annotate(case.excursion, (end[_X], end[_TURN]), xytext=(6, 5 if above else -13),
                           textcoords="offset points", fontsize=9)
    _draw_thesis(plane)
    for drive, colour in COLOURS.items():
        grid[0, 0].hist(cloud(ends, drive, "x"), bins=20, color=colour, alpha=0.6)
        grid[1, 1].hist(cloud(ends, drive, "ry"), bins=20, color=colour, alpha=0.6, orientation="horizontal")
    for x in (REAL[0], SIMULATED_OWN[0]):
        grid[0, 0].axvline(x, color=style.RECORDED if x == REAL[0] else style.COMMAND, lw=1.5, ls="--")
    grid[0, 1].set_axis_off()
    plane.set_xlim(left=min(0.0, plane.get_xlim()[0]))
    plane.set_xlabel("x, forward [cm]")
    plane.set_ylabel("heading, positive to the left [deg]")
    grid[0, 0].set_ylabel("runs")
    grid[1, 1].set_xlabel("runs")
    grid[0, 0].set_title("six seconds of the ROBOTIS walk")
    handles, labels = plane.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _groups(ends: Ends) -> list[tuple[str, str]]:
    return sorted({(c.drive, c.contact) for c in ends if not c.excursion})


def _draw_thesis(plane: Axes) -> None:
    plane.axvline(REAL[0], color=style.RECORDED, lw=1.5, ls="--", label="thesis: real robot, 37.0 cm")
    plane.axvline(SIMULATED_OWN[0], color=style.COMMAND, lw=1.5, ls="--",
                  label=f"thesis: simulations, {SIMULATED_OWN[0]:.1f} and {SIMULATED_M[0]:.1f} cm")
    for turn in THESIS_TURNS:
        plane.axhline(turn, color=style.COMMAND, lw=0.8, ls=":", label="thesis: headings of simulations" if turn > 0 else None)


@style.styled
def draw_levels(design: Design, ends: Ends) -> Figure:
    """x and heading of every run at each level of each factor; bars: the mean of a level."""
    figure = style.new_figure(13, 7)
    grid = figure.subplots(2, len(FACTORS), sharey="row", sharex="col")
    jitter = np.random.default_rng(0)
    for column, factor in enumerate(FACTORS):
        levels = design.levels[factor]
        for row, i in enumerate((_X, _TURN)):
            for offset, (drive, colour) in zip((-0.17, 0.17), COLOURS.items()):
                for k, level in enumerate(levels):
                    y = np.array([e[i] for c, e in ends.items()
                                  if c.drive == drive and not c.excursion and getattr(c, factor) == level])
                    at, panel = k + offset, grid[row, column]
                    panel.plot(at + jitter.uniform(-0.09, 0.09, len(y)), y, ".", color=colour, ms=4, alpha=0.5)
                    panel.hlines(y.mean(), at - 0.14, at + 0.14, color=colour, lw=3,
                                 label=NAMES[drive] if column == row == k == 0 else None)
            grid[row, column].set_xticks(range(len(levels)), [_level(factor, v) for v in levels])
        grid[0, column].axhline(REAL[0], color=style.RECORDED, lw=1.5, ls="--",
                                label="thesis: real robot" if column == 0 else None)
        grid[1, column].set_xlabel(factor + (" [ms]" if factor == "step" else ""))
        grid[0, column].set_title(factor)
    grid[0, 0].set_ylabel("x, forward [cm]")
    grid[1, 0].set_ylabel("heading, left [deg]")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _level(factor: str, value: object) -> str:
    if factor == "step":
        return f"{1e3 * float(str(value)):g}"
    return str(value).replace("hydroelastic", "hydro").replace("as built", "built").replace("seed ", "s").replace("-", "\u2212")


@style.styled
def draw_shares(shares: Mapping[tuple[str, str], Shares]) -> Figure:
    """Share of each factor in the variance of x and of heading, for each drive."""
    figure = style.new_figure(11, 0.7 * len(shares) + 1.8)
    axes = figure.subplots()
    parts = (*FACTORS, "two together", "three and more")
    colours = (style.SIMULATED, style.ACCENT, style.FLOOR, style.RECORDED, "#BBBBBB", "#E3E3E3")
    for row, s in enumerate(shares.values()):
        widths = [*(s.main[f] for f in FACTORS), sum(s.pairs.values()), s.rest]
        left = 0.0
        for part, width, colour in zip(parts, widths, colours):
            axes.barh(row, 100 * width, left=100 * left, color=colour, label=part if row == 0 else None, height=0.7)
            if width > 0.05:
                axes.text(100 * (left + width / 2), row, f"{100 * width:.0f}", ha="center", va="center", fontsize=11)
            left += width
    units = {"x": "cm", "ry": "°"}
    axes.set_yticks(range(len(shares)), [f"{NAMES[d]}, {'x' if c == 'x' else 'heading'} (σ {s.std:.1f} {units[c]})"
                                         for (d, c), s in shares.items()])
    axes.invert_yaxis()
    axes.grid(False, axis="y")
    axes.set_xlabel("share of the variance [%]")
    axes.set_xlim(0, 100)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=len(parts))
    return figure
