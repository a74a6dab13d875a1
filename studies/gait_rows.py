"""Plays the gaits that ship in data/gaits (motion, certificate, command) and writes their table in the docs.

Every motion is played from power-on to standstill as its certificate says: by `simulate`, by `run` on the emulated robot, and in
MuJoCo. The rows of the table are written between its marks in docs/gaits.md.
"""

from __future__ import annotations

import csv
import math
import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studies.common import ROOT, publish, run_study
from studies.other_engine.as_take import mujoco_take
from workbench.api.robot_run import run_on_robot
from workbench.device.bus import Bus
from workbench.device.bus.survey import family_of
from workbench.device.virtual import SECOND
from workbench.files.reading import read_text, write_whole
from workbench.gait.certificate import PUPPY_CLAIM, Certificate, check_certificate
from workbench.gait.measure import GaitMeasure, measure
from workbench.motion import Motion, load_motion
from workbench.recording.take import Take
from workbench.robot import RobotModel, bus_ids, puppy_model
from workbench.simulation import Job, Simulation, SimulationConfig
from workbench.simulation.compiled import CompiledJob
from workbench.simulation.play import LEAD, play_motion
from workbench.simulation.virtual_robot import VirtualRobot
from workbench.view.report.page import Provenance, Report, Section, Table

GAITS = ROOT / "data/gaits"
COMMAND = "command.txt"
"""Of each folder: what found the gait, as it was typed."""
SEEDS = "seeds.csv"
"""Of each folder: the result of each seed, by `studies.gait_row_seeds`."""
PAGE = ROOT / "docs/gaits.md"
BEGIN, END = "<!-- rows of data/gaits: python -m studies.gait_rows -->", "<!-- end of rows -->"
AFTER = 0.3
"""At rest after the stop [s]."""


@dataclass(frozen=True)
class Row:
    """A gait of data/gaits: the command that found it, the motion, its certificate, and the rows of seeds.csv."""

    name: str
    command: str
    motion: Motion
    certificate: Certificate
    seeds: tuple[tuple[str, ...], ...] = ()

    @property
    def by_seed(self) -> str:
        """Speeds on the nominal robot by seed, those that were refused in brackets."""
        return ", ".join(f"({speed or '–'})" if kept != "yes" else speed for _, kept, speed, *_ in self.seeds)


@dataclass(frozen=True)
class Did:
    """Result of playing a motion from power-on to standstill. heading: change by distance [deg/m] of the walking part. tilt
    [deg], and torque [N m] that lasts 10 ms: the largest from beginning to end. how: name of the player."""

    how: str
    speed: float
    heading: float
    tilt: float
    torque: float


def rows(model: RobotModel, folder: Path = GAITS) -> list[Row]:
    """Of a folder, by name. InputError for a motion whose certificate is not its own."""
    out = []
    for path in sorted(folder.glob("*/gait.csv")):
        motion = load_motion(path, model)
        certificate = check_certificate(path, motion, model)
        seeds = tuple(csv.reader(read_text(path.with_name(SEEDS)).splitlines()))[1:] if path.with_name(SEEDS).is_file() else ()
        out.append(Row(path.parent.name, read_text(path.with_name(COMMAND)).strip(), motion, certificate,
                       tuple(tuple(row) for row in seeds)))
    return out


def certified(certificate: Certificate) -> Did:
    """The same numbers from the certificate."""
    n = certificate.nominal
    return Did("certificate", n.forward, n.heading, n.tilt, certificate.ways.torque)


def played(row: Row, model: RobotModel, by: str) -> Did:
    """The motion's own bytes, played by "simulate", "run" (on the emulated robot), "MuJoCo", or "compiled" (the same step as
    simulate's, in a tenth of the time)."""
    take = {"simulate": _simulated, "run": _run, "MuJoCo": _elsewhere, "compiled": _compiled}[by](row.motion, model)
    return _did(by, take, row.motion, model)


def _simulated(motion: Motion, model: RobotModel) -> Take:
    return play_motion(Simulation(model, SimulationConfig(base="free")), motion)


def _compiled(motion: Motion, model: RobotModel) -> Take:
    commands = motion.commands()
    return CompiledJob(Job(model, SimulationConfig(base="free"), commands, commands.end + AFTER, LEAD)).take()


