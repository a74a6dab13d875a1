"""A servo is dead or loose: do one recording, its diagnosis and three trials find a gait that still walks?

    python -m studies.after_damage [--out runs/studies/after_damage] [--quick]

Puppies of the second engine (MuJoCo) have one damaged servo of a leg: dead (its motor gives no more than 0.01 N m), or loose
(10 to 20 deg of play). It is filmed once on a stand, where it cannot fall, and the recording is diagnosed. The diagnosed model
predicts how fast the demo's gait walks with each turn and pace of its family, backwards too; three trials in the second engine
decide, each chosen by the predictions and the trials before it. The same three trials by the nominal model show the value of
the diagnosis. Speed is the distance between the robot's first and last position after the first cycle, by time. A study that
was stopped resumes.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from studies.common import ROOT, Array, kept_result, publish, run_study
from studies.concealed_effects.robots import puppy
from studies.concealed_effects.takes import filmed_takes
from studies.other_engine.as_take import mujoco_take
from studies.other_engine.make_session import random_camera, write_recordings
from workbench.compare.session import load_session
from workbench.device.tables.limits import check_limits
from workbench.gait.adapt import TrialChooser
from workbench.gait.certificate import PUPPY_CLAIM
from workbench.gait.drive.family import GaitFamily, Steer, load_family
from workbench.gait.drive.step_map import fell
from workbench.gait.rollouts import Rollouts
from workbench.gait.shape import GaitShape
from workbench.gait.table import gait_table
from workbench.identify.diagnosis import diagnose_session
from workbench.motion import Commands
from workbench.recording.take import Take
from workbench.robot import EffectSpec, RobotModel, puppy_model
from workbench.simulation import Job, SimulationConfig
from workbench.view.report.page import Provenance, Report, Section, Table

GAIT = ROOT / "data/gaits/demo/gait.csv"
ROBOTS, SEED, TRIALS = 10, 58, 3
DEAD = 0.01
"""Torque that a dead servo's motor still gives [N m], a hundredth of a good one's."""
LOOSE = (10.0, 20.0)
"""Play of a loose servo [deg]."""
TURNS, PACES = np.linspace(-0.15, 0.15, 5), (-1.0, -0.7, 0.5, 0.75, 1.0, 1.2)
HOPELESS = 0.1
"""Share of the healthy robot's speed below which the diagnosed model's predictions are not used; the nominal ones are then."""
CONFIG = SimulationConfig(base="free", time_step=2e-3, contact_period=0.0, log_period=0.01)


@dataclass(frozen=True)
class Candidate:
    """A gait of the family as it is played: turn [rad per stance], pace, commands, and the time from which it is watched [s]."""

    turn: float
    pace: float
    commands: Commands
    begin: float


def candidates(family: GaitFamily, cycles: int, turns: Sequence[float], paces: Sequence[float]) -> list[Candidate]:
    """The family's gaits whose tables keep the limits of the servos and joints."""
    out = []
    for turn in turns:
        for pace in paces:
            table = gait_table(family.machine, family.shape_of(Steer(float(turn)), pace))
            if all(v.warning for v in check_limits(table.whole, family.machine.model)):
                out.append(Candidate(float(turn), pace, table.commands(cycles), table.start_seconds + table.period))
    return out


def speed(take: Take | None, gait: Candidate) -> float:
    """Distance by time after the first cycle [m/s]; NaN where the robot fell."""
    if take is None or fell(take):
        return float("nan")
    assert take.p_WB is not None
    start = gait.begin + (0.0 if np.isnan(take.starts_at) else take.starts_at)
    here = [np.array([np.interp(t, take.time, c) for c in take.p_WB[:, :2].T]) for t in (start, take.time[-1])]
    return float(np.linalg.norm(here[1] - here[0]) / (take.time[-1] - start))


def predicted(model: RobotModel, gaits: Sequence[Candidate]) -> Array:
    """Speeds (N,) [m/s] in the compiled station; 0 where the robot falls or touches the floor with more than its feet, which that
    station does not simulate."""
    takes = Rollouts(1).takes([Job(model, CONFIG, g.commands, g.commands.end) for g in gaits], as_seen=False)
    return np.nan_to_num([speed(t, g) for t, g in zip(takes, gaits)])


def trials(said: Array, real: RobotModel, gaits: Sequence[Candidate]) -> dict[str, Any]:
    """Three gaits tried on the real robot, chosen by the predictions `said` (N,) [m/s]."""
    chooser = TrialChooser(np.array([(g.turn, g.pace) for g in gaits]), said)
    for _ in range(TRIALS):
        k = chooser.next()
        chooser.tell(k, played(real, gaits[k]))
    best = chooser.best
    return {"tried": [[gaits[k].turn, gaits[k].pace, float(chooser.predicted[k]), v] for k, v in chooser.tried.items()],
            "turn": gaits[best].turn, "pace": gaits[best].pace, "speed": chooser.tried[best]}


def played(real: RobotModel, gait: Candidate) -> float:
    """Speed in the second engine [m/s]; 0 for a fall."""
    return float(np.nan_to_num(speed(mujoco_take(real, gait.commands, gait.commands.end), gait)))


