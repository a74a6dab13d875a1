"""Tables and figure of studies/joint_signs.py."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np

from studies.gait import TURNED, Gait
from studies.joint_signs_rule import FINAL_PITCH, FINAL_ROLL, FREE, Choice, Verdict, label
from workbench.files.reading import write_whole

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

THESIS_DISTANCE = (0.3235, 0.3270, 0.3701)
"""Six seconds of the ROBOTIS walk [m]: the thesis's two simulations, its robot."""


def write_report(out: Path, screened: Mapping[Choice, Gait], ranked: Sequence[Verdict],
                 conditions: Sequence[str]) -> None:
    """every.csv: all choices of the first stage. survivors.csv: those that walked in it, the chosen one first, each criterion's
    mean over the conditions. runs.csv: the same, run by run. distance.csv: how far, compared afterwards. joint_signs.png.
    conditions: their names."""
    write_whole(out / "every.csv", _csv(["choice", "fell", "goes_forward", "heading_deg", "slip_mm_s"], [
        [label(c), g.fell, g.forward > 0, _deg(g.heading), f"{1e3 * g.slip:.1f}"] for c, g in screened.items()]))
    write_whole(out / "survivors.csv", _csv(
        ["choice", "walks_in", "knees_alike", "criteria_met", "front_pull_N", "tail_ratio", "top_ratio_front", "top_ratio_hind",
         "roll_deg", "pitch_deg", *ranked[0].met(), "slip_mm_s"],
        [[label(v.choice), f"{v.walked}/{len(conditions)}", v.alike, sum(v.met().values()),
          f"{v.mean(lambda g: g.front_pull):.2f}", f"{v.tail:.2f}",
          f"{v.mean(lambda g: g.tops[0]):.2f}", f"{v.mean(lambda g: g.tops[1]):.2f}",
          _deg(v.mean(lambda g: g.roll[1])), _deg(v.mean(lambda g: g.pitch[1])), *v.met().values(),
          f"{1e3 * v.mean(lambda g: g.slip):.0f}"] for v in ranked]))
    write_whole(out / "runs.csv", _csv(
        ["choice", "condition", "walks", "fell", "heading_deg", "front_pull_N", "tail_ratio", "top_ratio_front", "top_ratio_hind",
         "roll_deg", "pitch_deg", "slip_mm_s"],
        [[label(v.choice), c, g.walks, g.fell, _deg(g.heading), f"{g.front_pull:.2f}", f"{g.tail:.2f}", f"{g.tops[0]:.2f}",
          f"{g.tops[1]:.2f}", _deg(g.roll[1]), _deg(g.pitch[1]), f"{1e3 * g.slip:.0f}"]
         for v in ranked for c, g in zip(conditions, v.gaits)]))
    robotis, matlab, robot = THESIS_DISTANCE
    write_whole(out / "distance.csv", _csv(
        ["choice", *(f"{c}: forward_m" for c in conditions), "thesis_robot_m", "thesis_simulations_m"],
        [[label(v.choice), *(f"{g.forward:.3f}" for g in v.gaits), robot, f"{robotis} {matlab}"] for v in ranked]))
    _figure(out / "joint_signs.png", ranked)


def _deg(angle: float) -> str:
    return f"{np.degrees(angle):.1f}"


def _csv(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()


def _figure(path: Path, ranked: Sequence[Verdict]) -> None:
    """Signs of each choice, the chosen one on top, beside each criterion and, last, what took no part: slip and distance."""
    fig, axes = plt.subplots(1, 9, figsize=(19, 0.3 * len(ranked) + 2), sharey=True,
                             width_ratios=(1.5, 1.1, 1, 1, 1, 1, 1, 1, 1.2), layout="constrained")
    signs, heading, pull, tail, tops, roll, pitch, slip, forward = axes
    signs.imshow([[(s + 1) / 2 for s in v.choice] for v in ranked], cmap="coolwarm", vmin=-0.4, vmax=1.4, aspect="auto")
    for i, v in enumerate(ranked):
        for k, s in enumerate(v.choice):
            signs.text(k, i, "+" if s > 0 else "−", ha="center", va="center", fontsize=9)
        signs.text(len(FREE) - 0.4, i, f"{v.walked}/{len(v.gaits)}{' alike' if v.alike else ''}  {sum(v.met().values())}/4",
                   va="center", fontsize=8, color=_colour(v))
    _dots(heading, ranked, lambda g: np.degrees(g.heading), "heading after 6 s, deg",
          (-float(np.degrees(TURNED)), float(np.degrees(TURNED))))
    heading.set_xlim(-90, 90)
    _dots(pull, ranked, lambda g: g.front_pull, "front legs' pull less\nhind legs', N", (0, 8))
    _dots(tail, ranked, lambda g: g.tail, "tail, of its goals", (0, 1))
    _dots(tops, ranked, lambda g: float(np.mean(g.tops)), "tops, of their goals", (0, 1))
    _spread(roll, ranked, lambda g: g.roll, "roll, last cycle, deg", FINAL_ROLL)
    _spread(pitch, ranked, lambda g: g.pitch, "pitch (nose up), last cycle, deg", FINAL_PITCH)
    _dots(slip, ranked, lambda g: 1e3 * g.slip, "slip of loaded feet, mm/s\n(took no part)", None)
    _dots(forward, ranked, lambda g: 100 * g.forward, "forward in 6 s, cm\n(compared afterwards)", None)
    forward.set_xlim(-30, 100)
    for d in THESIS_DISTANCE:
        forward.axvline(100 * d, color="tab:orange", lw=1)
    signs.set_xticks(range(len(FREE)), FREE)
    signs.set_xlim(-0.5, len(FREE) + 3.5)
    signs.set_yticks([])
    signs.set_title("sign; walks in; criteria met")
    signs.set_ylim(len(ranked) - 0.5, -0.5)
    fig.suptitle("Choices of joint signs that walk for 3 s, a dot for each condition. Green: as the robot is known to be; "
                 "orange: the thesis's robot and simulations.\nBlue: walks in all conditions, knees alike; black: walks in all; "
                 "the top one is chosen")
    image = io.BytesIO()
    fig.savefig(image, dpi=110)
    plt.close(fig)
    write_whole(path, image.getvalue())


def _colour(v: Verdict) -> str:
    if v.walked < len(v.gaits):
        return "0.6"
    return "tab:blue" if v.alike else "black"


def _dots(ax: Axes, ranked: Sequence[Verdict], quantity: Callable[[Gait], float], title: str,
          known: Sequence[float] | None) -> None:
    for i, v in enumerate(ranked):
        values = [quantity(g) for g in v.gaits if not g.fell]
        ax.plot(values, [i] * len(values), "o", ms=4, color=_colour(v), alpha=0.8)
    _dress(ax, title, known)


def _spread(ax: Axes, ranked: Sequence[Verdict], angle: Callable[[Gait], tuple[float, float, float]], title: str,
            final: tuple[float, float]) -> None:
    for i, v in enumerate(ranked):
        low, mean, high = np.degrees(v.spread(angle))
        ax.plot([low, high], [i, i], color=_colour(v), lw=2)
        ax.plot(mean, i, "o", ms=4, color=_colour(v))
    ax.set_xlim(-15, 15)
    _dress(ax, title, np.degrees(final).tolist())


def _dress(ax: Axes, title: str, known: Sequence[float] | None) -> None:
    if known is not None:
        ax.axvspan(known[0], known[1], color="tab:green", alpha=0.15)
    ax.axvline(0, color="0.8", lw=0.8)
    ax.grid(axis="x", alpha=0.3)
    ax.set_title(title, fontsize=9)
