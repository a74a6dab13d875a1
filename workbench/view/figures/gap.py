"""Where and when a recording differs from the model, before and after the findings are added to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from workbench.identify.results.take_report import TakeReport
from workbench.robot import RobotModel
from workbench.types import Array
from workbench.view.figures.errors import LIMIT
from workbench.view.figures.heat import BIN, DARKEST, HEAT, SCALE, cells
from workbench.view.figures.stance import intervals
from workbench.view.figures.style import (
    ACCENT,
    COMMAND,
    NOISE,
    RECORDED,
    SIMULATED,
    STANCE,
    grid_of,
    in_house_style,
    legend_above,
    new_figure,
)
from workbench.view.shapes import robot_shapes

SHOWN = 3.0
"""Longest stretch that a before-and-after figure shows [s]."""
_DEGREES = 180 / np.pi


@in_house_style
def gap_map(take: TakeReport) -> Figure:
    """Places over time: residual over noise and numerical error, RMS in cells of BIN, before and (if it differs) after.

    Pale up to LIMIT, dark at 30 times. Grey: not recorded. The line on top marks held-out frames."""
    time, edges = take.time, np.arange(0.0, max(take.time[-1], BIN) + BIN, BIN)
    rows = len(take.channels)
    figure = new_figure(12, 0.21 * rows + 1.5)
    same = np.array_equal(take.before, take.after, equal_nan=True)
    panels = figure.subplots(1, 1 if same else 2, sharey=True, squeeze=False)[0]
    mesh = None
    for axes, residual, title in zip(panels, (take.before, take.after), ("nominal model", "fitted model")):
        mesh = axes.pcolormesh(edges, np.arange(rows + 1), cells(time, residual, edges), cmap=HEAT, norm=SCALE, rasterized=True)
        held_out = intervals(time, take.unseen & (time >= 0))
        ends = np.column_stack([held_out, np.full(len(held_out), np.nan)]).ravel()  # one line with gaps: a long take has hundreds
        axes.plot(ends, np.full(len(ends), -0.35), color=ACCENT, linewidth=4, solid_capstyle="butt", clip_on=False)
        axes.set_ylim(rows, -0.6)
        axes.set_yticks(np.arange(rows) + 0.5, take.channels, fontsize=9)
        axes.grid(False)
        axes.set_xlabel("time since the first command [s]")
        axes.set_title(f"{take.name}, {title}")
    assert mesh is not None
    bar = figure.colorbar(mesh, ax=panels, pad=0.01, fraction=0.03)
    bar.set_ticks([LIMIT, 3, 10, DARKEST], labels=[f"≤ {LIMIT:g}×", "3×", "10×", f"≥ {DARKEST:g}×"])
    bar.ax.minorticks_off()
    return figure


@in_house_style
def robot_map(model: RobotModel, ratios: Mapping[str, float]) -> Figure:
    """The robot in neutral, drawn obliquely, each joint coloured and sized by its error over noise and numerics."""
    k, shapes = model.kinematics, robot_shapes(model)
    poses = {link: (p[0], R[0]) for link, (p, R) in k.forward(np.zeros((1, len(k.joints)))).items()}
    points = {j: _oblique(poses[f.child][0] + poses[f.child][1] @ f.p_BM) for j, f in k.frames.items()}
    carrying = {f.parent for f in k.frames.values()}
    tips = {j: k.centers[f.child] for j, f in k.frames.items() if f.child not in carrying}
    tips |= {j: p_LF for j, (_, p_LF) in shapes.feet.items()}
    segments = []
    for joint, f in k.frames.items():
        carrier = k.parent_joint[f.parent]
        segments.append([points[carrier] if carrier else _oblique(poses[f.parent][0]), points[joint]])
        if joint in tips:
            p, R = poses[f.child]
            segments.append([points[joint], _oblique(p + R @ tips[joint])])
    ends = np.concatenate(segments)
    (right, top), (width, height) = ends.max(axis=0), np.ptp(ends, axis=0)
    line = max(0.16 * height, 0.1 * width)
    figure = new_figure(7.6, float(np.clip(7.6 * 1.6 * max(height, 3 * line) / (width + 6 * line), 2.8, 4.6)))
    axes = figure.subplots()
    axes.add_collection(LineCollection(segments, colors=COMMAND, linewidths=5, alpha=0.35, capstyle="round", zorder=1))
    loud = sorted((j for j in model.joints if ratios.get(j, 0.0) > LIMIT), key=lambda j: -ratios[j])[:4]
    for joint in model.joints:
        (x, y), ratio = points[joint], ratios.get(joint, np.nan)
        known = np.isfinite(ratio)
        size, colour = (60 + 90 * np.log(max(ratio, 1.0)), HEAT(SCALE(ratio))) if known else (30, "#D9D9DD")
        axes.scatter(x, y, s=size, color=colour, edgecolor="#555555", linewidth=0.8, zorder=3)
        if joint not in loud:
            axes.annotate(joint, (x, y), xytext=(9, 4), textcoords="offset points", fontsize=8, color="#777777", zorder=2)
    for row, joint in enumerate(sorted(loud, key=lambda j: -points[j][1])):
        axes.annotate(f"{joint} {ratios[joint]:.1f}×", points[joint], xytext=(right + 2 * line, top - row * line),
                      va="center", fontsize=12, fontweight="bold", color=RECORDED, zorder=4,
                      arrowprops={"arrowstyle": "-", "color": RECORDED, "linewidth": 1.0, "alpha": 0.6})
    axes.update_datalim([(right + 4 * line, top)])  # room for the labels
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.15)
    axes.set_axis_off()
    axes.set_title("error / noise and numerics, nominal model")
    return figure


def _oblique(p: Array) -> tuple[float, float]:
    """Seen from the right, ahead and above: forward to the right, left into the picture."""
    return float(p[0] - 0.55 * p[1]), float(p[2] + 0.5 * p[1])


@in_house_style
def before_after(take: TakeReport, joint: str) -> Figure:
    """A joint as recorded, and by the nominal and the fitted model, with the residuals of each, around the held-out stretch on
    which the nominal model is worst."""
    low, high = _worst_stretch(take, joint)
    t = take.time
    use = (t >= low) & (t <= high)
    figure, (top, strip) = grid_of(2, 1, 10, 4.8, between=0.15, sharex=True, height_ratios=[3, 1.6])
    recorded = _DEGREES * take.recorded.q[use, take.recorded.column(joint)]
    top.plot(t[use], recorded, color=RECORDED, linewidth=2.6, label="recorded")
    sigma = _DEGREES * take.sigma(joint)
    column = take.channels.index(joint)
    # as they were evaluated: each model from its own first command if the recording does not show when that came
    for what, residual, colour, style in (("nominal", take.before, COMMAND, "--"), ("fitted", take.after, SIMULATED, "-")):
        left = sigma * residual[use, column]
        top.plot(t[use], recorded - left, color=colour, linestyle=style, linewidth=1.6, label=what)
        strip.plot(t[use], left, color=colour, linestyle=style, linewidth=1.5)
    if np.isfinite(sigma):
        strip.axhspan(-2 * sigma, 2 * sigma, color=NOISE, zorder=0)
    for axes in (top, strip):
        _shade(axes, take, low, high)
    top.set_title(f"{take.name}: joint {joint}")
    top.set_ylabel("angle [deg]")
    strip.set_ylabel("residual [deg]")
    strip.set_xlabel("time since the first command [s]; grey: held out; green: noise and numerics, 2σ")
    strip.set_xlim(low, high)
    legend_above(top)
    return figure


def _shade(axes: Axes, take: TakeReport, low: float, high: float) -> None:
    for a, b in intervals(take.time, take.unseen):
        if b > low and a < high:
            axes.axvspan(max(a, low), min(b, high), color=STANCE, zorder=-1)


def _worst_stretch(take: TakeReport, joint: str) -> tuple[float, float]:
    t = take.time
    error = np.square(np.nan_to_num(take.before[:, take.channels.index(joint)]))
    if take.unseen.any():
        error = np.where(take.unseen, error, 0.0)
    width = min(SHOWN, t[-1])
    sums = np.cumsum(error)
    ends = np.minimum(np.searchsorted(t, t + width), len(t) - 1)
    start = float(np.clip(t[int(np.argmax(sums[ends] - sums))], 0.0, max(t[-1] - width, 0.0)))
    return start, start + width


@in_house_style
def unseen_errors(takes: Sequence[TakeReport]) -> Figure:
    """Each channel's error on held-out frames, over the error that noise and numerics alone cause, before and after, by take."""
    ratios = [(s.ratios(s.before), s.ratios(s.after)) for s in takes]
    worst = {c: max(float(np.nan_to_num(before.get(c, 0.0))) for before, _ in ratios) for s in takes for c in s.channels}
    order = sorted(worst, key=lambda c: -worst[c])
    figure = new_figure(12, 0.24 * len(order) + 1.7)
    panels = figure.subplots(1, len(takes), sharey=True, squeeze=False)[0]
    for axes, take, (before, after) in zip(panels, takes, ratios):
        axes.axvspan(0, LIMIT, color=NOISE, zorder=0, label=f"explained: up to {LIMIT:g}×")
        rows = [i for i, c in enumerate(order) if np.isfinite(before.get(c, np.nan))]
        b, a = ([values[order[i]] for i in rows] for values in (before, after))
        axes.hlines(rows, b, a, color=COMMAND, linewidth=1.2, zorder=2)
        axes.scatter(b, rows, s=42, facecolor="white", edgecolor=RECORDED, linewidth=1.8, zorder=3, label="before")
        axes.scatter(a, rows, s=42, color=SIMULATED, zorder=4, label="after")
        axes.set_xlim(left=0)
        axes.grid(False, axis="y")
        axes.set_title(take.name)
        axes.set_xlabel("error / noise and numerics")
    panels[0].set_yticks(range(len(order)), order, fontsize=10)
    panels[0].set_ylim(len(order) - 0.4, -0.6)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
