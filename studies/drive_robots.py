"""Twenty robots that nobody measured are steered along paths, by prediction and by a proportional law.

    python -m studies.drive_robots [--out runs/studies/drive_robots] [--quick]

Robots are drawn from the ensemble of certificates (friction, supply, sag, play, zero offsets, latency of each servo, masses, a
load); those are kept that turn by 15 to 100 deg while they walk 2 m open loop. The controller knows the nominal model's
step-to-step map alone. Poses come with 0.12 deg and 0.1 mm of noise, one cycle in twenty without a pose, and a decision acts on
the cycle after next. Three paths: a straight line of 2 m; five way-points with turns to both sides and a stop; and bends at which
the limit on the turn binds. Errors count from 0.8 m on; headings are means over a cycle.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from studies.common import ROOT, Array, kept_result, publish, run_study, sign
from workbench.gait.certificate import PUPPY_CLAIM
from workbench.gait.drive.controller import CycleController
from workbench.gait.drive.family import STRAIGHT, GaitFamily, load_family
from workbench.gait.drive.loop import Driven, drive
from workbench.gait.drive.options import DriveOptions
from workbench.gait.drive.path import WayPath
from workbench.gait.drive.plan import plan
from workbench.gait.drive.step_map import MapOptions, StepMap, fit_step_map
from workbench.gait.drive.walk import Cameras, SimulatedWalk
from workbench.gait.ensemble import load_ensemble
from workbench.robot import RobotModel, puppy_model
from workbench.view.report.page import Provenance, Report, Section, Table, Text

GAIT = ROOT / "data/gaits/demo/gait.csv"
ROBOTS, SEED, LOST = 20, 58, 0.05
TURNS = (15.0, 100.0)
"""Open loop in 2 m [deg]."""
LINE = ((2.0, 0.0),)
WAY_POINTS = ((0.6, 0.15), (1.2, -0.15), (1.7, 0.1), (1.9, 0.6), (1.6, 1.0))
BENDS = ((0.5, 0.0), (0.95, 0.2), (1.4, 0.0), (1.85, 0.2), (2.3, 0.0))
"""Swings whose smallest radius, 0.22 m, is just above that of the nominal robot at the largest turn, 0.2 m."""
PATHS = {"line": LINE, "way-points": WAY_POINTS, "bends": BENDS}
LAWS = ("mpc", "proportional")
WITHIN_LINE = (3.0, 3.0)
WITHIN_POINT = (5.0, 5.0)
"""[deg], [cm]."""


def open_loop(family: GaitFamily, step_map: StepMap, model: RobotModel, seed: int) -> float | None:
    """How far a robot turns in 2 m without steering [deg]; None where it falls or turns by less or more than TURNS."""
    path = WayPath(LINE)
    run = drive(SimulatedWalk(family, model, Cameras(), seed), path, CycleController(path, step_map, family.period), 100, False)
    turned = math.degrees(np.unwrap(run.poses[:, 2])[-1])
    return turned if run.reason != "fell" and TURNS[0] <= abs(turned) <= TURNS[1] else None


def numbers_of(run: Driven, period: float) -> dict[str, Any]:
    """Errors of one run: largest and RMS from 0.8 m on; where each way-point was passed, and the heading there."""
    settled, mean_off = run.settled, np.degrees(run.mean_off(period))
    left = 100 * run.left[settled]
    at = [int(np.argmin(np.hypot(*(run.poses[:, :2] - p).T))) for p in run.path.points]
    missed = [float(100 * m) for m in run.missed()]
    off = [float(mean_off[k]) for k in at]
    reached = run.reason == "end of the path"
    return {"reason": run.reason, "cycles": len(run.turns) - 1, "largest turn rad": float(np.abs(run.turns).max()),
            "left cm": float(np.abs(left).max()) if settled.any() else math.inf,
            "left RMS cm": float(np.sqrt(np.mean(left**2))) if settled.any() else math.inf,
            "heading deg": float(np.nanmax(np.abs(mean_off[settled]))) if settled.any() else math.inf,
            "course deg": float(np.max(np.abs(course(run)[settled]))) if settled.any() else math.inf,
            "missed cm": missed, "missed deg": off,
            "within line": bool(reached and np.abs(left).max() <= WITHIN_LINE[1]
                                and np.nanmax(np.abs(mean_off[settled])) <= WITHIN_LINE[0]),
            "within points": bool(reached and max(missed) <= WITHIN_POINT[1] and max(np.abs(off)) <= WITHIN_POINT[0])}


def course(run: Driven) -> Array:
    """Direction of travel over two cycles from that of the path (K,) [deg]: a robot that walks sideways by some degrees keeps to
    its path only if its heading is off by as much."""
    step = run.poses[2:, :2] - run.poses[:-2, :2]
    path = np.array([run.path.heading(s) for s in run.along[1:-1]])
    off = np.arctan2(step[:, 1], step[:, 0]) - path
    return np.degrees(np.pad(np.arctan2(np.sin(off), np.cos(off)), 1, mode="edge"))


def planning_time(step_map: StepMap, options: DriveOptions, plans: int = 200) -> float:
    """Median processor time of one plan [s]."""
    rng, taken = np.random.default_rng(0), []
    for _ in range(plans):
        targets = np.cumsum(0.2 * rng.standard_normal(options.horizon + 1))
        began = time.process_time()
        left, off, bias = rng.normal(0.0, (0.05, 0.2, 0.05))
        plan(left, off, STRAIGHT, bias, targets, step_map, options)
        taken.append(time.process_time() - began)
    return float(np.median(taken))


def one(family: GaitFamily, step_map: StepMap, robot: RobotModel, k: int) -> dict[str, Any] | None:
    """The k-th drawn robot along each path by each law; None where `open_loop` is None."""
    turned = open_loop(family, step_map, robot, k)
    if turned is None:
        return None
    row: dict[str, Any] = {"drawn": k + 1, "open loop deg": turned}
    for name, points in PATHS.items():
        for law in LAWS:
            path = WayPath(points)
            controller = CycleController(path, step_map, family.period, DriveOptions(law=law))  # type: ignore[arg-type]
            walk = SimulatedWalk(family, robot, Cameras(lost=LOST), SEED + k)
            row[f"{name}, {law}"] = numbers_of(drive(walk, path, controller, 150), family.period)
    return row


def study(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Draws the robots, steers each along each path by both laws, and counts. The page is written after each robot; a study that
    was stopped resumes."""
    model = puppy_model()
    family = load_family(GAIT, model)
    step_map = fit_step_map(family, model, SEED, MapOptions(cycles=12, rollouts=2) if quick else MapOptions())
    count = 1 if quick else ROBOTS
    milliseconds = 1000 * planning_time(step_map, DriveOptions(), 20 if quick else 200)
    runs, said = list[dict[str, Any]](), ""
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        for k, robot in enumerate(load_ensemble().draws(model, 5 * count, SEED, Path(folder))):
            progress(f"robot {len(runs) + 1} of {count}, drawn {k + 1}", len(runs) / count)
            row = kept_result(out / "results" / f"drawn{k + 1:03d}.json", partial(one, family, step_map, robot, k))
            if row is None:
                continue
            runs.append(row)
            said = publish(out, model, _report(model, runs, milliseconds, step_map),
                           {"robots": runs, "ms a plan": milliseconds, "step map": dict(vars(step_map))}, {})
            if len(runs) == count:
                break
    return said


