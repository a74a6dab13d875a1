"""Figures of the rig: features of its logs before any model, and predictions of models for the gain that they did not see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from studies.xl330.rig import Log
from studies.xl330.station import Played
from workbench.robot import GRAVITY
from workbench.types import Array
from workbench.view.figures import style

SLOW = 1.0
"""[rad/s] below which the arm's weight and the motor's torque nearly balance, but for friction."""


@style.in_house_style
def draw_balance(logs: Sequence[Log], stall_torque: float) -> Figure:
    """The arm's weight over the motor's duty, wherever the arm is slow and the torque on: going up, down, or held."""
    figure = style.new_figure(10, 5.5)
    panel = figure.subplots()
    groups: dict[str, list[tuple[Array, Array]]] = {"lifting": [], "held": [], "lowering": []}
    for log in logs:
        c = {name.partition(".")[0]: values for name, values in log.read().channels.items()}
        smooth = np.convolve(c["velocity"], np.ones(9) / 9, mode="same")
        weight = log.mass * GRAVITY * log.length * np.sin(c["position"])
        slow = (c["enabled"] > 0.5) & (np.abs(smooth) < SLOW)
        up = smooth * np.sign(weight)
        for name, rows in (("lifting", up > 0.15), ("held", np.abs(up) < 0.02), ("lowering", up < -0.15)):
            use = slow & rows
            groups[name].append((c["duty"][use], weight[use]))
    for (name, parts), colour in zip(groups.items(), (style.RECORDED, style.COMMAND, style.SIMULATED)):
        x, y = (np.concatenate([p[i] for p in parts]) for i in (0, 1))
        panel.plot(x, y, ".", ms=2.5, alpha=0.5, color=colour, label=name)
    ends = np.array([-1.0, 1.0])
    panel.plot(ends, stall_torque * ends, color=style.ERROR, lw=1.2, ls="--", label="M1 without friction")
    panel.set_xlabel("duty, as the servo logs it")
    panel.set_ylabel("torque of the arm's weight [N m]")
    panel.set_ylim(-0.5, 0.5)
    style.legend_above(panel)
    return figure


@style.in_house_style
def draw_logs(models: Mapping[str, Mapping[str, Played]], title: str) -> Figure:
    """Recorded angles and models', by model and log; a panel for each log."""
    logs = next(iter(models.values()))
    figure = style.new_figure(12, 3.1 * ((len(logs) + 1) // 2))
    colours = dict(zip(models, (style.COMMAND, style.SIMULATED)))
    panels = np.atleast_1d(figure.subplots((len(logs) + 1) // 2, 2, sharex=True)).ravel()
    for (name, log), panel in zip(logs.items(), panels):
        panel.plot(log.time, np.degrees(log.recorded), color=style.RECORDED, lw=2.4, label="recorded")
        for label, of in models.items():
            panel.plot(of[name].time, np.degrees(of[name].simulated), color=colours[label], lw=1.3, label=label)
        panel.set_title(name.rsplit("_", 1)[0].replace("_", " "))
        panel.set_ylabel("angle [deg]")
    for panel in panels[max(0, len(logs) - 2):]:
        panel.set_xlabel("time [s]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold", fontsize=13)
    return figure
