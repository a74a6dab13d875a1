"""The house style of figures and pages: colour-blind safe (Okabe and Ito, 2008), readable on a slide."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

SIMULATED = "#0072B2"
RECORDED = "#D55E00"
COMMAND = "#6E6E6E"
ERROR = "#333333"
NOISE = "#BFD8C8"
FLOOR = "#E6C84F"
STANCE = "#EDEFF3"
ACCENT = "#009E73"
OTHERS = ("#CC79A7", "#56B4E9", "#E69F00", "#000000")

_RC: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 12,
    "axes.titlesize": 13,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 12,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#888888",
    "axes.linewidth": 0.8,
    "axes.labelcolor": "#222222",
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.7,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "xtick.labelsize": 11,
    "ytick.labelsize": 11,
    "legend.frameon": False,
    "legend.fontsize": 11,
    "lines.linewidth": 1.8,
    "lines.solid_capstyle": "round",
    "figure.facecolor": "white",
    "figure.dpi": 100,
    "savefig.dpi": 144,
    "svg.fonttype": "path",
    "svg.hashsalt": "workbench",
    "path.simplify_threshold": 0.5,
    "axes.unicode_minus": True,
}

P = ParamSpec("P")
R = TypeVar("R")


def in_house_style(draw: Callable[P, R]) -> Callable[P, R]:
    """Runs a function in the house style and restores matplotlib's settings."""

    @functools.wraps(draw)
    def inside(*args: P.args, **kwargs: P.kwargs) -> R:
        with mpl.rc_context(_RC):  # type: ignore[arg-type]
            return draw(*args, **kwargs)

    return inside


def new_figure(width: float = 9.0, height: float = 4.5) -> Figure:
    """An empty figure [inches] on the Agg canvas, outside pyplot's state."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def rgb(colour: str) -> tuple[float, float, float]:
    """Red, green and blue, 0 to 1, of '#RRGGBB'."""
    return int(colour[1:3], 16) / 255, int(colour[3:5], 16) / 255, int(colour[5:7], 16) / 255


def legend_above(axes: Axes) -> None:
    """A one-line legend over the axes, to the right, where no curve can hide it."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=6, borderaxespad=0.2, columnspacing=1.4,
                    handlelength=1.8)


def panels(count: int, columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """A figure of `count` panels in rows of `columns` that share their time axis; `height` of one row [inches]."""
    rows = -(-count // columns)
    figure = new_figure(width, height * rows + 0.6)
    grid = list(figure.subplots(rows, columns, sharex=True, squeeze=False).flat)
    for axes in grid[count:]:
        axes.set_axis_off()
    return figure, grid[:count]
