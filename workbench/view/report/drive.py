"""The page of a driven path."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from workbench.files.reading import write_whole
from workbench.gait.certificate import CLAIM
from workbench.gait.drive.loop import SETTLED, Driven
from workbench.gait.drive.plan import Disc
from workbench.gait.drive.step_map import StepMap
from workbench.robot import RobotModel
from workbench.view.figures.drive import driven_cycles, driven_path
from workbench.view.report.page import Picture, Provenance, Report, Section, Table, Text


def drive_numbers(driven: Driven) -> dict[str, object]:
    """For JSON: why it stopped, errors from `SETTLED` on, and how far it passed from each way-point. Metres and degrees."""
    s = driven.settled
    end = driven.poses[np.isfinite(driven.poses).all(axis=1)][-1]
    return {"reason": driven.reason, "cycles": len(driven.turns) - 1,
            "end": {"x": float(end[0]), "y": float(end[1]), "heading_deg": float(np.rad2deg(end[2]))},
            "largest_lateral_error_m": _largest(driven.left[s]),
            "largest_heading_error_deg": _largest(np.rad2deg(driven.off[s])),
            "missed_waypoints_m": [float(v) for v in driven.missed()],
            "bias_deg_per_cycle": None if np.isnan(driven.bias[-1]) else float(np.rad2deg(driven.bias[-1]))}


def write_drive(folder: Path, model: RobotModel, step_map: StepMap, closed: Driven, straight: Driven | None, most: float,
                discs: Sequence[Disc] = ()) -> list[Path]:
    """Writes drive.json and report.html into `folder`; returns the paths, the page first. straight: the same robot, not steered;
    most: largest turn [rad per stance]; discs: obstacles."""
    numbers = drive_numbers(closed)
    content = {"format": 1, "claim": CLAIM, "steered": numbers, "discs": [vars(d) for d in discs],
               "not_steered": None if straight is None else drive_numbers(straight),
               "step_map": {k: v if not isinstance(v, tuple) else list(v) for k, v in vars(step_map).items()},
               "poses": [None if np.isnan(p).any() else p.tolist() for p in closed.poses],
               "turns": closed.turns.tolist(), "sides": closed.sides.tolist()}
    write_whole(folder / "drive.json", json.dumps(content, indent=1, allow_nan=False) + "\n")
    misses = ", ".join(f"{100 * m:.1f}" for m in closed.missed())
    report = Report("Driven path", f"Distance to each way-point: {misses} cm; stopped: {closed.reason}.", CLAIM,
                    provenance=Provenance(model.sha256, more=(("errors counted from", f"{SETTLED} m"),)))
    caption = "" if straight is None else "Both runs use the same robot and the same gait."
    report.add(Section("The path", [Picture(driven_path(closed, straight, discs), caption)]))
    cycles = Picture(driven_cycles(closed, most), "Dotted: the maximum turn.")
    report.add(Section("Cycle by cycle", [cycles, _errors(closed, straight)]))
    report.add(Section("The step-to-step map", [_map(step_map), Text(
        "The scatter of the heading from cycle to cycle limits what any controller that acts once per cycle can achieve.")]))
    return [report.write(folder / "report.html"), folder / "drive.json"]


def _largest(errors: np.ndarray) -> float | None:
    known = np.abs(errors[np.isfinite(errors)])
    return float(known.max()) if len(known) else None


def _errors(closed: Driven, straight: Driven | None) -> Table:
    rows = []
    for name, run in (("steered", closed), ("not steered", straight)):
        if run is not None:
            n = drive_numbers(run)
            errors = _number(n["largest_lateral_error_m"], 100), _number(n["largest_heading_error_deg"], 1)
            rows.append([name, run.reason, *errors])
    return Table(["robot", "stopped", "largest lateral error [cm]", "largest heading error [deg]"], rows,
                 f"Errors at the end of each cycle, after the first {SETTLED} m of the path.")


def _number(value: object, factor: float) -> str:
    return f"{factor * value:.1f}" if isinstance(value, float) else "–"


def _map(m: StepMap) -> Table:
    deg = np.rad2deg
    return Table(["quantity", "value"], [
        ["heading change per cycle, without steering", f"{deg(m.bias):.2f} deg"],
        [f"heading change at the maximum turn of {m.most:g} rad, same cycle", f"{deg(m.gain * m.most):.1f} deg"],
        [f"heading change at the maximum turn of {m.most:g} rad, next cycle", f"{deg(m.memory * m.most):.1f} deg"],
        ["lateral motion per mm of sideways stride", f"{m.side_gain:.2f} mm"],
        ["distance per cycle", f"{100 * m.ahead:.1f} cm"],
        ["scatter of the heading per cycle", f"{deg(m.scatter[0]):.2f} deg"],
        ["scatter of the lateral position per cycle", f"{1000 * m.scatter[1]:.1f} mm"]])
