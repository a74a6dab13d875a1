"""The robot as a row of stick figures: the replay in print."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from workbench.recording.take import Take
from workbench.robot.feet import tips
from workbench.robot.model import RobotModel
from workbench.types import Array
from workbench.view.figures.style import COMMAND, RECORDED, SIMULATED, grid_of, in_house_style
from workbench.view.playback import Playback, common_span, names_of, play
from workbench.view.shapes import robot_shapes

WIDEST = 2.5
"""Limit of the pictured distance, relative to that of the simulated robot."""


@in_house_style
def film_strip(
    model: RobotModel, simulated: Take, recorded: Take | None = None, *, instants: int = 6,
) -> Figure:
    """Side view from the right at `instants` evenly spaced times from the first command on. The recorded robot is aligned with
    the simulated one at rest; if it leaves the picture, its distance is printed. Far legs are thinner."""
    takes = [simulated] if recorded is None else [simulated, recorded]
    first, last = common_span(takes, lead=0.0)
    time = np.concatenate([[first - 0.1], np.linspace(first, last, instants)])  # the first stands for the rest
    played = play(simulated, model, time)
    names = names_of(simulated, recorded)
    films = [(played, SIMULATED, names[0], 1.0)]
    if recorded is not None:
        films.insert(0, (play(recorded, model, time, like=(simulated, played)), RECORDED, names[1], 0.75))
    shapes, left = robot_shapes(model), _links_on_the_left(model)
    ends = {model.kinematics.joint_of(link) or link: (link, tip) for link, tip in tips(model).items()} | shapes.feet
    own, *others = (_farthest(film, ends, played) for film, *_ in reversed(films))
    heights = [_heights(film, ends) for film, *_ in films]
    low, high = min(h[0] for h in heights), max(h[1] for h in heights)
    reach = max(80 * shapes.height, 60 * (high - low), 2 + 100 * min(max(own, *others, 0.0), WIDEST * own))
    figure, grid = grid_of(1, instants, 12, 2.9, aside=0.25, sharey=True)
    for k, axes in enumerate(grid, start=1):
        axes.axhline(0, color=COMMAND, linewidth=1.0, zorder=1)
        middle = played.base_p[k, 0]
        for film, colour, label, alpha in films:
            _draw_sticks(axes, model, film, k, ends, left, colour, alpha)
            axes.plot([], [], color=colour, label=label)
            _say_how_far(axes, 100 * (film.base_p[k, 0] - middle), reach, colour)
        axes.set_xlim(100 * middle - reach, 100 * middle + reach)
        axes.set_ylim(min(-3, 100 * low - 2), 100 * high + 3)
        axes.set_aspect("equal", adjustable="box")
        axes.set_title(f"{time[k]:.1f} s", fontsize=12)
        axes.set_xlabel("forward [cm]")
    grid[0].set_ylabel("height [cm]")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="upper right", ncols=2)
    return figure


def _say_how_far(axes: Axes, off: float, reach: float, colour: str) -> None:
    """Prints the distance of a robot `off` [cm] from the middle of a picture that extends to `reach` [cm], if it lies outside."""
    if abs(off) > reach:
        x, align, said = (0.02, "left", f"\u2190 {-off:.0f} cm") if off < 0 else (0.98, "right", f"{off:.0f} cm \u2192")
        axes.text(x, 0.5, said, transform=axes.transAxes, ha=align, va="center", color=colour, fontsize=10)


def _heights(film: Playback, ends: dict[str, tuple[str, Array]]) -> tuple[float, float]:
    """The lowest and the highest joint or end over all frames [m]."""
    z = [film.in_world(link)[0][:, 2] for link in film.links]
    z += [(p + R @ tip)[:, 2] for link, tip in ends.values() for p, R in (film.in_world(link),)]
    return float(np.nanmin(z)), float(np.nanmax(z))


def _farthest(film: Playback, feet: dict[str, tuple[str, Array]], played: Playback) -> float:
    """The largest distance [m] of a joint or foot ahead of or behind the base on which the pictures are centred."""
    places = [film.in_world(link) for link in film.links]
    tips = [(film.in_world(link), tip) for link, tip in feet.values()]
    x = [p[:, 0] for p, _ in places] + [(p + R @ tip)[:, 0] for (p, R), tip in tips]
    return float(np.nanmax(np.abs(np.array(x)[:, 1:] - played.base_p[None, 1:, 0])))


def _links_on_the_left(model: RobotModel) -> set[str]:
    """Links that lie to the left of the base in neutral, by more than a centimetre."""
    k = model.kinematics
    neutral = k.forward(np.zeros((1, len(model.joints))), model.joints)
    return {link for link in k.links if neutral[link][0][0, 1] > 0.01}


def _draw_sticks(
    axes: Axes, model: RobotModel, film: Playback, k: int, feet: dict[str, tuple[str, Array]], left: set[str], colour: str,
    alpha: float,
) -> None:
    kinematics = model.kinematics
    segments, widths = [], []
    for link in kinematics.links:
        p, R = (x[k] for x in film.in_world(link))
        joint = kinematics.joint_of(link)
        ends = []
        if joint is not None:
            ends.append(film.in_world(kinematics.frames[joint].parent)[0][k])
        if joint in feet:
            ends.append(p + R @ feet[joint][1])
        for end in ends:
            segments.append(100 * np.array([p[[0, 2]], end[[0, 2]]]))
            widths.append(1.4 if link in left else 2.8)
    axes.add_collection(LineCollection(segments, colors=colour, linewidths=widths, alpha=alpha, capstyle="round", zorder=3))
