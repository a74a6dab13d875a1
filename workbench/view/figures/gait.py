"""A certified gait as figures: the margin of each limit, and its performance on random variants of the robot."""

from __future__ import annotations

import math

from matplotlib.figure import Figure

from workbench.gait.certificate import Certificate
from workbench.gait.limits import each
from workbench.view.figures.style import ACCENT, COMMAND, FLOOR, RECORDED, SIMULATED, in_house_style, new_figure


@in_house_style
def limit_bars(certificate: Certificate) -> Figure:
    """The worst value of each limit, relative to the limit: above 1 the limit is exceeded. Recommendations are hatched."""
    rows = sorted(each(certificate.margins), key=lambda item: item[1].use)
    figure = new_figure(10, 0.42 * len(rows) + 1.2)
    axes = figure.add_subplot()
    for k, (_, m) in enumerate(rows):
        use = min(m.use, 2.6)
        colour = COMMAND if m.advice else RECORDED if m.use > 1 else FLOOR if m.use > 0.95 else SIMULATED
        axes.barh(k, max(use, 0.0), color=colour, hatch="//" if m.advice else None, edgecolor="white", height=0.7)
        where = "" if m.where in ("robot", "table") else f" ({m.where})"
        axes.annotate(f"{short(m.value)} of {short(m.limit)} {m.unit}{where}", (max(use, 0.0), k), xytext=(5, 0),
                      textcoords="offset points", va="center", fontsize=10, zorder=4,
                      bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.2})
    axes.set_yticks(range(len(rows)), [name for name, _ in rows])
    axes.axvline(1.0, color=RECORDED, linewidth=1.4)
    axes.set_xlim(0, max(1.9, max(min(m.use, 2.6) for _, m in rows) + 0.9))
    axes.set_xlabel("value / limit")
    axes.grid(axis="y", visible=False)
    return figure


def short(value: float) -> str:
    """Three digits; a negligible value becomes 0."""
    return "0" if abs(value) < 1e-3 else f"{value:.3g}"


@in_house_style
def draw_ranges(certificate: Certificate) -> Figure:
    """Lowest, 5 %, median, 95 % and highest value of each quantity over the ensemble, and the nominal robot's. With few draws
    there are no percentiles."""
    told = [(k, v) for k, v in certificate.draws.items() if isinstance(v, list) and k not in ("quantiles", "incidents")]
    rows = [(k, v) for k, v in told if all(v[i] is not None and math.isfinite(v[i]) for i in (0, 2, 4))]
    nominal = _nominal(certificate)
    figure = new_figure(10, 0.9 * len(rows) + 0.6)
    for axes, (name, (low, five, half, ninety_five, high)) in zip(figure.subplots(len(rows), 1, squeeze=False).flat, rows):
        axes.plot([low, high], [0, 0], color=COMMAND, linewidth=1.2)
        if five is not None and ninety_five is not None:
            axes.plot([five, ninety_five], [0, 0], color=SIMULATED, linewidth=8, solid_capstyle="butt")
        axes.plot([half], [0], "o", color="white", markeredgecolor=SIMULATED, markersize=8)
        if name in nominal:
            axes.plot([nominal[name]], [0], "|", color=ACCENT, markersize=22, markeredgewidth=3)
        axes.set_yticks([0], [name])
        axes.set_ylim(-1, 1)
        axes.grid(axis="y", visible=False)
    return figure


def _nominal(certificate: Certificate) -> dict[str, float]:
    n = certificate.nominal
    values = {"heading deg/m": n.heading, "slip m/s": n.slip, "foot clearance mm": n.clearance, "tipping margin deg": n.tipping,
              "electrical power W": n.power, "tilt deg": n.tilt, f"speed {n.unit}": n.speed,
              "largest RMS torque N m": n.largest_rms}
    return {k: v for k, v in values.items() if math.isfinite(v)}
