"""The page of an optimised gait: its performance, the margin of each limit, its results on other robots, and the gait in 3D with
the ROBOTIS walk."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from workbench.compare.footfalls import foot_phases
from workbench.files import InputError
from workbench.gait.certificate import CLAIM, PUPPY_CLAIM, Certificate
from workbench.gait.limits import each
from workbench.gait.measure import GaitMeasure, measure
from workbench.gait.optimize import WALK, Optimized
from workbench.gait.plan_compare import PlanComparison
from workbench.gait.table import GaitTable
from workbench.motion import load_motion
from workbench.recording.take import Take
from workbench.robot import PUPPY, RobotModel, data_file
from workbench.simulation import Job, SimulationConfig, simulate_batch
from workbench.view.figures import (
    body_attitude,
    body_path,
    by_joint,
    film_strip,
    footfalls,
    joint_grid,
    joint_torques,
    phase_portrait,
    stance_of,
)
from workbench.view.figures.gait import draw_ranges, limit_bars, short
from workbench.view.figures.plan import plan_and_run
from workbench.view.report.page import Details, Part, Picture, Provenance, Replay, Report, Section, Table, Text
from workbench.view.scene.replay import write_replay

PAGE = "report.html"


def write_gait_page(folder: Path, model: RobotModel, result: Optimized) -> Path:
    """Writes report.html, and replay.html next to it: the gait solid, the ROBOTIS walk as its ghost, if the robot can play
    that."""
    assert result.certified is not None
    assert result.table is not None
    certificate, take = result.certified.certificate, result.certified.take
    on = result.request.on_slope(model)
    walk = _vendor_walk(on, float(take.time[-1]))
    replay = write_replay(folder / "replay.html", on, take, None if walk is None else walk[0], title="optimised gait").path
    claim = PUPPY_CLAIM if model.description == PUPPY else CLAIM
    report = Report("Optimised gait", _headline(result), claim, _key_numbers(certificate), _provenance(certificate, model))
    ghost = "" if walk is None else " The ghost is the ROBOTIS walk on the same model, started from the same place."
    strip = film_strip(on, take, None if walk is None else walk[0])
    if result.problem:
        report.add(Section("Request not met", [Text(result.problem)]))
    report.add(Section("The gait", [Replay(replay, "From rest, with contact forces." + ghost, strip),
                                    *_walking(take, on, result.table, walk)]))
    if result.plan is not None:
        report.add(_plan_section(result.plan))
    report.add(_limits_section(certificate))
    report.add(_draws_section(certificate))
    report.add(_way_section(certificate))
    report.add(_table_section(result.table))
    return report.write(folder / PAGE)


def _vendor_walk(model: RobotModel, seconds: float) -> tuple[Take, GaitMeasure] | None:
    """The ROBOTIS walk of the same duration, and its numbers; None for a robot with other joints."""
    try:
        motion = load_motion(data_file(WALK), model)
    except InputError:
        return None
    commands = motion.commands(math.ceil(seconds / motion.duration))
    take = simulate_batch([Job(model, SimulationConfig(base="free"), commands, seconds, 0.3, name="ROBOTIS walk")])[0]
    return take, measure(take, model, motion.duration, motion.duration)


def _headline(result: Optimized) -> str:
    assert result.certified is not None
    n, d = result.certified.certificate.nominal, result.certified.certificate.draws
    turns = n.unit == "rad/s"
    speed = f"{math.degrees(n.speed):.0f} deg/s" if turns else f"{100 * n.speed:.0f} cm/s"
    request = str(result.request)
    said = f"{request[0].upper()}{request[1:]}: {speed} on the model"
    if d.get("count"):
        low = d["speed " + n.unit][1]
        if low is not None:
            five = f"{math.degrees(low):.0f} deg/s" if turns else f"{100 * low:.0f} cm/s"
            said = (f"{request[0].upper()}{request[1:]}: {five} or more on 95 % of the sampled robots, "
                    f"{speed} on the nominal robot")
        said += f"; of {d['count']} random variants {d['falls'] or 'none'} fell"
    return said + ("." if result.met else "; the request is not met.")


def _key_numbers(certificate: Certificate) -> list[tuple[str, str, str]]:
    n, d, e = certificate.nominal, certificate.draws, certificate.other_engine
    turns = n.unit == "rad/s"
    factor, unit = (180 / math.pi, "deg/s") if turns else (100.0, "cm/s")
    worst = max((m for m in certificate.margins if not m.advice), key=lambda m: m.use)
    advised = [f"ROBOTIS advises {m.limit:.2f}" for m in certificate.margins if m.advice and m.unit == "N m"]
    numbers = [("speed", f"{factor * n.speed:.1f} {unit}", f"± {factor * certificate.floor['steps']:.1f} from the time step"),
               ("binding limit", worst.name, f"{worst.value:.3g} of {worst.limit:.3g} {worst.unit}, {worst.where}"),
               ("largest RMS torque", f"{n.largest_rms:.2f} N m", advised[0] if advised else ""),
               ("electrical power", f"{n.power:.0f} W",
                f"cost of transport {n.cost_of_transport:.1f}")]
    if d.get("count"):
        lowest, five = d["speed " + n.unit][:2]
        name, low = ("slowest sampled robot", lowest) if five is None else ("5th percentile of sampled robots", five)
        numbers.insert(0, (name, f"{factor * low:.1f} {unit}", f"heading {d['heading deg/m RMS']:.1f} deg/m RMS"))
    if e:
        numbers.append((f"speed in {e['name']}", f"{100 * e['speed kept']:.0f} % of Drake's",
                        f"heading differs by {e['heading apart deg/m']:+.1f} deg/m"))
    return numbers


def _walking(take: Take, model: RobotModel, table: GaitTable, walk: tuple[Take, GaitMeasure] | None) -> list[Part]:
    stance = stance_of(foot_phases(take, model), take)
    stopping = float(table.stop.dwells_ms.sum()) / 1000 + table.period  # the way back to neutral, and the rest after it
    last = max(float(take.since_start[-1]) - stopping, 2.0)
    others = {} if walk is None else {"ROBOTIS walk": walk[0]}
    assert take.torque is not None
    limit = {j: model.servo(j).torque_at_full_duty for j in take.joints}
    busiest = take.joints[int(np.argmax((take.torque**2).mean(axis=0)))]
    return [
        Picture(body_path(take, others=others), "Path of the body, seen from above and over time."),
        Picture(footfalls(stance, span=(max(last - 2.0, 0.0), last)), "Stance of each foot during two seconds of walking."),
        Picture(phase_portrait(busiest, take.resampled(take.time[(take.since_start > last - 2.0) & (take.since_start < last)])),
                f"Speed over angle of {busiest}, the most heavily loaded joint, in the same two seconds."),
        Details("Commanded and simulated angles, torques, attitude", [
            Picture(joint_grid(take, stance=by_joint(stance, model), span=(max(last - 1.5, 0.0), last)),
                    "Angle of each joint, commanded (ramp) and simulated; the stance of its foot is shaded."),
            Picture(joint_torques(take.since_start, take.joints, {"on the link": take.torque}, limit=limit),
                    "Torque of each joint, and the servo's torque at full duty."),
            Picture(body_attitude(take, others=others))])]


def _plan_section(c: PlanComparison) -> Section:
    rows = [[asset, f"{1000 * e.position:.1f}", f"{math.degrees(e.rotation):.1f}"] for asset, e in c.errors.items()]
    joints = [[joint, f"{math.degrees(error):.1f}"] for joint, error in c.joints.items()]
    feet = [[foot, f"{1000 * error:.1f}"] for foot, error in c.feet.items()]
    return Section("Planned and simulated", [
        Text(f"The table reaches {100 * c.speed:.0f} % of the planned speed. Errors are RMS over the cycles after the first, "
             "between the planned and the simulated pose of each tracked body, in a frame that moves at the planned speed."),
        Picture(plan_and_run(c), "Base and feet over one cycle, planned and simulated (mean of the cycles)."),
        Table(["tracked body", "position [mm]", "rotation [deg]"], rows),
        Details("Joints and feet", [Table(["joint", "RMS [deg]"], joints), Table(["foot", "RMS [mm]"], feet)])])


def _limits_section(certificate: Certificate) -> Section:
    rows = [[m.name, m.where, short(m.value), short(m.limit), m.unit, f"{100 * m.margin:.0f} %",
             "advice" if m.advice else "met" if m.use <= 1 else "violated"] for m in certificate.margins]
    shown = [rows[certificate.margins.index(m)] for _, m in each(certificate.margins)]
    header = ["limit", "where", "value", "limit", "unit", "margin", ""]
    return Section("Limits", [
        Picture(limit_bars(certificate), "For each limit the worst joint or foot; above 1 the limit is exceeded. Hatched: "
                "recommended by ROBOTIS, not required here."),
        Table(header, shown), Details("All limits of all joints", [Table(header, rows)])])


def _draws_section(certificate: Certificate) -> Section:
    d, n, floor = certificate.draws, certificate.nominal, certificate.floor
    parts: list[Part] = []
    if d.get("count"):
        incidents = [[str(i["draw"]), i["robot"], i["what"]] for i in d["incidents"]]
        parts += [Text(f"{d['count']} newly sampled robots, none of which the search used: friction, supply voltage and its "
                       f"sag, masses, a load, zero offsets, backlash and latency vary at once. {d['falls'] or 'None'} fell; the "
                       f"probability of a fall is below {100 * d['falls at most']:.1f} % (at 95 % confidence)."),
                  *([Table(["sample", "robot", "event"], incidents)] if incidents else []),
                  Picture(draw_ranges(certificate), "Thick line: 5 to 95 % of the robots; thin line: all; circle: median; green: "
                          "nominal robot.")]
    trimmed = d.get("straightened")
    if trimmed and trimmed["after one metre deg/m RMS"] is not None:
        before, one, three = (trimmed[f"{k} deg/m RMS"] for k in ("untrimmed", "after one metre", "after 3 metres"))
        parts.append(Text(f"Heading drift of {trimmed['robots']} of them: {before:.1f} deg/m RMS without trimming, {one:.1f} "
                          f"after one recorded metre and one correction by `workbench trim`, {three:.1f} after three."))
    steps = ", ".join(f"{k} {100 * v:.1f}" for k, v in floor["speed"].items())
    unit = "0.01 rad/s" if certificate.nominal.unit == "rad/s" else "cm/s"
    parts.append(Text(f"Numerical floor: speed of the nominal robot for each time step and contact model: {steps} {unit}; "
                      f"the heading varies by {floor['heading deg/m, all']:.1f} deg/m (standard deviation)."))
    e = certificate.other_engine
    parts.append(Text(f"The same table in {e['name']}: {100 * e['speed kept']:.0f} % of the speed; the heading differs by "
                      f"{e['heading apart deg/m']:+.1f} deg/m." if e else
                      "Not cross-checked: no second simulator is installed."))
    if e:
        parts.append(Table(["condition", f"speed [{n.unit}]", f"in {e['name']}", "heading [deg/m]", f"in {e['name']}"],
                           [[k, *(f"{c[key]:.3f}" for key in ("speed", "speed elsewhere")),
                             *(f"{c[key]:+.1f}" for key in ("heading deg/m", "heading elsewhere deg/m"))]
                            for k, c in e["conditions"].items()]))
    return Section("Sampled robots", parts)


def _way_section(certificate: Certificate) -> Section:
    ways = certificate.ways
    rows = [[name, *(f"{value:.2f}" for value in (part.seconds, part.torque, part.tilt, part.jerk))]
            for name, part in (("start", ways.start), ("gait", ways.gait), ("stop", ways.stop))]
    said = ("Start and stop are as smooth as the gait itself." if ways.smooth else
            "Start and stop jerk the robot more than the gait itself does.")
    return Section("Start, stop and return", [
        Text("The start leads from neutral through the gait's stance and one cycle of half the amplitude into the gait; the stop "
             "leads back to neutral. Both are in `gait.csv`, and all numbers here apply to the whole motion. " + said),
        Table(["part", "seconds", "peak torque [N m]", "tilt [deg]", "RMS jerk of the base [m/s³]"], rows),
        *_cycle_parts(certificate)])


def _cycle_parts(certificate: Certificate) -> list[Part]:
    """Whether the gait returns to its limit cycle, and the scatter from cycle to cycle."""
    c = certificate.cycle
    said = (f"From cycle to cycle the heading scatters by {c.heading:.2g} deg and the speed by {100 * c.speed:.2g} cm/s "
            "(standard deviations, nominal robot)")
    median = c.heading_of_draws
    more = "" if median is None else f"; on the sampled robots the heading scatters by {median:.2g} deg (median)"
    parts: list[Part] = [Text(f"{said}{more}.")]
    if c.back:
        never = f"not within {c.watched}"
        rows = [[entry, "fell" if entry in c.fell else never if n is None else str(n)] for entry, n in c.back.items()]
        parts.append(Table(["entry or disturbance", "cycles until the gait has settled"], rows,
                           "Criterion: forward and sideways speed and turn of a cycle within a tenth of the settled gait's."))
    return parts


def _table_section(table: GaitTable) -> Section:
    cycle = table.cycle
    rows = [[str(k + 1), str(cycle.dwells_ms[k]), *map(str, goals)] for k, goals in enumerate(cycle.goals)]
    speeds = [[str(k + 1), str(cycle.dwells_ms[k]), *map(str, s)] for k, s in enumerate(cycle.speeds)]
    numbers = {k: v for k, v in vars(table.shape).items() if k != "offsets"}
    shape = ", ".join(f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in numbers.items())
    return Section("The table", [
        Text("The table is the loop; `gait.csv` also contains the start and the stop. `simulate`, `run`, `play`, `flash` and "
             "`export` accept that file, and all except `simulate` require `certificate.json` in the same folder."),
        Table(["pose", "dwell [ms]", *cycle.joints], rows, "; ".join(map(str, cycle.families)) + "."),
        Details("Moving speeds and gait parameters", [Table(["pose", "dwell [ms]", *cycle.joints], speeds), Text(shape)])])


def _provenance(certificate: Certificate, model: RobotModel) -> Provenance:
    p = certificate.provenance
    more = {"rollouts": str(p["rollouts"]), "searched in": f"{p['searched in']} s", "certified in": f"{p['certified in']} s",
            "ensemble": str(p["ensemble_sha256"])[:12], "table": certificate.tables["gait"][:12]}
    return replace(Provenance.of(model, seed=int(p["seed"])), more=tuple(more.items()))
