"""How fast may a gait be for how much torque? The front of speed against the largest RMS torque of a servo, certified.

For each speed the gentlest gait that keeps it (`workbench optimize --gentlest --speed V`), in OUT/front/V; a gait that exists
there with its certificate is not searched again, so that an interrupted study continues. For comparison the ROBOTIS walk, and
ROBOTIS's rule: a fifth of stall.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from studies.common import publish, run_study
from workbench.device.tables.limits import RECOMMENDED
from workbench.gait.certificate import NAME, PUPPY_CLAIM
from workbench.gait.engines import other_engine
from workbench.gait.ensemble import load_ensemble
from workbench.gait.machine import GaitMachine
from workbench.gait.optimize import MEMORY, optimize, options_of, robotis_walk, write_gait
from workbench.gait.request import Request
from workbench.robot import ServoConstants, puppy_model
from workbench.view.figures.style import ACCENT, OTHERS, SIMULATED, in_house_style, new_figure
from workbench.view.report.page import Picture, Provenance, Report, Section, Table, Text

SPEEDS = (0.05, 0.10, 0.15, 0.20, 0.25, 0.30, 0.35, 0.40)
"""To keep on the nominal robot [m/s]."""
EFFORT = 2
RULE = RECOMMENDED * ServoConstants().torque_at_full_duty
"""What ROBOTIS advises for an AX-12A that works on [N m]."""


def study(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Searches for the missing gaits, and draws the front."""
    model = puppy_model()
    speeds = SPEEDS[1:2] if quick else SPEEDS
    rows: list[dict[str, Any]] = []
    for k, speed in enumerate(speeds):
        folder = out / "front" / f"{speed:.2f}"
        progress(f"gentlest at {speed:g} m/s", k / len(speeds))
        if not (folder / NAME).exists():
            folder.mkdir(parents=True, exist_ok=True)
            _sought(folder, speed, 1 if quick else EFFORT, lambda what, share=None, v=speed, k=k: progress(  # type: ignore[misc]
                f"gentlest at {v:g} m/s: {what}", k / len(speeds)))
        if (folder / NAME).exists():
            rows.append(_row(speed, json.loads((folder / NAME).read_text())))
    m = robotis_walk(model)
    walk = float(m.speed), float(max(m.rms))
    figure = _drawn(rows, walk)
    said = "; ".join(f"{r['RMS torque N m']:.2f} N m at {r['speed m/s']:.2f} m/s" for r in _front(rows))
    report = Report("Speed against torque", f"On the model, the front: {said or 'nothing found'}.",
                    f"{__doc__}\n\n{PUPPY_CLAIM}", [], Provenance.of(model))
    header = ["asked [m/s]", "goes [m/s]", "5th percentile [m/s]", "fell of draws", "largest RMS torque [N m]", "of",
              "95th percentile [N m]", "heading [deg/m RMS]", "certificate"]
    report.add(Section("Certified gaits", [
        Picture(figure, f"The ROBOTIS walk: {walk[0]:.2f} m/s at {walk[1]:.2f} N m."),
        Table(header, [list(map(str, _cells(r))) for r in rows]),
        Text("A gait is on the front where no other goes at least as fast with less torque.")]))
    return publish(out, model, report, {"gaits": rows, "ROBOTIS walk": walk}, {"front": figure})


def _sought(folder: Path, speed: float, effort: int, progress: Callable[[str, float | None], None]) -> None:
    request = Request(speed=speed, aim="gentleness")
    result = optimize(GaitMachine(puppy_model()), request, load_ensemble(), options_of(effort, 0, 2),
                      progress, folder / MEMORY, other_engine())
    if result.table is not None and result.certified is not None:
        write_gait(folder, result.table, result.certified)


def _row(asked: float, certificate: Mapping[str, Any]) -> dict[str, Any]:
    nominal, draws = certificate["nominal"], certificate["draws"]
    worst = max(nominal["RMS torque N m"], key=nominal["RMS torque N m"].get)
    return {"asked m/s": asked, "speed m/s": nominal["speed"], "speed, 5th percentile": draws["speed m/s"][1],
            "falls": f"{draws['falls']} of {draws['count']}", "RMS torque N m": nominal["RMS torque N m"][worst], "joint": worst,
            "RMS torque, 95th percentile": draws["largest RMS torque N m"][3], "heading deg/m RMS": draws["heading deg/m RMS"],
            "kept": certificate["kept"]}


def _cells(r: Mapping[str, Any]) -> tuple[object, ...]:
    return (f"{r['asked m/s']:.2f}", f"{r['speed m/s']:.3f}", f"{r['speed, 5th percentile']:.3f}", r["falls"],
            f"{r['RMS torque N m']:.3f}", r["joint"], f"{r['RMS torque, 95th percentile']:.3f}", f"{r['heading deg/m RMS']:.0f}",
            "kept" if r["kept"] else "broken")


def _front(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    kept = [r for r in rows if r["kept"]]
    return [r for r in kept if not any(o is not r and o["speed m/s"] >= r["speed m/s"] and
                                       o["RMS torque N m"] < r["RMS torque N m"] for o in kept)]


@in_house_style
def _drawn(rows: list[dict[str, Any]], walk: tuple[float, float]) -> Figure:
    figure = new_figure(7, 4.5)
    axes = figure.subplots()
    front = sorted(_front(rows), key=lambda r: r["RMS torque N m"])
    axes.plot([r["RMS torque N m"] for r in front], [r["speed m/s"] for r in front], color=ACCENT, lw=1.5, label="front")
    for r in rows:
        axes.plot([r["RMS torque N m"]] * 2, [r["speed, 5th percentile"], r["speed m/s"]], color=SIMULATED, lw=1, alpha=0.6)
    certified = "certified; line down to the 5th percentile of the draws"
    for kept, face, label in ((True, SIMULATED, certified), (False, "white", "refused")):
        here = [r for r in rows if r["kept"] == kept]
        axes.plot([r["RMS torque N m"] for r in here], [r["speed m/s"] for r in here], "o", color=SIMULATED, markerfacecolor=face,
                  label=label if here else None)
    axes.plot(walk[1], walk[0], "s", color=OTHERS[0], label="ROBOTIS walk")
    axes.axvline(RULE, color=OTHERS[3], ls=":", lw=1, label="a fifth of stall")
    axes.set_xlabel("largest RMS torque of a servo [N m]")
    axes.set_ylabel("speed on the model [m/s]")
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="lower right")
    return figure


if __name__ == "__main__":
    raise SystemExit(run_study("gait_front", __doc__, study))
