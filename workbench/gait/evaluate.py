"""Many gaits on many robots: simulated once, remembered, and judged."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from workbench.files import InputError
from workbench.gait.draws import draw_margins, slip_margin
from workbench.gait.feet import feet_measure
from workbench.gait.limits import Margin, contact_margin, run_margins, table_margins, violation
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import ROWS, GaitMeasure, as_plain, fallen, from_plain, measure
from workbench.gait.request import Request
from workbench.gait.requirements import cost as cost_of
from workbench.gait.requirements import direction_margins, speed_margins
from workbench.gait.rollouts import Rollouts
from workbench.gait.shape import GaitShape
from workbench.gait.table import GaitTable, Paths, gait_table, paths_of, table_of
from workbench.motion import PoseTable
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import Job, SimulationConfig

SECONDS, CYCLES = 2.0, 2
"""A gait is measured over at least so long [s], and so many cycles, after the first: in that the heading settles, by up to 3 deg,
which over half a metre would be told as drift."""
BROKEN = 2.0
"""Cost of breaking a limit by a factor of e: a tenth over a limit costs the puppy 0.27 m/s."""
LEAD = 0.03
"""At rest before the first command [s], in which the feet that carry the robot are identified."""
SEARCH = SimulationConfig(base="free", time_step=2e-3, contact_period=0.0, log_period=ROWS)
"""While searching: 2 ms and 1 ms agree to a hundredth in speed."""


def table_sha256(*tables: PoseTable) -> str:
    """Parts of the firmware's table: joints, goals, speeds, dwells, and which poses are played once."""
    digest = hashlib.sha256()
    for t in tables:
        content = {"joints": t.joints, "goals": t.goals.tolist(), "speeds": t.speeds.tolist(), "dwells_ms": t.dwells_ms.tolist(),
                   **({"start": t.start, "stop": t.stop} if t.start or t.stop else {})}
        digest.update(json.dumps(content).encode())
    return digest.hexdigest()


@dataclass(frozen=True, eq=False)
class Candidate:
    """A gait and its results. nominal: None where its table alone breaks a limit. draws: on the ensemble's robots, empty
    where that was not worth it. margins: of each limit. cost: to be minimised."""

    table: GaitTable
    margins: tuple[Margin, ...]
    nominal: GaitMeasure | None = None
    draws: tuple[GaitMeasure, ...] = ()
    cost: float = math.inf

    @property
    def shape(self) -> GaitShape:
        """The gait's shape in numbers."""
        return self.table.shape

    @cached_property
    def violation(self) -> float:
        """Sum of the excess over broken limits; 0 where none is broken."""
        return violation(self.margins) + (0.0 if self.nominal else 10.0)

    @property
    def good(self) -> bool:
        """Keeps every limit."""
        return self.nominal is not None and self.violation == 0.0

    @property
    def merit(self) -> float:
        """Cost plus penalty for broken limits, to be minimised; a gait that breaks a limit slightly may lead to a better one that
        keeps it, so that it is not ranked separately."""
        return min(self.cost, 10.0) + BROKEN * self.violation

    def rank(self) -> tuple[bool, float]:
        """For sorting: gaits that keep all limits first, by cost; the rest by cost plus penalty."""
        return (not self.good, self.merit)


