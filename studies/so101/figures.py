"""Figures of the SO-101's study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from studies.so101.programmes import Programme
from studies.so101.published import PUBLISHED
from studies.so101.rest import Current
from studies.so101.rows import Rows
from workbench.recording.formats.sage import JOINTS
from workbench.types import Array
from workbench.view.figures import style

COLOURS = {"nominal": style.SIMULATED, "delay and gain": style.FLOOR, "read off": style.OTHERS[0], "diagnosed": style.ACCENT,
           **dict(zip((p.name for p in PUBLISHED), style.OTHERS[1:]))}


@style.in_house_style
def draw_loops(slow: Programme, nominal: Array, unit: Array) -> Figure:
    """Error against goal of each joint in a slow programme, recorded and nominal."""
    figure = style.new_figure(12, 6.5)
    for i, (axes, joint) in enumerate(zip(figure.subplots(2, 3).flat, JOINTS)):
        goal = slow.sent[:, i] * unit[i]
        axes.plot(goal, (slow.sent - slow.read)[:, i] * unit[i], color=style.RECORDED, lw=0.8, label="recorded")
        axes.plot(goal, (slow.sent - nominal)[:, i] * unit[i], color=style.SIMULATED, lw=0.8, label="nominal")
        axes.set_title(joint)
        if i > 2:
            axes.set_xlabel("goal [deg]")
        if i % 3 == 0:
            axes.set_ylabel("goal − position [deg]")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure


@style.in_house_style
def draw_current(rows: Sequence[Rows], laws: Sequence[Current]) -> Figure:
    """The register of joints that stand against their error, and the parabolas."""
    figure = style.new_figure(9, 4.5)
    axes = figure.subplots()
    for law, colour in zip(laws, (style.SIMULATED, style.RECORDED, style.ACCENT, *style.OTHERS)):
        i = JOINTS.index(law.joint)
        e = np.concatenate([np.degrees(np.abs(r.error(i)))[r.standing[:, i]] for r in rows])
        seen = np.concatenate([r.of.register[r.frame, i][r.standing[:, i]] for r in rows])
        axes.plot(e, seen, ".", ms=2, alpha=0.3, color=colour)
        at = np.linspace(0, 6.5, 100)
        axes.plot(at, law.scale.value * np.radians(at) ** 2, color=colour, label=f"{law.joint}: error squared")
    axes.set_xlabel("size of the error of a joint that stands [deg]")
    axes.set_ylabel("tau_abs")
    axes.set_xlim(0, 6.5)
    style.legend_above(axes)
    return figure


@style.in_house_style
def draw_overlay(p: Programme, paths: Mapping[str, Array], unit: Array, span: tuple[float, float]) -> Figure:
    """Goal, recording and models of one programme over a stretch of time [s]."""
    figure, panels = style.panels(len(JOINTS), 2, 13, 2.3)
    use = (p.time >= span[0]) & (p.time <= span[1])
    for i, (axes, joint) in enumerate(zip(panels, JOINTS)):
        axes.plot(p.time[use], p.sent[use, i] * unit[i], color=style.COMMAND, lw=1, ls="--", label="goal")
        axes.plot(p.time[use], p.read[use, i] * unit[i], color=style.RECORDED, lw=2.2, label="recorded")
        for name, path in paths.items():
            axes.plot(p.time[use], path[use, i] * unit[i], color=COLOURS[name], lw=1.2, label=name)
        axes.set_title(f"{joint} [deg]")
    for axes in panels[-2:]:
        axes.set_xlabel("time [s]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="upper right", ncols=6)
    return figure


@style.in_house_style
def draw_errors(by_model: Mapping[str, Array]) -> Figure:
    """RMS error of each joint (6,) [deg] on validation programmes, model by model."""
    figure = style.new_figure(10, 4)
    axes = figure.subplots()
    width = 0.8 / len(by_model)
    for k, (name, values) in enumerate(by_model.items()):
        axes.bar(np.arange(len(JOINTS)) + (k - (len(by_model) - 1) / 2) * width, values, width * 0.92, color=COLOURS[name],
                 label=name)
    axes.set_xticks(np.arange(len(JOINTS)), JOINTS)
    axes.set_ylabel("RMS error on validation [deg]")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure
