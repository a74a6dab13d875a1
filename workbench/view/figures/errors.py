"""Errors, and how much of them is noise or numerical error."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from workbench.compare.results import Channel, by_error
from workbench.identify.options import PROBLEM
from workbench.view.figures.style import COMMAND, ERROR, FLOOR, NOISE, RECORDED, SIMULATED, in_house_style, new_figure

LIMIT = PROBLEM.gap_ratio
"""An error within this many times the root of noise² + floor² is explained (docs/formats.md, section 6)."""


@in_house_style
def joint_errors(channels: Mapping[str, Channel]) -> Figure:
    """RMS error of each joint, sorted by the ratio to noise and numerics, compared with the error that noise and numerics alone
    would cause.

    channels: joint -> error, noise, floor, spread [rad], shown in degrees. A bar beyond `LIMIT` times the root of noise² + floor²
    is orange: noise and numerics do not explain it.
    """
    order = by_error(channels, {joint: channel.over_noise for joint, channel in channels.items()})
    figure = new_figure(9, 0.34 * len(order) + 2.1)
    axes = figure.subplots()
    for row, joint in enumerate(order):
        _row(axes, row, channels[joint])
    for label, key, colour, style in (("noise", "noise", ERROR, "-"), ("numerical floor", "floor", FLOOR, "-"),
                                      ("spread between contact models", "spread", COMMAND, ":")):
        if any(getattr(c, key) > 0 for c in channels.values()):
            axes.plot([], [], color=colour, linestyle=style, linewidth=2, label=label)
    axes.bar(0, 0, color=RECORDED, label=f"error above {LIMIT:g}× both")
    axes.bar(0, 0, color=SIMULATED, label="error below")
    axes.set_yticks(range(len(order)), order)
    axes.set_ylim(len(order) - 0.4, -0.6)
    axes.margins(x=0.16)
    axes.set_xlim(left=0)
    axes.grid(False, axis="y")
    axes.set_xlabel("RMS error after the first command [deg]")
    axes.set_title("error of each joint, sorted by the ratio to noise and numerics")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _row(axes: Axes, row: int, channel: Channel) -> None:
    error, noise, floor, spread = (
        180 / np.pi * float(np.nan_to_num(x)) for x in (channel.error, channel.noise, channel.floor, channel.spread))
    bound = LIMIT * float(np.hypot(noise, floor))
    colour = RECORDED if error > bound > 0 else SIMULATED
    axes.barh(row, bound, 0.86, color=NOISE, zorder=1, label="explained by noise and numerics" if row == 0 else None)
    axes.barh(row, error, 0.5, color=colour, zorder=2)
    for value, mark, width, style in ((noise, ERROR, 2.0, "-"), (floor, FLOOR, 2.5, "-"), (spread, COMMAND, 1.5, ":")):
        if value > 0:
            axes.plot([value, value], [row - 0.36, row + 0.36], color=mark, linewidth=width, linestyle=style, zorder=3)
    ratio = f"{channel.over_noise:.1f}×" if np.isfinite(channel.over_noise) else ""
    axes.annotate(f"{error:.2f}  {ratio}", (max(error, bound), row), xytext=(6, 0), textcoords="offset points", va="center",
                  fontsize=10, color=RECORDED if colour == RECORDED else "#555555")