class Evaluator:
    """Simulates gaits of one request. memory: file of measures, so that an interrupted run continues.
    seconds: of walking, after the first cycle."""

    def __init__(self, machine: GaitMachine, request: Request, draws: Sequence[RobotModel], memory: Path | None = None,
                 n_jobs: int = 2, config: SimulationConfig = SEARCH, seconds: float = SECONDS) -> None:
        self.machine, self.request, self.config, self.seconds = machine, request, config, seconds
        self._rollouts = Rollouts(n_jobs)
        self.nominal = request.on_slope(machine.model)
        self.draws = tuple(request.on_slope(d) for d in draws)
        self._memory, self._known = memory, _read(memory)
        self._config = hashlib.sha256(repr((config, seconds, sorted(GaitMeasure.__dataclass_fields__))).encode()).hexdigest()[:8]
        self._tables: dict[GaitShape, tuple[GaitTable | None, list[Margin]]] = {}
        self.rollouts = 0

    def judge(self, shapes: Sequence[GaitShape], draws: int, keep: Callable[[list[Candidate]], list[Candidate]] | None = None,
              ) -> list[Candidate]:
        """The shapes as candidates, in their order. draws: number of the ensemble's robots on which the candidates selected by
        `keep` are tried (default: all that keep the limits so far on the nominal robot)."""
        new = [s for s in dict.fromkeys(shapes) if s not in self._tables]
        self._tables.update({p.shape: self._table(p) for p in paths_of(self.machine, new)})
        tables = [self._tables[s] for s in shapes]
        first = [t for t, margins in tables if t is not None and violation(margins) == 0.0]
        nominal = dict(zip(map(id, first), self._measures([(t, self.nominal) for t in first])))
        out = [self._candidate(t, margins, nominal.get(id(t))) for t, margins in tables]
        chosen = [c for c in (keep(out) if keep else out) if c.nominal is not None and not c.nominal.fell] if draws else []
        robots = self.draws[:draws]
        on_robots = self._measures([(c.table, robot) for robot in robots for c in chosen])
        for i, c in enumerate(chosen):
            measures = tuple(on_robots[i + k * len(chosen)] for k in range(len(robots)))
            out[next(k for k, o in enumerate(out) if o is c)] = self._judge(c.table, [m for m in c.margins if _of_table(m)],
                                                                            c.nominal, measures)
        return out

    def measure(self, runs: Sequence[tuple[GaitShape, RobotModel]]) -> list[GaitMeasure]:
        """Measures of each shape on a robot of its own, which is on the slope already. InputError where a goal is beyond the
        registers."""
        tables = {shape: gait_table(self.machine, shape) for shape in dict.fromkeys(shape for shape, _ in runs)}
        return self._measures([(tables[shape], robot) for shape, robot in runs])

    def _table(self, paths: Paths) -> tuple[GaitTable | None, list[Margin]]:
        limits = self.request.limits
        try:
            table = table_of(self.machine, paths, led=bool(paths.off.max() <= limits.reach))
        except InputError:
            return None, []
        margins = table_margins(self.machine, table, limits)
        if violation(margins) == 0.0:
            margins.append(contact_margin(self.machine.self_contact.nearest(table.asked), limits))
        return table, margins

    def _candidate(self, table: GaitTable | None, margins: list[Margin], nominal: GaitMeasure | None) -> Candidate:
        if table is None:
            beyond = Margin("range", "robot", math.inf, 1.0, "registers", 100.0)
            return Candidate(gait_table(self.machine, GaitShape()), (beyond,))
        if nominal is None:
            return Candidate(table, tuple(margins))
        return self._judge(table, margins, nominal, ())

    def _judge(self, table: GaitTable, margins: list[Margin], nominal: GaitMeasure | None, draws: tuple[GaitMeasure, ...],
               ) -> Candidate:
        assert nominal is not None
        limits, request = self.request.limits, self.request
        ran = run_margins(self.machine, nominal, limits)
        everything = (*margins, *ran, slip_margin(self.machine, request, nominal), *direction_margins(request, nominal),
                      *speed_margins(request, nominal, draws), *draw_margins(self.machine, request, draws))
        return Candidate(table, everything, nominal, draws, cost_of(self.machine, request, nominal, draws))

    def _measure(self, take: Take, model: RobotModel, begin: float, period: float) -> GaitMeasure:
        """Draws are asked for less: their current is the certificate's matter."""
        m = measure(take, model, begin, period, electrical=model is self.nominal)
        feet = feet_measure(take, model, self.machine.legs, begin, period)
        return replace(m, clearance=feet.clearance, slip=feet.slip)

    def _measures(self, wanted: Sequence[tuple[GaitTable, RobotModel]]) -> list[GaitMeasure]:
        keys = [f"{table_sha256(t.start, t.cycle)[:24]} {m.sha256[:24]} {self._config}" for t, m in wanted]
        missing = {k: w for k, w in zip(keys, wanted) if k not in self._known}
        for as_seen in (True, False):
            self._simulate({k: w for k, w in missing.items() if (w[1] is self.nominal) is as_seen}, as_seen)
        return [self._known[k] for k in keys]

    def _simulate(self, wanted: Mapping[str, tuple[GaitTable, RobotModel]], as_seen: bool) -> None:
        """Adds to the known results, and to the memory."""
        jobs, lines = [], []
        for table, model in wanted.values():
            cycles = max(CYCLES, math.ceil(self.seconds / table.period))
            end = table.start_seconds + (1 + cycles) * table.period
            jobs.append(Job(model, self.config, table.commands(1 + cycles), end, LEAD))
        self.rollouts += len(jobs)
        for (key, (table, model)), take in zip(wanted.items(), self._rollouts.takes(jobs, as_seen)):
            begin, period = table.start_seconds + table.period, table.period
            self._known[key] = fallen(len(model.joints)) if take is None else self._measure(take, model, begin, period)
            lines.append(json.dumps([key, as_plain(self._known[key])]) + "\n")
        if self._memory is not None and lines:
            with self._memory.open("a") as f:
                f.writelines(lines)



def _of_table(margin: Margin) -> bool:
    return margin.kind == "table"


def _read(path: Path | None) -> dict[str, GaitMeasure]:
    """Results of an earlier run; a last line that was cut off is left out."""
    known: dict[str, GaitMeasure] = {}
    if path is None or not path.is_file():
        return known
    for line in path.read_text().splitlines():
        try:
            key, content = json.loads(line)
        except ValueError:
            continue
        known[key] = from_plain(content)
    return known
