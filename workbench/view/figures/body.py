"""The path and attitude of the body, and when each foot was on the ground."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from workbench.compare.metrics import displacement, heading, heading_change
from workbench.recording.take import Take
from workbench.types import Array
from workbench.view.figures.stance import Stance
from workbench.view.figures.style import OTHERS, RECORDED, SIMULATED, in_house_style, legend_above, new_figure
from workbench.view.playback import names_of, since_start


@dataclass(frozen=True)
class _Body:
    """Path (N, 3) [cm] and heading, roll, pitch (N,) [deg], all relative to the body at rest; time (N,) [s]."""

    time: Array
    path: Array
    heading: Array
    roll: Array
    pitch: Array
    forward: float
    turn: float


@in_house_style
def body_path(simulated: Take, recorded: Take | None = None, others: Mapping[str, Take] | None = None) -> Figure:
    """Path of the base link in the plane, seen from above (x forward to the right, y left upwards), and its heading.

    All paths begin where the robot stood. `others`: more runs by label, as thinner lines (other contact models, other
    steps). Takes without a base pose are left out.
    """
    figure = new_figure(11, 4.6)
    plane, over_time = figure.subplots(1, 2, width_ratios=[1.25, 1])
    for label, take, colour, width in _runs(simulated, recorded, others):
        body = _body(take)
        if body is None:
            continue
        says = f"{label}: {body.forward:.1f} cm, {body.turn:+.1f}°".replace("-", "\u2212")
        plane.plot(body.path[:, 0], body.path[:, 1], color=colour, linewidth=width, label=says)
        seen = np.flatnonzero(np.isfinite(body.path).all(axis=1))
        plane.plot(*body.path[seen[-1], :2], "o", color=colour, markersize=7)
        _whole_seconds(plane, body, colour)
        over_time.plot(body.time, body.heading, color=colour, linewidth=width)
    plane.plot(0, 0, "o", markersize=8, markerfacecolor="white", markeredgecolor="#444444", zorder=5)
    plane.set_aspect("equal", adjustable="datalim")
    plane.set_xlabel("forward [cm]")
    plane.set_ylabel("left [cm]")
    plane.set_title("path of the base, one tick per second")
    over_time.set_xlabel("time since the first command [s]")
    over_time.set_ylabel("heading, positive to the left [deg]")
    over_time.set_title("heading")
    figure.legend(*plane.get_legend_handles_labels(), loc="outside lower left", ncols=3)
    return figure


@in_house_style
def body_attitude(simulated: Take, recorded: Take | None = None, others: Mapping[str, Take] | None = None) -> Figure:
    """Height, roll (left side up) and pitch (nose down positive) of the base link over time, relative to rest."""
    figure = new_figure(10, 6)
    rows = figure.subplots(3, 1, sharex=True)
    for label, take, colour, width in _runs(simulated, recorded, others):
        body = _body(take)
        if body is None:
            continue
        for axes, values in zip(rows, (10 * body.path[:, 2], body.roll, body.pitch)):
            axes.plot(body.time, values, color=colour, linewidth=0.8 * width, label=label)
    for axes, label in zip(rows, ("height [mm]", "roll [deg]", "pitch [deg]")):
        axes.axhline(0, color="#999999", linewidth=0.8, zorder=1)
        axes.set_ylabel(label)
    rows[0].set_title("attitude of the base, relative to rest")
    legend_above(rows[0])
    rows[-1].set_xlabel("time since the first command [s]")
    rows[-1].margins(x=0)
    return figure


@in_house_style
def footfalls(
    simulated: Stance, recorded: Stance | None = None, *, span: tuple[float, float], unseen: Stance | None = None,
) -> Figure:
    """A bar while a foot is on the ground, simulated below measured, and each foot's duty factor.

    span: [s since the first command]. unseen: intervals in which the recording did not see a foot; hatched, and excluded from its
    duty factor.
    """
    feet = list(simulated)
    figure = new_figure(10, 0.55 * len(feet) + 1.5)
    axes = figure.subplots()
    _footfall_rows(axes, feet, simulated, {}, span, SIMULATED, "simulated", 0.2)
    if recorded is not None:
        _footfall_rows(axes, feet, recorded, unseen or {}, span, RECORDED, "measured", -0.2)
    axes.text(1.01, -0.75, "duty", transform=axes.get_yaxis_transform(), va="center", color="#555555", fontsize=11)
    axes.set_yticks(range(len(feet)), feet)
    axes.set_ylim(len(feet) - 0.5, -0.5)
    axes.set_xlim(*span)
    axes.grid(False, axis="y")
    axes.set_xlabel("time since the first command [s]")
    axes.set_ylabel("foot")
    axes.set_title("feet on the ground")
    legend_above(axes)
    return figure


def _footfall_rows(
    axes: Axes, feet: list[str], stance: Stance, unseen: Stance, span: tuple[float, float], colour: str, label: str,
    offset: float,
) -> None:
    none = np.zeros((0, 2))
    place = axes.get_yaxis_transform()
    for row, foot in enumerate(feet):
        if foot not in stance:
            continue
        stands, gaps = (x.get(foot, none).clip(*span) for x in (stance, unseen))
        y = (row + offset - 0.17, 0.34)
        axes.broken_barh([(a, b - a) for a, b in stands if b > a], y, color=colour, label=label if row == 0 else None)
        axes.broken_barh([(a, b - a) for a, b in gaps if b > a], y, facecolor="white", edgecolor=colour, hatch="////",
                         linewidth=0.6, label="not seen" if row == 0 and len(gaps) else None)
        seen = span[1] - span[0] - float(np.diff(gaps).sum())
        if seen > 0:
            duty = float(np.diff(stands).sum()) / seen
            axes.text(1.01, row + offset, f"{duty:.2f}", transform=place, va="center", color=colour, fontsize=11)


def _runs(simulated: Take, recorded: Take | None, others: Mapping[str, Take] | None) -> list[tuple[str, Take, str, float]]:
    names = names_of(simulated, recorded)
    runs = [(label, take, OTHERS[i % len(OTHERS)], 1.3) for i, (label, take) in enumerate((others or {}).items())]
    if recorded is not None:
        runs.append((names[1], recorded, RECORDED, 2.4))
    return [*runs, (names[0], simulated, SIMULATED, 2.0)]


def _body(take: Take) -> _Body | None:
    if take.p_WB is None or take.quat_WB is None:
        return None
    seen = np.isfinite(take.p_WB).all(axis=1) & np.isfinite(take.quat_WB).all(axis=1)
    if not seen.any():
        return None
    time = since_start(take)
    rest = seen & (time < 0) if (seen & (time < 0)).any() else np.arange(len(take)) == np.flatnonzero(seen)[0]
    R = np.full((len(take), 3, 3), np.nan)
    R[seen] = Rotation.from_quat(take.quat_WB[seen], scalar_first=True).as_matrix()
    tilt = np.stack([np.arctan2(R[:, 2, 1], R[:, 2, 2]), -np.arcsin(R[:, 2, 0].clip(-1, 1))], axis=1)  # roll, pitch
    turn = heading(take.quat_WB)
    roll, pitch = np.degrees(tilt - np.nanmean(tilt[rest], axis=0)).T
    moved = displacement(take.p_WB, time)
    return _Body(
        time=time, path=100 * (take.p_WB - take.p_WB[rest].mean(axis=0)), heading=np.degrees(turn - np.nanmean(turn[rest])),
        roll=roll, pitch=pitch, forward=100 * float(moved[0]), turn=float(np.degrees(heading_change(take.quat_WB, time))))


def _whole_seconds(axes: Axes, body: _Body, colour: str) -> None:
    at = np.searchsorted(body.time, np.arange(1, np.floor(body.time[-1]) + 1)).clip(max=len(body.time) - 1)
    axes.plot(body.path[at, 0], body.path[at, 1], "|", color=colour, markersize=9, markeredgewidth=1.6)