def _report(model: RobotModel, runs: list[dict[str, Any]], milliseconds: float, step_map: StepMap) -> Report:
    found = f"{len(runs)} robots that turn by {TURNS[0]:.0f} to {TURNS[1]:.0f} deg in 2 m open loop"
    report = Report("Robots that nobody measured, steered", f"{found}; one plan takes {milliseconds:.1f} ms of one core.",
                    f"{__doc__}\n\n{PUPPY_CLAIM}", [], Provenance.of(model))
    report.add(Section("Counts", [Table(
        ["path", "law", "within 3 deg and 3 cm", "way-points within 5 deg and 5 cm", "path error, RMS, median [cm]",
         "largest lateral error, median [cm]", "largest heading error, median [deg]", "largest course error, median [deg]"],
        [[name, law, *_counts([r[f"{name}, {law}"] for r in runs])] for name in PATHS for law in LAWS],
        "Errors from 0.8 m on; the heading is the mean over a cycle."),
        Text(f"A cycle's heading scatters by {math.degrees(step_map.scatter[0]):.2f} deg about the map, and its lateral position "
             f"by {1000 * step_map.scatter[1]:.1f} mm.")]))
    report.add(Section("Each robot", [Table(
        ["open loop [deg]", *(f"{name}, {law}" for name in PATHS for law in LAWS)],
        [[sign(r["open loop deg"]), *(_cell(r[f"{name}, {law}"]) for name in PATHS for law in LAWS)] for r in runs],
        "Largest lateral error [cm], largest heading error [deg], RMS lateral error [cm].")]))
    return report


def _counts(runs: list[Mapping[str, Any]]) -> list[str]:
    medians = (sign(float(np.median([r[key] for r in runs]))) for key in ("left RMS cm", "left cm", "heading deg", "course deg"))
    counts = (f"{sum(r[key] for r in runs)} of {len(runs)}" for key in ("within line", "within points"))
    return [*counts, *medians]


def _cell(r: Mapping[str, Any]) -> str:
    short = "" if r["reason"] == "end of the path" else f" ({r['reason']})"
    return f"{r['left cm']:.1f}, {r['heading deg']:.1f}, {r['left RMS cm']:.1f}{short}"


if __name__ == "__main__":
    raise SystemExit(run_study("drive_robots", __doc__, study))
