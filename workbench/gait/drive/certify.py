"""The certificate of a family: how each unit of turn changes the heading over random robots, and that none falls.

It is written as family.json into the folder of the gait, and bound to the gait's certificate and to the robot.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from workbench.device.tables.limits import check_limits
from workbench.files import InputError
from workbench.files.errors import in_words
from workbench.files.option_checks import check_positive, check_whole
from workbench.files.reading import read_text, write_whole
from workbench.gait.certificate import CLAIM, NAME, plain, read_certificate
from workbench.gait.draws import bound
from workbench.gait.drive.family import GaitFamily, Steer
from workbench.gait.drive.step_map import MapOptions, StepMap, fell, fit_increments, fit_step_map, rows_of
from workbench.gait.ensemble import Ensemble
from workbench.robot import RobotModel
from workbench.simulation import Job, SimulationConfig, simulate_batch
from workbench.types import Progress

FILE = "family.json"
FORMAT = 2
"""1 had no sideways strides."""
LIMITS = ("most", "most_change", "most_side", "most_side_change")
"""What a cycle may be steered by, and by how much more than the one before; names of `DriveOptions`."""


@dataclass(frozen=True)
class FamilyOptions:
    """How a family is certified.

    most: largest turn [rad per stance]; most_change: from one cycle to the next [rad]; most_side, most_side_change: the same of
    the sideways stride [m per stance]; all as `DriveOptions` has them. draws: robots; of 20 that stand, fewer than 14 % fall (at
    95 %). cycles: of each robot's walk, with turns at random. hold: cycles for which a turn is kept. least_gain: smallest gain of
    any robot, as a share of the nominal one; with less the plan's turns do not bring the robot back within its horizon.
    most_gain: largest gain, as a share; at twice the nominal one the loop with its two cycles of delay begins to oscillate.
    authority: heading change at the largest turn, in scatters of one cycle's heading. grid: turns over the range whose tables are
    checked against the limits of servos and joints.
    """

    most: float = 0.15
    most_change: float = 0.08
    most_side: float = 0.008
    most_side_change: float = 0.003
    draws: int = 20
    cycles: int = 30
    hold: int = 2
    least_gain: float = 0.5
    most_gain: float = 2.0
    authority: float = 3.0
    grid: int = 13
    time_step: float = 1e-3

    def __post_init__(self) -> None:
        check_whole(self, draws=1, cycles=8, hold=1, grid=3)
        check_positive(self, *LIMITS, "least_gain", "most_gain", "authority", "time_step")


@dataclass(frozen=True, eq=False)
class FamilyCertificate:
    """most, most_change: the turns that were played [rad per stance]; most_side, most_side_change: the sideways strides [m per
    stance]. step_map: of the nominal robot. draws: count, falls and the bound that they leave, and over the robots lowest, median
    and highest of total gain [rad per rad], scatter [rad], speed [m/s] and own turning bias [rad per cycle]. problems: limits
    that are broken, in words. gait, model_sha256: hashes of the gait's certificate and of the robot."""

    most: float
    most_change: float
    most_side: float
    most_side_change: float
    step_map: StepMap
    draws: dict[str, Any]
    gait: str
    model_sha256: str
    problems: tuple[str, ...] = field(default=())

    @property
    def kept(self) -> bool:
        """Whether every limit is kept."""
        return not self.problems

    def summary(self) -> str:
        """The certificate in a few lines, for a person."""
        d, deg = self.draws, np.degrees
        lines = [f"turns up to {self.most:g} rad and sideways strides up to {1000 * self.most_side:g} mm per stance, changes up "
                 f"to {self.most_change:g} rad and {1000 * self.most_side_change:g} mm: {d['falls']} of {d['count']} "
                 f"random robots fell (below {100 * d['falls at most']:.2g} % at 95 %)"]
        if "gain rad/rad" in d:
            low, middle, high = (deg(g * self.most) for g in d["gain rad/rad"])
            nominal = deg(_gain(self.step_map) * self.most)
            lines += [f"the largest turn changes the heading by {nominal:.1f} deg a cycle on the nominal robot, {low:.1f} to "
                      f"{high:.1f} on random ones (median {middle:.1f})",
                      f"one cycle's heading scatters by {deg(self.step_map.scatter[0]):.2f} deg, {deg(d['scatter rad'][1]):.2f}"]
        return "\n".join([*lines, *(f"not kept: {p}" for p in self.problems)])

    def to_json(self) -> dict[str, Any]:
        """Content of the certificate's file, with the checksum that reveals changes."""
        content = plain({"format": FORMAT, "claim": CLAIM, "kept": self.kept, **vars(self), "step_map": vars(self.step_map)})
        return {**content, "sha256": _digest(content)}

    def write(self, folder: Path) -> Path:
        """Writes family.json."""
        write_whole(folder / FILE, json.dumps(self.to_json(), indent=1, allow_nan=False) + "\n")
        return folder / FILE


