"""A driven path: way-points, the path walked, and the turn of each cycle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from workbench.gait.drive.loop import Driven
from workbench.gait.drive.plan import Disc
from workbench.view.figures.style import ACCENT, COMMAND, OTHERS, SIMULATED, in_house_style, legend_above, new_figure


@in_house_style
def driven_path(closed: Driven, straight: Driven | None = None, discs: Sequence[Disc] = ()) -> Figure:
    """Seen from above, x forward to the right, y left upwards [m]: the path, the way-points, the steered robot and, if given, the
    same robot with the straight gait; discs to walk around."""
    figure = new_figure(9, 4.8)
    axes = figure.subplots()
    axes.plot(*closed.path.p.T, color=COMMAND, linewidth=1.2, linestyle="--", label="path")
    axes.plot(*closed.path.points.T, "o", color=COMMAND, markersize=6, label="way-points")
    for disc in discs:
        axes.add_patch(Circle((disc.x, disc.y), disc.radius, color=COMMAND, alpha=0.3))
    if straight is not None:
        axes.plot(straight.poses[:, 0], straight.poses[:, 1], color=OTHERS[0], linewidth=1.4, label="not steered")
    axes.plot(closed.poses[:, 0], closed.poses[:, 1], ".-", color=SIMULATED, label="steered, end of each cycle")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("forward [m]")
    axes.set_ylabel("left [m]")
    legend_above(axes)
    return figure


@in_house_style
def driven_cycles(closed: Driven, most: float) -> Figure:
    """Per cycle: lateral error [cm], heading error [deg], executed turn [rad per stance] with its limit, sideways stride
    [mm per stance], and the estimated turning bias [deg per cycle]. most: largest turn [rad per stance]."""
    figure = new_figure(9, 9.5)
    rows = figure.subplots(5, 1, sharex=True)
    cycles = np.arange(len(closed.turns))
    columns = {"left [cm]": 100 * closed.left, "heading [deg]": np.rad2deg(closed.off), "turn [rad]": closed.turns,
               "sideways [mm]": 1000 * closed.sides, "bias [deg/cycle]": np.rad2deg(closed.bias)}
    for axes, (label, values) in zip(rows, columns.items()):
        axes.axhline(0, color="#999999", linewidth=0.8)
        axes.plot(cycles, values, ".-", color=ACCENT if label.startswith("bias") else SIMULATED)
        axes.set_ylabel(label)
    for limit in (-most, most):
        rows[2].axhline(limit, color=COMMAND, linestyle=":", linewidth=1)
    rows[-1].set_xlabel("cycle")
    rows[-1].xaxis.get_major_locator().set_params(integer=True)
    return figure
