"""A map of gaits over speed and turning: in each cell the gait whose motion differs least from robot to robot.

A gait belongs to the cell of its median motion over drawn robots, since that is what it does on a robot that nobody measured. The
search finds gaits on few of them; each cell's gait is then measured on others, because those few flatter the gaits that were
chosen on them, and tried on fresh ones.

Needs the extra [map] (pyribs). Inside `joblib.parallel_config(backend="dask")` the rollouts run on the client's cluster.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import InputError
from workbench.files.errors import in_words
from workbench.files.option_checks import check_positive, check_whole
from workbench.files.reading import read_text, write_whole
from workbench.gait.certificate import CLAIM
from workbench.gait.ensemble import Ensemble
from workbench.gait.limits import GaitLimits, table_margins, violation
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import measure
from workbench.gait.request import Request
from workbench.gait.rollouts import Rollouts
from workbench.gait.shape import GaitShape
from workbench.gait.space import Space, space_of
from workbench.gait.table import GaitTable, paths_of, table_of
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import Job, SimulationConfig
from workbench.types import Array, Progress, no_progress

Motion = tuple[float, float] | None
"""Forward speed [m/s] and turning [rad/s]; None where the robot fell or touched the floor with something other than a foot."""
CONFIG = SimulationConfig(time_step=2e-3, contact_period=0.0, log_period=0.01)


@dataclass(frozen=True)
class MapOptions:
    """Size of the map and of its search.

    cells: along each axis. speed: from 0 to this [m/s]; turning: from minus to plus this [rad/s]; the demo's gait walks 0.12 m/s.
    turn: largest turn of a shape [rad per stance]. family, knees: the same in every cell, so that neighbouring cells can follow
    each other. generations, batch: of pyribs' emitter; robots: drawn ones of the search, in addition to the nominal one. seconds:
    of each rollout; the first cycle is not counted. spread: speed that weighs as much as 1 rad/s of turning [m/s]. measured:
    drawn robots on which the gaits found are measured. fresh: drawn robots on which each cell is tried afterwards. same: largest
    difference of the median there, as a share of the map's range.
    """

    cells: int = 7
    speed: float = 0.35
    turning: float = 1.0
    turn: float = 0.4
    family: str = "trot"
    knees: tuple[int, int] = (1, 1)
    generations: int = 40
    batch: int = 24
    robots: int = 4
    seconds: float = 2.0
    spread: float = 0.1
    measured: int = 8
    fresh: int = 8
    same: float = 0.1

    def __post_init__(self) -> None:
        check_whole(self, cells=2, generations=1, batch=2, robots=1, measured=1, fresh=1)
        check_positive(self, "speed", "turning", "turn", "seconds", "spread", "same")


@dataclass(frozen=True)
class Cell:
    """speed [m/s], turning [rad/s]: medians over the robots it was measured on. spread: RMS difference of these robots from them
    [rad/s]. fresh: median speed and turning of the fresh robots, None where one fell; reproduced: whether these are
    within `same`."""

    shape: GaitShape
    speed: float
    turning: float
    spread: float
    fresh: tuple[float, float] | None = None
    reproduced: bool = False


@dataclass(frozen=True)
class GaitMap:
    """cells: those that were filled. rollouts: all that it took."""

    options: MapOptions
    cells: tuple[Cell, ...]
    rollouts: int
    model_sha256: str

    @property
    def filled(self) -> float:
        """Share of the cells that hold a gait."""
        return len(self.cells) / self.options.cells**2

    @property
    def reproduced(self) -> float:
        """Share of the filled cells that fresh robots reproduce."""
        return sum(c.reproduced for c in self.cells) / max(len(self.cells), 1)

    def nearest(self, speed: float, turning: float) -> Cell:
        """The reproduced cell nearest to a speed [m/s] and a turning [rad/s], by shares of the map's range. InputError where none
        is."""
        o, known = self.options, [c for c in self.cells if c.reproduced]
        if not known:
            raise InputError(None, "the map has no gait that fresh robots reproduce")
        return min(known, key=lambda c: math.hypot((c.speed - speed) / o.speed, (c.turning - turning) / (2 * o.turning)))

    def start_for(self, request: Request) -> GaitShape:
        """The gait of the cell nearest to a request to walk forward, on an arc or in place, from which a search may start.
        InputError for backward and sideways, which the map does not hold."""
        if request.way in ("backward", "sideways"):
            raise InputError(None, f"the map holds no gaits that go {request.way}")
        wanted = math.inf if request.speed is None else request.speed
        if request.way == "turn":
            return self.nearest(0.0, request.side * min(wanted, self.options.turning)).shape
        speed = min(wanted, self.options.speed)
        return self.nearest(speed, request.side * speed / request.radius if request.radius else 0.0).shape

    def save(self, path: Path) -> Path:
        """Writes it as JSON."""
        content: dict[str, Any] = {"format": 1, "claim": CLAIM, **asdict(self), "filled": self.filled,
                                   "reproduced": self.reproduced}
        write_whole(path, json.dumps(content, indent=1) + "\n")
        return path


def load_map(path: str | Path, model: RobotModel) -> GaitMap:
    """A map that `GaitMap.save` wrote. InputError where it is none, or of another robot."""
    text = read_text(Path(path))
    try:
        content = json.loads(text)
        cells = [{**c, "shape": GaitShape.from_plain(c["shape"]), "fresh": tuple(c["fresh"]) if c["fresh"] else None}
                 for c in content["cells"]]
        options = {**content["options"], "knees": tuple(content["options"]["knees"])}
        found = GaitMap(MapOptions(**options), tuple(Cell(**c) for c in cells), content["rollouts"], content["model_sha256"])
        good = content["format"] == 1
    except (ValueError, KeyError, TypeError, AttributeError) as e:
        raise InputError(path, f"not a map of gaits ({in_words(e)})") from None
    if not good:
        raise InputError(path, f"format: expected 1, got {content['format']}")
    if found.model_sha256 != model.sha256:
        raise InputError(path, f"it was made for another robot ({found.model_sha256[:12]}) than this ({model.sha256[:12]})")
    return found


def build_map(model: RobotModel, ensemble: Ensemble, folder: Path, seed: int = 0, options: MapOptions | None = None,
              n_jobs: int = 2, progress: Progress = no_progress) -> GaitMap:
    """Fills the map. folder: for drawn robots' files. The same seed gives the same map, whatever `n_jobs` or the cluster is.
    InputError where pyribs is not installed."""
    search = _Search(GaitMachine(model), options or MapOptions(), n_jobs)
    o = search.options
    found = search.run([model, *ensemble.draws(model, o.robots, seed, folder)], seed, progress)
    progress("measuring", None)
    cells = search.measure(found, ensemble.draws(model, o.measured, seed + 1, folder, even=True))
    progress("fresh robots", None)
    fresh = ensemble.draws(model, o.fresh, seed + 2, folder, even=True)
    return GaitMap(o, search.try_on(cells, fresh), search.rollouts, model.sha256)


class _Search:
    def __init__(self, machine: GaitMachine, options: MapOptions, n_jobs: int) -> None:
        self.machine, self.options, self.rollouts = machine, options, 0
        self._rollouts = Rollouts(n_jobs)
        space = space_of(machine, Request())
        self.space: Space = replace(space, low=_with(space, "turn", -options.turn), high=_with(space, "turn", options.turn))

    def run(self, robots: Sequence[RobotModel], seed: int, progress: Progress) -> list[GaitShape]:
        """The gaits of all cells, generation by generation; the nominal robot comes first."""
        try:
            from ribs.archives import GridArchive
            from ribs.emitters import IsoLineEmitter
        except ModuleNotFoundError:
            raise InputError(None, "a map of gaits needs pyribs: pip install 'drake-workbench[map]'") from None
        o, n = self.options, len(self.space.names)
        ranges = [(0.0, o.speed), (-o.turning, o.turning)]
        archive = GridArchive(solution_dim=n, dims=(o.cells, o.cells), ranges=ranges, seed=seed)
        emitter = IsoLineEmitter(archive, iso_sigma=0.05, line_sigma=0.3, initial_solutions=_first(self.space, o, seed),
                                 bounds=[(0.0, 1.0)] * n, batch_size=o.batch, seed=seed)
        for k in range(o.generations):
            progress(f"generation {k + 1}, {len(archive)} of {o.cells**2} cells", k / o.generations)
            points = emitter.ask()
            judged = self.judge([self.shape(x) for x in points], robots)
            inside = [(x, *j) for x, j in zip(points, judged) if j is not None]
            if inside:
                archive.add(*(np.array(column) for column in zip(*inside)))
        return [self.shape(x) for x in archive.data("solution")]

    def measure(self, shapes: Sequence[GaitShape], robots: Sequence[RobotModel]) -> list[Cell]:
        """The cells that these gaits fill: of gaits in the same cell, the one that differs least from robot to robot."""
        cells: dict[tuple[int, int], Cell] = {}
        for shape, judged in zip(shapes, self.judge(shapes, robots)):
            if judged is not None:
                objective, (speed, turning) = judged
                cell = Cell(shape, speed, turning, -objective)
                place = self.place(speed, turning)
                if place not in cells or cell.spread < cells[place].spread:
                    cells[place] = cell
        return list(cells.values())

    def place(self, speed: float, turning: float) -> tuple[int, int]:
        """Row and column of the cell of a motion inside the map's range."""
        o = self.options
        shares = speed / o.speed, (turning + o.turning) / (2 * o.turning)
        row, column = (min(int(o.cells * share), o.cells - 1) for share in shares)
        return row, column

    def shape(self, x: Array) -> GaitShape:
        """The shape at a point of the unit cube."""
        return self.space.shape(np.asarray(x, dtype=float), self.options.family, self.options.knees)

    def judge(self, shapes: Sequence[GaitShape], robots: Sequence[RobotModel]
              ) -> list[tuple[float, tuple[float, float]] | None]:
        """The objective of each shape, and the median speed and turning of the robots; None where one falls, a limit is broken,
        or these are beyond the map's range."""
        o, out = self.options, list[tuple[float, tuple[float, float]] | None]()
        for motions in self.play(self.tables(shapes), robots):
            speed, turning = (math.nan, math.nan) if motions is None else np.median(motions, axis=0).tolist()
            if motions is None or not (0.0 <= speed <= o.speed and abs(turning) <= o.turning):
                out.append(None)
                continue
            apart = (motions - [speed, turning]) / [o.spread, 1.0]
            out.append((-float(np.sqrt(np.mean(np.sum(apart**2, axis=1)))), (speed, turning)))
        return out

    def tables(self, shapes: Sequence[GaitShape]) -> list[GaitTable | None]:
        """The table of each shape; None for shapes beyond the legs' reach, or whose tables break a limit."""
        limits, out = GaitLimits(), list[GaitTable | None]()
        for paths in paths_of(self.machine, shapes):
            try:
                table = table_of(self.machine, paths, "map") if paths.off.max() <= limits.reach else None
            except InputError:
                table = None
            good = table is not None and violation(table_margins(self.machine, table, limits)) == 0.0
            out.append(table if good else None)
        return out

    def play(self, tables: Sequence[GaitTable | None], robots: Sequence[RobotModel]) -> list[Array | None]:
        """Speed [m/s] and turning [rad/s] of each table on every robot (R, 2); None without a table, or where a robot falls: the
        robots after it do not play that table."""
        seen: list[list[tuple[float, float]] | None] = [None if t is None else [] for t in tables]
        for robot in robots:
            standing = [(k, t, s) for k, (t, s) in enumerate(zip(tables, seen)) if t is not None and s is not None]
            commands = [t.commands(max(2, math.ceil(self.options.seconds / t.period)) + 1) for _, t, _ in standing]
            takes = self._rollouts.takes([Job(robot, CONFIG, c, c.end) for c in commands], as_seen=False)
            self.rollouts += len(standing)
            for (k, table, before), take in zip(standing, takes):
                moved = motion(take, robot, table)
                seen[k] = None if moved is None else [*before, moved]
        return [None if s is None else np.array(s) for s in seen]

    def try_on(self, found: Sequence[Cell], fresh: Sequence[RobotModel]) -> tuple[Cell, ...]:
        """The cells with what fresh robots did."""
        o, out = self.options, []
        for cell, motions in zip(found, self.play(self.tables([c.shape for c in found]), fresh)):
            if motions is None:
                out.append(cell)
                continue
            speed, turning = np.median(motions, axis=0).tolist()
            same = abs(speed - cell.speed) <= o.same * o.speed and abs(turning - cell.turning) <= o.same * 2 * o.turning
            out.append(replace(cell, fresh=(speed, turning), reproduced=bool(same)))
        return tuple(out)


def motion(take: Take | None, robot: RobotModel, table: GaitTable) -> Motion:
    """A robot's motion in a take of the table, after the first full cycle."""
    if take is None:
        return None
    m = measure(take, robot, table.start_seconds + table.period, table.period, electrical=False)
    return None if m.fell else (float(m.velocity[0]), float(m.turn_rate))


def _with(space: Space, name: str, value: float) -> Array:
    """The space's bound with another value for one name; the lower one for a negative value."""
    edge = (space.low if value < 0 else space.high).copy()
    edge[space.names.index(name)] = value
    return edge


def _first(space: Space, o: MapOptions, seed: int) -> Array:
    """Plain gaits of the family over strides and turns, each a little different in the rest."""
    rng, out = np.random.default_rng([seed, 7]), []
    for stride in np.linspace(0.01, 0.08, 6):
        for turn in np.linspace(-o.turn, o.turn, 7):
            plain = GaitShape(o.family, o.knees, 8, float(rng.uniform(1.8, 2.6)), stride=float(stride), turn=float(turn),
                              duty=0.6, lift=0.02, crouch=0.045, lead=1.0)
            out.append(space.point(plain))
    return np.array(out)