def certify_family(family: GaitFamily, gait_sha256: str, ensemble: Ensemble, folder: Path, seed: int = 0,
                   options: FamilyOptions | None = None, progress: Progress = lambda what, done: None) -> FamilyCertificate:
    """Plays turns at random on the nominal robot and on robots drawn into `folder`. InputError where the nominal robot falls or
    cannot be steered."""
    o, model = options or FamilyOptions(), family.machine.model
    progress("the nominal robot", None)
    of_map = MapOptions(most=o.most, most_side=o.most_side, hold=o.hold, time_step=o.time_step)
    nominal = fit_step_map(family, model, seed, of_map)
    steers = bounded_steers(np.random.default_rng([seed, 58]), o)
    robots = ensemble.draws(model, o.draws, seed, folder)
    config = SimulationConfig(time_step=o.time_step, contact_period=0.0, log_period=0.01)
    seconds = family.start_seconds + o.cycles * family.period
    jobs = [Job(r, config, family.sequence(steers), seconds) for r in robots]
    takes = simulate_batch(jobs, progress=lambda done, of: progress(f"drawn robot {done} of {of}", done / of))
    maps = [fit_increments(*rows_of(t, steers, family), o.most) for t in takes if not fell(t)]
    falls = len(takes) - len(maps)
    draws = {"count": len(takes), "falls": falls, "falls at most": bound(falls, len(takes)), **_spread(maps, family.period)}
    problems = (*broken_limits(family, o), *_problems(nominal, maps, falls, o))
    return FamilyCertificate(o.most, o.most_change, o.most_side, o.most_side_change, nominal, draws, gait_sha256, model.sha256,
                             problems)


def broken_limits(family: GaitFamily, o: FamilyOptions) -> list[str]:
    """Limits of servos and joints that tables break over the whole range of turns, without a sideways stride and with the
    largest to each side, in words; those of the first such table."""
    for side in (0.0, -o.most_side, o.most_side):
        for turn in np.linspace(-o.most, o.most, o.grid):
            broken = [v for v in check_limits(family.cycle(Steer(turn, side)), family.machine.model) if not v.warning]
            if broken:
                return [f"turn {turn:+.3f}, side {1000 * side:+.1f} mm: {broken[0]}"]
    return []


def bounded_steers(rng: np.random.Generator, o: FamilyOptions) -> list[Steer]:
    """Steering of each cycle, at random within the largest turn, sideways stride and changes; all limits are met."""
    most, change = np.array([o.most, o.most_side]), np.array([o.most_change, o.most_side_change])
    out, last = list[Steer](), np.zeros(2)
    for _ in range(0, o.cycles, o.hold):
        last = np.clip(rng.choice((-1.0, 1.0), 2) * most, last - change, last + change)
        out += [Steer(*last.tolist())] * o.hold
    return out[:o.cycles]


def read_family(gait: str | Path, model: RobotModel) -> FamilyCertificate:
    """The certificate in the folder of a gait; InputError where it is missing, was changed, is another gait's or robot's, or says
    that a limit is broken."""
    at = Path(gait).parent / FILE
    if not at.is_file():
        raise InputError(at, "the family's certificate is missing; `workbench drive --certify --gait MOTION` writes it")
    text = read_text(at)
    try:
        content = json.loads(text)
        digest, known = content["sha256"], content["format"]
        good = digest == _digest({key: value for key, value in content.items() if key != "sha256"})
    except (ValueError, KeyError, TypeError, AttributeError) as e:
        raise InputError(at, f"not a family's certificate ({in_words(e)})") from None
    if not good:
        raise InputError(at, "it was changed after it was written")
    if known != FORMAT:
        raise InputError(at, f"format: expected {FORMAT}, got {known}; `workbench drive --certify --gait MOTION` writes it anew")
    try:
        step = content["step_map"]
        numbers: dict[str, Any] = {f.name: step[f.name] for f in fields(StepMap)}
        step_map = StepMap(**numbers | {"scatter": tuple(step["scatter"])})
        content_fields: dict[str, Any] = {name: content[name] for name in (*LIMITS, "draws", "gait", "model_sha256")}
        found = FamilyCertificate(**content_fields, step_map=step_map, problems=tuple(content["problems"]))
    except (ValueError, KeyError, TypeError, AttributeError) as e:
        raise InputError(at, f"not a family's certificate ({in_words(e)})") from None
    if found.model_sha256 != model.sha256:
        raise InputError(at, f"it was made for another robot ({found.model_sha256[:12]}) than this ({model.sha256[:12]})")
    if found.gait != gait_sha256(gait):
        raise InputError(at, f"it was made for another gait than that of {NAME} in the same folder")
    if found.problems:
        raise InputError(at, f"a limit is broken: {found.problems[0]}")
    return found


def gait_sha256(gait: str | Path) -> str:
    """Digest of the tables that the gait's certificate states. InputError where it cannot be read."""
    return read_certificate(Path(gait).parent / NAME).tables["gait"]


def _problems(nominal: StepMap, maps: list[StepMap], falls: int, o: FamilyOptions) -> tuple[str, ...]:
    out = [f"{falls} of {falls + len(maps)} drawn robots fell"] if falls else []
    if abs(_gain(nominal)) * o.most < o.authority * nominal.scatter[0]:
        turned, scatter = np.degrees(abs(_gain(nominal)) * o.most), np.degrees(nominal.scatter[0])
        out.append(f"the largest turn changes the heading by {turned:.1f} deg a cycle, less than {o.authority:g} times its "
                   f"scatter of {scatter:.1f} deg")
    shares = [_gain(m) / _gain(nominal) for m in maps]
    if shares and min(shares) < o.least_gain:
        out.append(f"a drawn robot has {min(shares):.2f} of the nominal gain, expected at least {o.least_gain:g}")
    if shares and max(shares) > o.most_gain:
        out.append(f"a drawn robot has {max(shares):.2f} of the nominal gain, expected at most {o.most_gain:g}")
    return tuple(out)


def _gain(m: StepMap) -> float:
    return m.gain + m.memory


def _spread(maps: list[StepMap], period: float) -> dict[str, list[float]]:
    """Lowest, median and highest over the robots that stood."""
    values = {"gain rad/rad": [_gain(m) for m in maps], "scatter rad": [m.scatter[0] for m in maps],
              "speed m/s": [m.ahead / period for m in maps], "bias rad/cycle": [m.bias for m in maps]}
    return {k: [float(f(v)) for f in (np.min, np.median, np.max)] for k, v in values.items() if v}


def _digest(content: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
