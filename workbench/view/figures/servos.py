"""Load of the servos, their limits, and the wrench on the base that contacts cannot supply."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from workbench.compare.metrics import rms
from workbench.robot.model import RobotModel
from workbench.servo import ServoLaw
from workbench.types import Array
from workbench.view.figures.style import ACCENT, NOISE, OTHERS, RECORDED, SIMULATED, STANCE, in_house_style, new_figure, panels

_PARTS = {"t": ("top joints", OTHERS[2]), "m": ("middle joints", SIMULATED), "b": ("bottom joints", ACCENT),
          "": ("other joints", OTHERS[0])}


@in_house_style
def joint_torques(
    time: Array, joints: Sequence[str], torques: Mapping[str, Array], *, limit: Mapping[str, float] | None = None,
) -> Figure:
    """Torque on every joint over time, in rows of three. time: (N,) [s] since the first command. torques: label -> (N, n)
    [N m], at most three (simulated, from the measurement, …). limit: joint -> torque not to exceed [N m], dashed."""
    figure, grid = panels(len(joints), columns=3, width=12, height=1.9)
    for axes, (i, joint) in zip(grid, enumerate(joints)):
        for colour, (label, values) in zip((SIMULATED, RECORDED, ACCENT), torques.items()):
            axes.plot(time, values[:, i], color=colour, linewidth=1.0, label=label)
        if limit is not None and joint in limit:
            for sign in (-1, 1):
                axes.axhline(sign * limit[joint], color="#888888", linestyle="--", linewidth=0.9,
                             label="limit" if sign > 0 else None)
        axes.set_title(joint, fontsize=12)
        axes.margins(x=0)
    for axes in grid[-3:]:
        axes.set_xlabel("time [s]")
    for axes in grid[::3]:
        axes.set_ylabel("torque [N m]")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="upper right", ncols=4)
    return figure


@in_house_style
def servo_margins(model: RobotModel, joints: Sequence[str], motor_torque: Array, v: Array) -> Figure:
    """The load of each servo. Left: motor torque over joint speed of each sample, inside the servo's limits at its supply
    voltage. Right: peak torque and speed of each joint, relative to the available torque and the no-load speed.

    motor_torque: (N, n) [N m] of motor and gear, with reflected inertia and friction. v: (N, n) [rad/s].
    """
    figure = new_figure(12, 0.27 * len(joints) + 2.0)
    plane, bars = figure.subplots(1, 2, width_ratios=[1.2, 1])
    top = max(float(model.servo(j).line.no_load_speed) for j in joints)
    speed = np.linspace(-1.15 * top, 1.15 * top, 200)
    for servo in {model.servo(j) for j in joints}:
        for sign in (-1, 1):
            plane.plot(np.degrees(speed), sign * servo.line.motor_torque(sign * speed), color="#888888",
                       linewidth=1.2, label="servo at full duty" if sign > 0 else None)
        plane.axhspan(-servo.stall_torque / 5, servo.stall_torque / 5, color=STANCE, linewidth=0, zorder=0.5,
                      label="a fifth of stall torque (recommended limit)")
    share_torque, share_speed = _shares(model, joints, motor_torque, v)
    few = np.linspace(0, len(v) - 1, min(len(v), 1500)).astype(int)[:, None]
    for part, (label, colour) in _PARTS.items():
        use = [i for i, joint in enumerate(joints) if _part(joint) == part]
        if use:
            plane.plot(np.degrees(v[few, use]).ravel(), motor_torque[few, use].ravel(), ".", markersize=2, alpha=0.35,
                       color=colour, rasterized=True)
            plane.plot([], [], "o", color=colour, markersize=6, label=label)
    reach = max(1.2 * float(np.nanmax(np.abs(motor_torque), initial=0)), 0.5)
    plane.set_ylim(-reach, reach)
    plane.set_xlabel("joint speed [deg/s]")
    plane.set_ylabel("motor torque [N m]")
    plane.set_title("torque and speed required of the servos")
    rows = np.arange(len(joints))
    over = np.maximum(share_torque, share_speed) > 1
    bars.barh(rows - 0.2, 100 * share_torque, 0.36, color=SIMULATED, label="torque (limit at that speed)")
    bars.barh(rows + 0.2, 100 * share_speed, 0.36, color=OTHERS[1], label="speed (limit at no load)")
    bars.axvline(100, color=RECORDED, linewidth=1.4)
    bars.set_yticks(rows, list(joints))
    for label, beyond in zip(bars.get_yticklabels(), over):
        if beyond:
            label.set(color=RECORDED, fontweight="bold")
    bars.invert_yaxis()
    bars.grid(False, axis="y")
    bars.set_xlabel("peak, relative to the servo's limit [%]")
    figure.legend(*_merge_legends(plane, bars), loc="outside lower center", ncols=4)
    return figure


@in_house_style
def base_wrench(
    time: Array, residual: Array, sigma: Array | None = None, *, weight: float | None = None,
) -> Figure:
    """The wrench on the base that the motion requires and that contacts inside the friction cone cannot supply.

    time: (N,) [s] on the take's clock. residual: (N, 6) [moment about the base's origin N m, force N] in the world. sigma: (N,
    6), its standard deviation from the measurement's noise, drawn as ±2σ. weight: of the robot [N], for scale.
    """
    figure = new_figure(10, 5.4)
    rows = figure.subplots(2, 1, sharex=True)
    colours = (RECORDED, ACCENT, SIMULATED)
    for axes, first, unit, what in ((rows[0], 3, "N", "force"), (rows[1], 0, "N m", "moment")):
        for k, name in enumerate(("x, forward", "y, left", "z, up")):
            values = residual[:, first + k]
            if sigma is not None and np.nanmax(sigma[:, first + k], initial=0) > 0:
                band = 2 * sigma[:, first + k]
                axes.fill_between(time, -band, band, color=NOISE, alpha=0.5, linewidth=0, zorder=1)
            axes.plot(time, values, color=colours[k], linewidth=1.1, label=name)
        axes.axhline(0, color="#999999", linewidth=0.8)
        size = float(rms(np.linalg.norm(residual[:, first : first + 3], axis=1)))
        says = f"{what} that contacts cannot supply: {size:.3g} {unit} RMS"
        if weight and first == 3:
            says += f", {100 * size / weight:.0f} % of the weight"
        axes.set_title(says)
        axes.set_ylabel(f"{what} [{unit}]")
        axes.margins(x=0)
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
    rows[1].set_xlabel("time [s]")
    return figure


def _shares(model: RobotModel, joints: Sequence[str], torque: Array, v: Array) -> tuple[Array, Array]:
    """Largest ratio of torque to the torque available at the current speed, and of speed to no-load speed, per joint."""
    line = ServoLaw.of([model.servo(j) for j in joints]).line
    left = np.maximum(line.motor_torque(v * np.sign(torque)), 0.05 * line.full_torque)
    return np.nanmax(np.abs(torque) / left, axis=0, initial=0), np.nanmax(np.abs(v) / line.no_load_speed, axis=0, initial=0)


def _part(joint: str) -> str:
    """Which joint of a leg it is, by the thesis's names (flt, flm, flb); empty for all others."""
    return joint[-1] if len(joint) == 3 and joint[0] in "fb" and joint[1] in "lr" and joint[-1] in "tmb" else ""


def _merge_legends(*all_axes: Axes) -> tuple[list[Any], list[str]]:
    found: dict[str, Any] = {}
    for axes in all_axes:
        handles, labels = axes.get_legend_handles_labels()
        found |= dict(zip(labels, handles))
    return list(found.values()), list(found)
