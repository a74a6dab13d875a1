"""The trial's figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from studies.concealed_effects.score import ParameterScore
from studies.concealed_effects.summary import NOTHING, Bin
from workbench.view.figures.style import ACCENT, COMMAND, RECORDED, SIMULATED, in_house_style, legend_above, new_figure

LAST = ("abstained", "failed")
"""Columns that stand behind all names."""
WIDEST = 1.0
"""Relative error at which the figure of sizes ends."""


@in_house_style
def confusion_figure(counts: Counter[tuple[str, str]]) -> Figure:
    """Confusion matrix: true effects down, named effects across; on the diagonal its own name, alone or in a tie."""
    rows = sorted({t for t, _ in counts} - {NOTHING}) + [NOTHING] * any(t == NOTHING for t, _ in counts)
    names = sorted({c for _, c in counts} - set(LAST))
    columns = sorted({*names, *rows} - {NOTHING}) + list(LAST)
    table = np.array([[counts[(t, c)] for c in columns] for t in rows])
    figure = new_figure(3.2 + 0.31 * len(columns), 2.4 + 0.29 * len(rows))
    axes = figure.subplots()
    axes.grid(False)
    right = np.array([[t == c for c in columns] for t in rows])
    wrong = np.array([[c not in LAST for c in columns] for _ in rows]) & ~right
    for where, colour in ((right, ACCENT), (wrong, RECORDED), (~right & ~wrong, COMMAND)):
        shades = LinearSegmentedColormap.from_list("shade", ["white", colour])
        top = max(1, int(table[where].max(initial=0)))
        axes.imshow(np.ma.masked_where(~where, table), cmap=shades, vmin=0, vmax=1.3 * top, aspect="auto")
    for (i, j), n in np.ndenumerate(table):
        if n:
            axes.text(j, i, str(n), ha="center", va="center", fontsize=10, color="#222222")
    axes.set_xticks(range(len(columns)), [_spoken(c) for c in columns], rotation=60, ha="right", rotation_mode="anchor",
                    fontsize=10)
    axes.set_yticks(range(len(rows)), [_spoken(t) for t in rows], fontsize=10)
    axes.axvline(len(columns) - len(LAST) - 0.5, color=COMMAND, linewidth=0.8)
    axes.set_xlabel("called")
    axes.set_ylabel("hidden")
    return figure


@in_house_style
def reliability_figure(bins: Sequence[Bin]) -> Figure:
    """How often findings are true against how sure they are; bars are 95 % intervals, the diagonal is a calibrated diagnosis."""
    figure = new_figure(6.2, 5.6)
    axes, below = figure.subplots(2, 1, sharex=True, height_ratios=[4, 1])
    axes.plot([0.5, 1], [0.5, 1], color=COMMAND, linestyle="--", linewidth=1.2, label="calibrated")
    for b in bins:
        colour = ACCENT if b.holds else RECORDED
        axes.plot([b.confidence] * 2, [b.low, b.high], color=colour, linewidth=2.2)
        axes.plot(b.confidence, b.true / b.findings, "o", color=colour, markersize=8)
    axes.set_ylim(-0.03, 1.03)
    axes.set_ylabel("share that is true")
    axes.legend(loc="lower right")
    below.bar([b.confidence for b in bins], [b.findings for b in bins], width=0.02, color=SIMULATED)
    for b in bins:
        below.text(b.confidence, b.findings, f" {b.findings}", ha="center", va="bottom", fontsize=10)
    below.set_ylim(0, 1.35 * max([b.findings for b in bins], default=1))
    below.set_xlim(0.48, 1.02)
    below.set_ylabel("findings")
    below.set_xlabel("confidence stated")
    return figure


@in_house_style
def sizes_figure(sizes: Sequence[ParameterScore]) -> Figure:
    """Each size that was given: relative error, and its 90 % interval about the truth at 0; beyond the edge an arrow."""
    names = sorted({p.effect for p in sizes}, reverse=True)
    figure = new_figure(8.6, 1.6 + 0.36 * max(1, len(names)))
    axes = figure.subplots()
    axes.axvspan(-0.15, 0.15, color="#EDEFF3", zorder=0)
    axes.axvline(0, color=COMMAND, linewidth=1)
    for i, name in enumerate(names):
        mine = sorted((p for p in sizes if p.effect == name), key=lambda p: p.truth)
        for k, p in enumerate(mine):
            y = i + 0.62 * ((k + 0.5) / len(mine) - 0.5)
            colour = ACCENT if p.inside else RECORDED
            low, value, high = (np.clip((x - p.truth) / p.scale, -WIDEST, WIDEST) for x in (p.low, p.value, p.high))
            axes.plot([low, high], [y, y], color=colour, linewidth=1.5)
            edge = ">" if value >= WIDEST else "<" if value <= -WIDEST else "o"
            axes.plot(value, y, edge, color=colour, markersize=4.5)
    axes.set_yticks(range(len(names)), [_spoken(n) for n in names])
    axes.set_ylim(-0.7, max(0, len(names) - 1) + 0.7)
    axes.set_xlim(-1.03 * WIDEST, 1.03 * WIDEST)
    ticks = np.linspace(-WIDEST, WIDEST, 9)
    axes.set_xticks(ticks, [f"{100 * x:+.0f} %" if x else "truth" for x in ticks])
    axes.set_xlabel("error relative to the true size")
    return figure


@in_house_style
def time_figure(seconds: Sequence[float], memory: Sequence[float]) -> Figure:
    """How long a diagnosis took [s], and the most memory that it held [bytes]."""
    figure = new_figure(9.0, 3.4)
    for axes, values, label in zip(figure.subplots(1, 2), (np.divide(seconds, 60), np.divide(memory, 1e9)),
                                   ("minutes", "gigabytes at most")):
        known = values[np.isfinite(values)]
        if len(known):
            axes.hist(known, bins=min(20, max(5, len(known) // 4)), color=SIMULATED)
            axes.axvline(np.median(known), color=RECORDED, label=f"median {np.median(known):.1f}")
            legend_above(axes)
        axes.set_xlabel(label)
        axes.set_ylabel("sessions")
    return figure


def _spoken(name: str) -> str:
    return name.replace("_", " ")
