"""Joint angles: one joint closely, all of them at a glance, and velocity over position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from workbench.compare.comparison import align
from workbench.compare.metrics import rms
from workbench.dynamics.derivatives import differentiate
from workbench.recording.take import Take
from workbench.types import Array
from workbench.view.figures.stance import Stance
from workbench.view.figures.style import (
    COMMAND,
    ERROR,
    NOISE,
    RECORDED,
    SIMULATED,
    STANCE,
    in_house_style,
    legend_above,
    new_figure,
    panels,
)
from workbench.view.playback import names_of, since_start

LEAST_SPAN = 4.0
"""Of an angle's axis [deg]."""


@in_house_style
def joint_overlay(
    joint: str, simulated: Take, recorded: Take | None = None, *, noise: float | None = None, floor: float | None = None,
    stance: Stance | None = None, span: tuple[float, float] | None = None,
) -> Figure:
    """Command, measured and simulated angle of one joint, with the error below.

    noise, floor: standard deviation of the measurement and numerical floor of the simulation [rad], drawn as a band about
    zero error. stance: by joint (`by_joint`), of the recorded robot, or of the simulated one alone; shades the time in which
    the joint's foot is on the ground. span: seconds since the first command to show; else the time common to the takes.
    """
    simulated = _zeroed_like(simulated, recorded)
    figure = new_figure(10, 5.2 if recorded is not None else 4.0)
    if recorded is None:
        top, strip = figure.subplots(), None
    else:
        top, strip = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1.3])
    _draw_joint(top, joint, simulated, recorded)
    top.set_ylabel("angle [deg]")
    top.set_title(f"joint {joint}")
    if strip is not None and recorded is not None:
        _draw_error(strip, joint, simulated, recorded, noise, floor)
    low, high = span or _shared_span(simulated, recorded)
    stands = (stance or {}).get(joint)
    for axes in filter(None, (top, strip)):
        if stands is not None:
            _shade(axes, stands, "foot on the ground" if axes is top else None)
        axes.set_xlim(low, high)
    _widen(top)
    legend_above(top)
    (strip or top).set_xlabel("time since the first command [s]")
    return figure


@in_house_style
def joint_grid(
    simulated: Take, recorded: Take | None = None, *, noise: Mapping[str, float] | None = None,
    joints: Sequence[str] | None = None, stance: Stance | None = None, span: tuple[float, float] | None = None,
) -> Figure:
    """All joints, small, in rows of three (a leg each in the thesis's order), each with its RMS error and `noise` [rad]."""
    simulated = _zeroed_like(simulated, recorded)
    joints = tuple(joints or simulated.joints)
    low, high = span or _shared_span(simulated, recorded)
    figure, grid = panels(len(joints), columns=3, width=12, height=1.9)
    onto = align(simulated, recorded) if recorded is not None else None
    for axes, joint in zip(grid, joints):
        _draw_joint(axes, joint, simulated, recorded, width=1.2)
        axes.set_title(joint, fontsize=12)
        if stance and joint in stance:
            _shade(axes, stance[joint], None)
        if recorded is not None and onto is not None and joint in recorded.joints:
            use = since_start(recorded) >= 0
            error = float(rms(np.degrees(recorded.q[use, recorded.column(joint)] - onto.q[use, onto.column(joint)])))
            about = f"{error:.2f}° RMS"
            if noise is not None and np.isfinite(noise.get(joint, np.nan)):
                about += f", noise {np.degrees(noise[joint]):.2f}°"
            axes.set_title(about, loc="right", fontsize=10, fontweight="normal", color=ERROR)
        axes.set_xlim(low, high)
        _widen(axes)
    for axes in grid[-3:]:
        axes.set_xlabel("time [s]")
    for axes in grid[::3]:
        axes.set_ylabel("angle [deg]")
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper right", ncols=4)
    return figure


@in_house_style
def phase_portrait(joint: str, simulated: Take, recorded: Take | None = None) -> Figure:
    """Velocity over position of one joint after the first command: lag, friction and play show as a change of shape."""
    simulated = _zeroed_like(simulated, recorded)
    figure = new_figure(6.5, 5.5)
    axes = figure.subplots()
    names = names_of(simulated, recorded)
    for take, colour, label, size in ((recorded, RECORDED, names[1], 2.2), (simulated, SIMULATED, names[0], 1.4)):
        if take is None or joint not in take.joints:
            continue
        use = since_start(take) >= 0
        axes.plot(np.degrees(take.q[use, take.column(joint)]), np.degrees(_velocity(take, joint)[use]), color=colour,
                  label=label, linewidth=size, alpha=0.85)
    axes.set_xlabel("angle [deg]")
    axes.set_ylabel("velocity [deg/s]")
    axes.set_title(f"joint {joint}")
    legend_above(axes)
    return figure


def _draw_joint(axes: Axes, joint: str, simulated: Take, recorded: Take | None, width: float = 1.8) -> None:
    commands = simulated.commands or (recorded.commands if recorded is not None else None)
    if commands is not None and joint in commands.joints:
        clock = since_start(simulated)
        reference = np.degrees(commands.reference(clock)[:, commands.column(joint)])
        axes.plot(clock, reference, color=COMMAND, linewidth=0.7 * width, linestyle=(0, (4, 2)), label="command", zorder=2)
    names = names_of(simulated, recorded)
    for take, colour, label, size in ((recorded, RECORDED, names[1], width), (simulated, SIMULATED, names[0], 0.8 * width)):
        if take is not None and joint in take.joints:
            angle = np.degrees(take.q[:, take.column(joint)])
            axes.plot(since_start(take), angle, color=colour, label=label, linewidth=size, zorder=3)


def _draw_error(axes: Axes, joint: str, simulated: Take, recorded: Take, noise: float | None, floor: float | None) -> None:
    onto = align(simulated, recorded)
    clock = since_start(recorded)
    error = np.degrees(recorded.q[:, recorded.column(joint)] - onto.q[:, onto.column(joint)])
    says = [f"{float(rms(error[clock >= 0])):.2f}° RMS"]
    band = np.degrees(np.hypot(noise or 0.0, floor or 0.0))
    if np.isfinite(band) and band > 0:
        axes.axhspan(-2 * band, 2 * band, color=NOISE, linewidth=0, zorder=1.5)
    for value, what in ((noise, "noise"), (floor, "numerical floor")):
        if value is not None and np.isfinite(value):
            says.append(f"{what} {np.degrees(value):.2f}°")
    axes.axhline(0, color="#999999", linewidth=0.8)
    axes.plot(clock, error, color=ERROR, linewidth=1.1, zorder=3)
    axes.set_ylabel("error [deg]")
    names = names_of(simulated, recorded)
    title = f"{names[1]} minus {names[0]}: {', '.join(says)}" + (" (band: ±2σ of both)" if band > 0 else "")
    axes.set_title(title, fontsize=11, fontweight="normal")


def _shade(axes: Axes, stance: Array, label: str | None) -> None:
    for k, (a, b) in enumerate(stance):
        axes.axvspan(a, b, color=STANCE, linewidth=0, zorder=0.5, label=label if k == 0 else None)


def _widen(axes: Axes) -> None:
    """At least LEAST_SPAN, so that a joint that rests does not look as if it moved."""
    low, high = axes.get_ylim()
    if high - low < LEAST_SPAN:
        axes.set_ylim((low + high - LEAST_SPAN) / 2, (low + high + LEAST_SPAN) / 2)


def _zeroed_like(take: Take, other: Take | None) -> Take:
    return take.zeroed_at_rest() if other is not None and other.zeroed else take


def _shared_span(simulated: Take, recorded: Take | None) -> tuple[float, float]:
    clocks = [since_start(t) for t in (simulated, recorded) if t is not None]
    low, high = max(c[0] for c in clocks), min(c[-1] for c in clocks)
    return (max(low, -0.3), high) if high > low else (float(clocks[0][0]), float(clocks[0][-1]))


def _velocity(take: Take, joint: str) -> Array:
    """The take's own velocity, else the slope of a cubic through 50 ms around each sample."""
    if take.v is not None and np.isfinite(take.v[:, take.column(joint)]).any():
        return take.v[:, take.column(joint)]
    return differentiate(take.time, take.q[:, [take.column(joint)]], window=0.07).first[:, 0]
