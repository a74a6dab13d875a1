"""A torque that no effect describes, over its arguments."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from workbench.identify.results.servo_law import UnknownTorque
from workbench.robot.torque_table import UNITS
from workbench.view.figures.style import NOISE, SIMULATED, in_house_style, new_figure

_LABELS = {"angle": "angle", "angle and direction": "angle, times the direction of motion", "duty": "duty",
           "duty and direction": "absolute duty, times the direction of motion", "speed": "speed"}
_NORMAL90 = 1.645
"""Half width of a 90 % interval in standard deviations."""


@in_house_style
def unknown_torque(unknown: UnknownTorque) -> Figure:
    """Each table with its 90 % band."""
    figure = new_figure(12, 3.4)
    panels = figure.subplots(1, len(unknown.tables), sharey=True, squeeze=False)[0]
    for axes, table, sd in zip(panels, unknown.tables, unknown.sd):
        at, torque, half = np.array(table.at), 1e3 * np.array(table.torque), 1e3 * _NORMAL90 * np.array(sd)
        axes.fill_between(at, torque - half, torque + half, color=NOISE, linewidth=0)
        axes.plot(at, torque, color=SIMULATED)
        axes.axhline(0.0, color="#888888", linewidth=0.8)
        unit = UNITS[table.depends_on]
        axes.set_xlabel(_LABELS[table.depends_on] + ("" if unit == "1" else f" [{unit}]"))
    panels[0].set_ylabel(f"torque at {unknown.joint} [mN m]")
    return figure
