"""A planned gait and the simulated motion of its table, over one cycle."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from workbench.gait.plan_compare import PlanComparison
from workbench.view.figures.style import COMMAND, SIMULATED, in_house_style, new_figure


@in_house_style
def plan_and_run(c: PlanComparison) -> Figure:
    """Height and tilt of the base, and each foot's height: planned (grey) and simulated, the mean of the cycles."""
    figure = new_figure(10, 6.5)
    base, feet = figure.subplots(2, 1, sharex=True)
    for motion, colour, name in ((c.planned, COMMAND, "planned"), (c.simulated, SIMULATED, "simulated")):
        base.plot(c.phases, 1000 * (motion.p[:, 2] - c.planned.p[:, 2].mean()), color=colour, label=f"{name}: height [mm]")
        base.plot(c.phases, np.degrees(np.arcsin(np.clip(-motion.R[:, 2, 0], -1, 1))), color=colour, linestyle="--",
                  label=f"{name}: nose down [deg]")
        for i, foot in enumerate(c.feet):
            feet.plot(c.phases, 1000 * motion.feet[:, i, 2] + 40 * i, color=colour, label=name if i == 0 else None)
            feet.annotate(foot, (1.0, 40 * i), xytext=(4, 0), textcoords="offset points")
    base.set_ylabel("base, relative to the planned mean")
    base.legend(loc="upper right", ncols=2, fontsize=9)
    feet.set_ylabel("foot heights [mm], offset by 40")
    feet.set_xlabel("fraction of the cycle")
    feet.legend(loc="upper right", fontsize=9)
    return figure
