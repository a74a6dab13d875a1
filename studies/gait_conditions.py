"""How does a better gait differ, and where does it fail? Inverse dynamics, and a map of speed over floors.

Of the ROBOTIS walk and of the gaits that `workbench optimize --out runs/gaits/NAME` has written: torque, speed and slip of each
joint and foot, binding limit, cost of transport, and speed and falls over friction, slope and softness of the floor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from studies.common import ROOT, publish, run_study, sign
from workbench.compare.footfalls import foot_phases
from workbench.dynamics import inverse_dynamics
from workbench.gait.certificate import PUPPY_CLAIM
from workbench.gait.feet import feet_measure
from workbench.gait.legs import legs_of
from workbench.gait.measure import fallen, measure
from workbench.gait.rollouts import Rollouts
from workbench.motion import Commands, load_motion
from workbench.robot import GRAVITY, EffectSpec, RobotModel, data_file, puppy_model
from workbench.simulation import Job, SimulationConfig, simulate_batch
from workbench.view.figures import by_joint, footfalls, joint_grid, phase_portrait, stance_of
from workbench.view.figures.style import OTHERS, SIMULATED, in_house_style, new_figure
from workbench.view.report.page import Details, Picture, Provenance, Report, Section, Table, Text

GAITS = ROOT / "runs/gaits"
SECONDS = 6.0
BOXES, FIELDS = (0.0, 2.5, 5.0, 7.5, 10.0), 2
"""Tallest boxes [mm], and how many random fields of each; Drake's runs, of BOX_SECONDS."""
BOX_SECONDS = 4.0
FRICTIONS, SLOPES, SOFTNESS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0), (-10.0, -5.0, 0.0, 5.0, 10.0, 15.0), (1e3, 3e3, 1e4, 1e5)


@dataclass(frozen=True)
class Played:
    """A gait as it is played: commands, when its first full cycle begins, and its length [s]."""

    name: str
    commands: Commands
    begin: float
    period: float


def gaits(model: RobotModel) -> list[Played]:
    """The ROBOTIS walk and what lies under GAITS."""
    walk = load_motion(data_file("robotis_walk.csv"), model)
    out = [Played("ROBOTIS walk", walk.commands(math.ceil(SECONDS / walk.duration)), walk.duration, walk.duration)]
    for folder in sorted(GAITS.glob("*/gait.csv")):
        gait = load_motion(folder, model)
        begin = gait.seconds(1) - gait.duration - float(gait.times[-1] - gait.times[len(gait.times) - 1 - gait.stop])
        commands = gait.commands(math.ceil(SECONDS / gait.duration))
        out.append(Played(folder.parent.name, commands, begin, gait.duration))
    return out