def damaged(k: int, folder: Path) -> tuple[RobotModel, EffectSpec]:
    """The k-th robot: the nominal model, and the damage; dead and loose take turns. Its session is written into `folder`."""
    rng = np.random.default_rng([SEED, k])
    model = puppy(rng).model(folder)
    joint = str(rng.choice(["bl", "br", "fl", "fr"])) + str(rng.choice(["b", "m", "t"]))
    damage = EffectSpec("torque_ceiling", (joint,), {"torque": DEAD}) if k % 2 == 0 else \
        EffectSpec("backlash", (joint,), {"gap": round(float(rng.uniform(*LOOSE)), 1)})
    shutil.rmtree(folder, ignore_errors=True)
    takes = [t for t in filmed_takes(rng) if t.base == "fixed" and not t.predict]
    write_recordings(folder, model, replace(model, effects=(damage,)), takes, random_camera(rng), rng)
    return model, damage


def one(k: int, out: Path, shape: GaitShape, quick: bool, tell: Callable[[str], None]) -> dict[str, Any]:
    """One robot, from its damage to its best trial."""
    name = f"robot{k + 1:02d}"
    folder = out / "sessions" / name
    tell(f"{name}: recording")
    model, damage = damaged(k, folder)
    tell(f"{name}: diagnosing")
    diagnosis = diagnose_session(load_session(folder / "session.yaml"), n_jobs=1).diagnosis
    tell(f"{name}: trials")
    family = GaitFamily(load_family(GAIT, puppy_model()).machine, shape)
    cycles, turns, paces = (4, (0.0, 0.15), (0.75, 1.0)) if quick else (10, TURNS, PACES)
    gaits = candidates(family, cycles, [float(t) for t in turns], paces)
    itself = next(g for g in gaits if g.turn == 0.0 and g.pace == 1.0)
    real = replace(model, effects=(damage,))
    healthy, said = predicted(diagnosis.nominal, gaits), predicted(diagnosis.model, gaits)
    hopeless = bool(said.max() < HOPELESS * healthy.max())
    return {"name": name, "damage": {"effect": damage.effect, "joint": damage.where[0], **damage.parameters},
            "found": [[f.effect, list(f.where)] for f in diagnosis.findings], "candidates": len(gaits),
            "intact": played(model, itself), "unchanged": played(real, itself),
            "hopeless": hopeless, "nominal": (by_nominal := trials(healthy, real, gaits)),
            "diagnosed": by_nominal if hopeless else trials(said, real, gaits)}


def study(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Robot by robot; the page is written after each."""
    rows, said, count = list[dict[str, Any]](), "", 1 if quick else ROBOTS
    model = puppy_model()
    shape = load_family(GAIT, model).shape
    for k in range(count):
        def tell(what: str, k: int = k) -> None:
            progress(what, k / count)

        rows.append(kept_result(out / "results" / f"robot{k + 1:02d}.json", partial(one, k, out, shape, quick, tell)))
        said = publish(out, model, _report(model, rows), {"robots": rows}, {})
    return f"{summary(rows)} {said}"


def summary(rows: Sequence[Mapping[str, Any]]) -> str:
    """The counts in a line."""
    named = sum([r["damage"]["effect"], [r["damage"]["joint"]]] in r["found"] for r in rows)
    joint = sum(any(r["damage"]["joint"] in where for _, where in r["found"]) for r in rows)
    counts = [sum(share(r, who) >= 0.6 for r in rows) for who in ("unchanged", "nominal", "diagnosed")]
    return (f"{len(rows)} damaged robots: the diagnosis names the damage on {named} and its joint on {joint}. At least 60 % of "
            f"the intact speed: {counts[0]} with the gait unchanged, {counts[1]} after three trials by the nominal model, "
            f"{counts[2]} by the diagnosed one.")


def share(r: Mapping[str, Any], who: str) -> float:
    """Share of the intact robot's speed."""
    reached = r[who] if who == "unchanged" else r[who]["speed"]
    return float(reached / r["intact"])


def _report(model: RobotModel, rows: Sequence[Mapping[str, Any]]) -> Report:
    report = Report("After damage", summary(rows), f"{__doc__}\n\n{PUPPY_CLAIM}", [], Provenance.of(model))
    report.add(Section("Robots", [Table(
        ["robot", "damage", "found", "intact [m/s]", "unchanged [%]", "three trials, nominal model [%]",
         "three trials, diagnosed model [%]", "chosen turn [rad], pace"],
        [[r["name"], _damage(r), "; ".join(f"{e} at {', '.join(w)}" if w else e for e, w in r["found"]) or "–",
          f"{r['intact']:.3f}",
          *(f"{100 * share(r, who):.0f}" for who in ("unchanged", "nominal", "diagnosed")),
          f"{r['diagnosed']['turn']:+.3f}, {r['diagnosed']['pace']:g}"
          + (" (no prediction: as by the nominal model)" if r["hopeless"] else "")] for r in rows],
        "Speeds as shares of the intact robot's with the demo's gait.")]))
    return report


def _damage(r: Mapping[str, Any]) -> str:
    d = r["damage"]
    return f"dead: {d['joint']}" if d["effect"] == "torque_ceiling" else f"loose: {d['joint']}, {d['gap']:g} deg"


if __name__ == "__main__":
    raise SystemExit(run_study("after_damage", __doc__, study))
