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
    "figure.autolayout": False,
    "figure.constrained_layout.use": False,
    "savefig.dpi": 144,
    "svg.fonttype": "path",
    "svg.hashsalt": "workbench",
    "path.simplify_threshold": 0.5,
    "axes.unicode_minus": True,
}

LEFT, RIGHT, ABOVE, BELOW = 0.85, 0.15, 0.65, 0.6
"""Room [inches] for an axis' label and its numbers, for a legend over the titles, and for the time axis."""
ASIDE, BETWEEN = 0.65, 0.42
"""Between panels side by side, for numbers of six characters, and between rows, for titles."""

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
    figure, grid = grid_of(rows, columns, width, height * rows + 0.6, sharex=True)
    for axes in grid[count:]:
        axes.set_axis_off()
    return figure, grid[:count]


def grid_of(rows: int, columns: int, width: float, height: float, aside: float = ASIDE, between: float = BETWEEN, **subplots: Any
            ) -> tuple[Figure, list[Axes]]:
    """A figure [inches] with panels in rows, `aside` and `between` apart [inches]; subplots: as matplotlib's take it. Its margins
    are fixed, as labels are as large in every such figure, and solving for them takes as long as drawing the curves."""
    figure = new_figure(width, height)
    figure.set_layout_engine(None)
    across = (width - LEFT - RIGHT - aside * (columns - 1)) / columns
    down = (height - ABOVE - BELOW - between * (rows - 1)) / rows
    place = {"left": LEFT / width, "right": 1 - RIGHT / width, "bottom": BELOW / height, "top": 1 - ABOVE / height,
             "wspace": aside / across, "hspace": between / down}
    return figure, list(figure.subplots(rows, columns, squeeze=False, gridspec_kw=place, **subplots).flat)