def study(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Plays each on the nominal robot and over the floors."""
    model = puppy_model()
    found = gaits(model)
    told: dict[str, Any] = {}
    sections, figures = [], {}
    for k, gait in enumerate(found):
        progress(f"{gait.name}: inverse dynamics", k / len(found) / 2)
        section, numbers = _inside(model, gait)
        sections.append(section)
        told[gait.name] = numbers
    floors = dict(_floors(model, quick))
    speeds = {}
    for k, gait in enumerate(found):
        progress(f"{gait.name}: {len(floors)} floors", 0.5 + k / len(found) / 2)
        jobs = [Job(m, SimulationConfig(time_step=2e-3, contact_period=0.0, log_period=0.01), gait.commands, SECONDS)
                for m in floors.values()]
        measures = [fallen(len(model.joints)) if t is None else measure(t, m, gait.begin, gait.period, electrical=False)
                    for t, m in zip(Rollouts().takes(jobs), floors.values())]
        speeds[gait.name] = {name: (math.nan if m.fell else m.speed) for name, m in zip(floors, measures)}
        speeds[gait.name] |= _over_boxes(model, gait, quick)
        told[gait.name]["floors"] = {name: None if math.isnan(v) else v for name, v in speeds[gait.name].items()}
    figures["floors"] = _map(speeds)
    best = max(found[1:], key=lambda g: told[g.name]["speed"], default=None)
    said = "no optimised gait under runs/gaits: the ROBOTIS walk alone" if best is None else (
        f"{best.name} goes {100 * told[best.name]['speed']:.0f} cm/s where the ROBOTIS walk goes "
        f"{100 * told['ROBOTIS walk']['speed']:.0f}")
    report = Report("How a better gait differs", f"On the model, {said}.", f"{__doc__}\n\n{PUPPY_CLAIM}", [],
                    Provenance.of(model))
    header = ["gait", "speed [cm/s]", "slip [cm/s]", "tilt [deg]", "worst RMS torque [N m]", "of", "electrical cost of transport",
              "mechanical"]
    report.add(Section("Side by side", [Table(header, [_row(name, n) for name, n in told.items()])]))
    report.add(Section("Floors", [Text("A run that fell, or left the floor, has no mark."), Picture(
        figures["floors"], "Speed over friction, slope (uphill positive), softness, and over boxes of random height: "
        f"the mean of {FIELDS} fields.")]))
    for section in sections:
        report.add(section)
    return publish(out, model, report, told, figures)


def _inside(model: RobotModel, gait: Played) -> tuple[Section, dict[str, Any]]:
    """Inverse dynamics of one gait on the nominal robot."""
    take = replace(simulate_batch([Job(model, SimulationConfig(), gait.commands, SECONDS, 0.3)])[0], name=gait.name)
    m, feet = measure(take, model, gait.begin, gait.period), feet_measure(take, model, legs_of(model), gait.begin, gait.period)
    result = inverse_dynamics(model, take, floor=0.0)
    weight = model.kinematics.mass * GRAVITY
    rows = [[j, f"{load.rms:.2f}", f"{load.peak:.2f}", f"{100 * load.beyond_fifth:.0f} %", f"{load.torque_margin:.2f}",
             f"{np.degrees(load.speed_margin):.0f}"] for j, load in result.loads.items()]
    worst = model.joints[int(np.argmax(m.rms))]
    numbers = {"speed": m.speed, "slip": feet.slip, "tilt deg": math.degrees(m.tilt), "RMS torque N m": max(m.rms),
               "joint": worst,
               "electrical cost of transport": m.power / (weight * max(m.speed, 1e-3)),
               "mechanical cost of transport": m.mechanical / (weight * max(m.speed, 1e-3)),
               "RMS by joint": dict(zip(model.joints, m.rms)), "power W": m.power}
    stance = stance_of(foot_phases(take, model), take)
    last = float(take.time[-1])
    return Section(gait.name, [
        Picture(footfalls(stance, span=(last - 2, last)), "When each foot stands."),
        Picture(phase_portrait(worst, take.resampled(take.time[take.time > last - 2])), f"{worst}, the servo with most to do."),
        Table(["joint", "RMS [N m]", "peak [N m]", "beyond a fifth of stall", "least torque left [N m]",
               "least speed left [deg/s]"], rows,
              "Motor torque by inverse dynamics of the simulated take, the servo's own friction included."),
        Details("Asked and reached", [
            Picture(joint_grid(take, stance=by_joint(stance, model), span=(last - 1.5, last)))])]), numbers


def _row(name: str, n: Mapping[str, Any]) -> list[str]:
    return [name, sign(100 * n["speed"]), sign(100 * n["slip"]), sign(n["tilt deg"]), f"{n['RMS torque N m']:.2f}", n["joint"],
            f"{n['electrical cost of transport']:.1f}", f"{n['mechanical cost of transport']:.2f}"]


def _over_boxes(model: RobotModel, gait: Played, quick: bool) -> dict[str, float]:
    """Speed on boxes, the mean of some fields; NaN where it fell on one."""
    fields = 1 if quick else FIELDS
    wanted = [(h, seed) for h in BOXES[::len(BOXES) - 1 if quick else 1] for seed in range(fields if h else 1)]
    jobs = [Job(model, SimulationConfig(time_step=2e-3, contact_period=0.0, log_period=0.01, boxes=h / 1000, boxes_seed=seed,
                                        engine="drake"), gait.commands, BOX_SECONDS) for h, seed in wanted]
    out: dict[str, list[float]] = {}
    for (h, _), take in zip(wanted, simulate_batch(jobs)):
        m = measure(take, model, gait.begin, gait.period, electrical=False)
        out.setdefault(f"boxes {h:g}", []).append(math.nan if m.fell else m.speed)
    return {name: float(np.mean(values)) for name, values in out.items()}


def _floors(model: RobotModel, quick: bool) -> list[tuple[str, RobotModel]]:
    step = 3 if quick else 1
    out = [(f"friction {f:g}", replace(model, ground=replace(model.ground, friction=f))) for f in FRICTIONS[::step]]
    tilts = {f"slope {s:g}": EffectSpec("ground_tilt", (), {"forward": -s, "left": 0.0}) for s in SLOPES[::step]}
    soft = {f"stiffness {k:g}": EffectSpec("soft_ground", (), {"stiffness": k}) for k in SOFTNESS[::step]}
    return out + [(name, model.with_effect(effect)) for name, effect in (tilts | soft).items()]


@in_house_style
def _map(speeds: Mapping[str, Mapping[str, float]]) -> Figure:
    kinds = {"friction": "friction of the pair", "slope": "slope [deg]", "stiffness": "stiffness of a contact point [N/m]",
             "boxes": "tallest box [mm]"}
    figure = new_figure(13, 3.8)
    for axes, (kind, label) in zip(figure.subplots(1, 4, sharey=True), kinds.items()):
        for colour, (name, by_floor) in zip((OTHERS[0], SIMULATED, *OTHERS[1:]), speeds.items()):
            points = [(float(k.split()[1]), 100 * v) for k, v in by_floor.items() if k.startswith(kind)]
            axes.plot([x for x, _ in points], [y for _, y in points], "o-", color=colour, label=name)
        axes.set_xlabel(label)
        if kind == "stiffness":
            axes.set_xscale("log")
    figure.axes[0].set_ylabel("speed [cm/s]")
    figure.axes[0].legend()
    return figure


if __name__ == "__main__":
    raise SystemExit(run_study("gait_conditions", __doc__, study))