def _run(motion: Motion, model: RobotModel) -> Take:
    robot = VirtualRobot(model)
    bus = Bus(robot.port, family_of(model), {i: joint for joint, i in bus_ids(model).items()})
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        done = run_on_robot(bus, model, motion, motion.often(None), Path(folder), lambda: "", virtual=robot)
    let_go = robot.body.let_go
    assert let_go is not None
    return robot.body.take(done.played.started - let_go / SECOND)


def _elsewhere(motion: Motion, model: RobotModel) -> Take:
    commands = motion.commands()
    return mujoco_take(model, commands, commands.end + AFTER)


def _did(how: str, take: Take, motion: Motion, model: RobotModel) -> Did:
    table = motion.as_table()
    start = float(table.dwells_ms[:table.start].sum()) / 1000
    end = start + motion.often(None) * table.period
    kept = take.resampled(take.time[(take.time >= -LEAD) & (take.time <= motion.commands().end + AFTER)])
    m: GaitMeasure = measure(kept, model, start + table.period, table.period, electrical=False, end=end, since=0.0)
    along = max(abs(m.velocity[0]), 0.02)
    return Did(how, m.velocity[0], math.degrees(m.turn_rate) / along, math.degrees(m.tilt), max(m.peak))


def markdown(found: list[Row]) -> str:
    """The rows as a table of docs/gaits.md."""
    head = ("gait", "nominal speed", "5th percentile over random robots", "fell",
            "heading over random robots: untrimmed, after one recorded metre, after three [deg/m RMS]", "slip, nominal",
            "speed in MuJoCo", "largest tilt, torque", "returns to its cycle within", "nominal speed by seed (refused)")
    return "\n".join([_row(head), "|" + len(head) * "---|", *(_row(_cells(row)) for row in found)])


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _cells(row: Row) -> list[str]:
    n, d, c, ways = row.certificate.nominal, row.certificate.draws, row.certificate.cycle, row.certificate.ways
    five = d.get(f"speed {n.unit}", [None, None])[1]
    kept = row.certificate.other_engine.get("speed kept")
    return [f"`{row.name}`: `{row.command}`", f"{n.speed:.3f} {n.unit}", "–" if five is None else f"{five:.3f}",
            f"{d['falls']} of {d['count']}", _headings(d), f"{100 * n.slip / max(abs(n.speed), 0.02):.0f} %",
            "–" if kept is None else f"{100 * kept:.0f} %", f"{n.tilt:.1f} deg, {ways.torque:.2f} N m",
            "–" if c.slowest is None else f"{c.slowest} cycles", row.by_seed or "–"]


def _headings(draws: Mapping[str, Any]) -> str:
    """RMS over draws as they are, after one recorded metre, and after three."""
    trimmed = draws.get("straightened") or {}
    later = [trimmed.get(f"after {n} deg/m RMS") for n in ("one metre", "3 metres")]
    return ", ".join("–" if h is None else f"{h:.1f}" for h in (draws["heading deg/m RMS"], *later))


def write_rows(text: str, page: Path = PAGE) -> None:
    """Puts the table between its marks."""
    said = read_text(page)
    pattern = re.compile(re.escape(BEGIN) + ".*?" + re.escape(END), re.DOTALL)
    write_whole(page, pattern.sub(lambda _: f"{BEGIN}\n{text}\n{END}", said))


def study(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Plays every row three ways, writes the page, and the table into the docs."""
    model = puppy_model()
    found = rows(model)
    told: dict[str, list[dict[str, object]]] = {}
    cells = []
    for k, row in enumerate(found[:1] if quick else found):
        all_of_them = [certified(row.certificate)]
        for by in ("simulate",) if quick else ("simulate", "run", "MuJoCo"):
            progress(f"{row.name} by {by}", k / len(found))
            all_of_them.append(played(row, model, by))
        told[row.name] = [vars(d) for d in all_of_them]
        cells += [[row.name, d.how, f"{d.speed:.3f}", f"{d.heading:+.1f}", f"{d.tilt:.1f}", f"{d.torque:.2f}"]
                  for d in all_of_them]
    report = Report("The gaits that ship, played", f"{len(found)} gaits from power-on to standstill.",
                    f"{__doc__}\n\n{PUPPY_CLAIM}", [], Provenance.of(model))
    header = ["gait", "by", "speed [m/s]", "heading [deg/m]", "largest tilt [deg]", "largest torque [N m]"]
    report.add(Section("As certified and as played", [Table(header, cells)]))
    if not quick:
        write_rows(markdown(found))
    return publish(out, model, report, {"rows": told}, {})


if __name__ == "__main__":
    raise SystemExit(run_study("gait_rows", __doc__, study))
