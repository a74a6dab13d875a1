"""How much does a gait's heading vary on robots that nobody measured, and why? Without zero offsets and unequal
latency, with these alone, and with all.

Of the ROBOTIS walk and of the gaits that `workbench optimize --out runs/gaits/NAME` has written: the standard deviation of
turning by distance over the same random robots, and the speed that is kept.
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from studies.common import publish, run_study, sign
from studies.gait_conditions import GAITS, SECONDS, Played, gaits
from workbench.gait.certificate import NAME, PUPPY_CLAIM
from workbench.gait.ensemble import Ensemble, load_ensemble
from workbench.gait.measure import GaitMeasure, fallen, measure
from workbench.gait.rollouts import Rollouts
from workbench.robot import RobotModel, puppy_model
from workbench.simulation import Job, SimulationConfig
from workbench.view.report.page import Provenance, Report, Section, Table, Text

ROBOTS = 16
STEP = 2e-3
SLOWEST = 0.02
"""Speed [m/s] above which turning is measured by distance, as in certificates: a standing robot has none."""


def parts(whole: Ensemble) -> Mapping[str, Ensemble]:
    """The ensemble without zero offsets and latency, these alone, and all of it."""
    latency = {k: v for k, v in whole.ranges.items() if k == "command_delay"}
    rest = {k: v for k, v in whole.ranges.items() if k != "command_delay"}
    return {"without zero offsets and latency": replace(whole, ranges=rest, zero_sd=0.0),
            "zero offsets and latency alone": Ensemble(ranges=latency, zero_sd=whole.zero_sd), "all": whole}


def turning(m: GaitMeasure) -> float:
    """Turning by distance [deg/m], to the left."""
    return math.degrees(m.turn_rate / max(math.hypot(*m.velocity), SLOWEST))


def study(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Plays each gait on the robots of each part."""
    model, found, count = puppy_model(), gaits(puppy_model()), 2 if quick else ROBOTS
    told: dict[str, dict[str, Any]] = {g.name: {} for g in found}
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        for k, (part, ensemble) in enumerate(parts(load_ensemble()).items()):
            robots = ensemble.draws(model, count, 2, Path(folder))
            rollouts = Rollouts()
            for i, gait in enumerate(found):
                progress(f"{gait.name} on {count} robots: {part}", (k + i / len(found)) / 3)
                told[gait.name][part] = _spread(_played(rollouts, robots, gait, 2.0 if quick else SECONDS))
    for gait in found:
        told[gait.name]["other engine"] = _elsewhere(GAITS / gait.name / NAME)
    columns = list(parts(Ensemble()))
    rows = [[name, *(_cell(n[c]) for c in columns), _said(n["other engine"])] for name, n in told.items()]
    report = Report("Where gaits wander", f"Heading of {len(found)} gaits on {count} random robots each.",
                    f"{__doc__}\n\n{PUPPY_CLAIM}", [], Provenance.of(model))
    report.add(Section("Spread of heading", [
        Table(["gait", *columns, "in the other engine"], rows, "Standard deviation and mean of turning [deg/m]; 5th percentile "
              "and mean of the speed over the ground [cm/s]; how many fell."),
        Text("A robot's own zero offsets and the latency of its servos can be diagnosed, and are then in the model.")]))
    return publish(out, model, report, {"gaits": told, "robots": count}, {})


def _played(rollouts: Rollouts, robots: list[RobotModel], gait: Played, seconds: float) -> list[GaitMeasure]:
    config = SimulationConfig(time_step=STEP, contact_period=0.0, log_period=0.01)
    end = gait.begin + gait.period * max(1, math.floor((seconds - gait.begin) / gait.period))
    takes = rollouts.takes([Job(r, config, gait.commands, end) for r in robots], as_seen=False)
    return [fallen(len(r.joints)) if t is None else measure(t, r, gait.begin, gait.period, electrical=False)
            for t, r in zip(takes, robots)]


def _spread(measures: list[GaitMeasure]) -> dict[str, float]:
    stood = [m for m in measures if not m.fell]
    speeds = [0.0 if m.fell else math.hypot(*m.velocity) for m in measures]
    turns = [turning(m) for m in stood] or [math.nan]
    return {"heading sd deg/m": float(np.std(turns)), "heading mean deg/m": float(np.mean(turns)),
            "speed 5th percentile m/s": float(np.quantile(speeds, 0.05)), "speed mean m/s": float(np.mean(speeds)),
            "falls": len(measures) - len(stood)}


def _elsewhere(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text())["other_engine"]) if path.is_file() else {}


def _cell(n: Mapping[str, float]) -> str:
    fell = f", {n['falls']:.0f} fell" if n["falls"] else ""
    return (f"{sign(n['heading sd deg/m'])} about {sign(n['heading mean deg/m'])}; {sign(100 * n['speed 5th percentile m/s'])}, "
            f"{sign(100 * n['speed mean m/s'])}{fell}")


def _said(n: Mapping[str, Any]) -> str:
    return f"{100 * n['speed kept']:.0f} %, {sign(n['heading apart deg/m'])} deg/m apart" if n else ""


if __name__ == "__main__":
    raise SystemExit(run_study("gait_spread", __doc__, study))
