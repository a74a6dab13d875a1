"""Does a diagnosis predict motions that it never saw? Concealed robots of another engine, and predictions sealed by their hash.

    python -m studies.sealed_predictions [--out runs/studies/sealed_predictions] [--quick]

Each robot is a puppy in MuJoCo with two hidden effects, drawn from the system's seed and sealed. One session (stand, sway,
walk) is recorded and diagnosed. The diagnosed and the nominal model then predict speed and turning of ten gaits; the SHA-256 of
these predictions is written down before any of the gaits is played in MuJoCo. A study that was stopped resumes with the robot
that it was at.
"""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from studies.common import kept_result, publish, run_study, sign
from studies.concealed_effects.catalogue import draw, possible
from studies.concealed_effects.conceal import separable
from studies.concealed_effects.robots import puppy
from studies.concealed_effects.sealed import Vault
from studies.concealed_effects.takes import filmed_takes
from studies.other_engine.as_take import mujoco_take
from studies.other_engine.make_session import random_camera, write_recordings
from studies.other_engine.player import Rollout
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.files.reading import write_whole
from workbench.gait.certificate import PUPPY_CLAIM
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import measure
from workbench.gait.shape import GaitShape
from workbench.gait.table import gait_table
from workbench.identify.diagnosis import diagnose_session
from workbench.motion import Commands
from workbench.recording.take import Take
from workbench.robot import EffectSpec, RobotModel
from workbench.simulation import Job, SimulationConfig, simulate_batch
from workbench.view.report.page import Provenance, Report, Section, Table, Text

ROBOTS, CYCLES, TRIES = 20, 10, 20
SLOWEST = 0.02
"""Speed [m/s] below which an error is counted by this and not by the speed itself."""
DIAGNOSES = "diagnoses"
"""Folder of the diagnosed models, one folder for each robot."""
TROT = GaitShape("trot", (1, 1), 8, 2.0, stride=0.04, duty=0.6, lift=0.02, crouch=0.045, lead=1.0)
MOTIONS: Mapping[str, GaitShape] = {
    "trot": TROT, "slow": replace(TROT, stride=0.02), "fast": replace(TROT, stride=0.06), "quick": replace(TROT, frequency=2.6),
    "calm": replace(TROT, frequency=1.5), "left": replace(TROT, turn=0.1), "right": replace(TROT, turn=-0.1),
    "high": replace(TROT, lift=0.03), "low": replace(TROT, crouch=0.06), "knees": replace(TROT, knees=(-1, 1))}


@dataclass(frozen=True)
class Went:
    """speed [m/s], turning [deg/s]; fell."""

    speed: float
    turning: float
    fell: bool


@dataclass(frozen=True)
class Played:
    """A gait as it is played: commands, when its cycles begin [s], their period [s], and how long it is watched [s]."""

    commands: Commands
    begin: float
    period: float

    @property
    def seconds(self) -> float:
        """Start and cycles."""
        return self.begin + CYCLES * self.period


def gaits(model: RobotModel, count: int) -> dict[str, Played]:
    """The first `count` motions as tables for the nominal robot."""
    machine, out = GaitMachine(model), {}
    for name, shape in list(MOTIONS.items())[:count]:
        table = gait_table(machine, shape, name)
        out[name] = Played(table.commands(CYCLES), table.start_seconds, table.period)
    return out


def went(take: Take, model: RobotModel, gait: Played) -> Went:
    """Speed and turning over the whole cycles of a take, without the first."""
    m = measure(take, model, gait.begin + gait.period, gait.period, electrical=False)
    return Went(float(math.hypot(*m.velocity)), math.degrees(m.turn_rate), m.fell)


def predicted(model: RobotModel, motions: Mapping[str, Played]) -> dict[str, Went]:
    """By the workbench's own station."""
    config = SimulationConfig(time_step=1e-3, contact_period=0.0, log_period=0.01)
    takes = simulate_batch([Job(model, config, g.commands, g.seconds) for g in motions.values()], n_jobs=1)
    return {name: went(t, model, g) for (name, g), t in zip(motions.items(), takes)}


def robot(vault: Vault, k: int, folder: Path) -> RobotModel:
    """Draws the k-th robot, one that stays upright, writes its session into `folder`, and seals its effects where a run that was
    stopped has not: the same seed draws the same robot. Returns the nominal model."""
    for attempt in range(TRIES):
        rng = np.random.default_rng([vault.seed, k, attempt])
        made = puppy(rng)
        model, takes = made.model(folder), [t for t in filmed_takes(rng) if not t.predict]
        names = rng.permutation(possible(made, False))[:2]
        effects = tuple(draw(str(n), rng, made).at(float(rng.uniform())) for n in names)
        if not separable(effects[0], effects[1:]):
            continue
        shutil.rmtree(folder, ignore_errors=True)
        played = write_recordings(folder, model, replace(model, effects=effects), takes, random_camera(rng), rng)
        if all(_upright(run) for _, run, _, _ in played):
            if not vault.holds(folder.name):
                vault.seal(folder.name, {"effects.json": json.dumps([asdict(e) for e in effects])})
            return model
    raise RuntimeError(f"robot {k + 1}: none of {TRIES} draws stays upright")


def _upright(run: Rollout) -> bool:
    root = run.model.body(1).name
    _, R = run.poses(run.time[-1:], (root,))[root]
    return bool(R[0, 2, 2] > 0.8)


def hidden_robot(vault: Vault, name: str, model: RobotModel) -> RobotModel:
    """The robot as it really is."""
    told = json.loads(vault.open(name)["effects.json"])
    specs = [EffectSpec(e["effect"], tuple(e["where"]),
                        {k: tuple(v) if isinstance(v, list) else v for k, v in e["parameters"].items()}) for e in told]
    return replace(model, effects=tuple(specs))


def errors(said: Mapping[str, Went], true: Mapping[str, Went]) -> dict[str, float]:
    """Median relative error of speed, median error of turning [deg/s], and rank correlation of the speeds, over the gaits in
    which the robot did not fall; NaN where there are too few."""
    names = [n for n in true if not true[n].fell]
    if not names:
        return dict.fromkeys(("speed", "turning deg/s", "rank"), math.nan)
    speeds = [abs(said[n].speed - true[n].speed) / max(true[n].speed, SLOWEST) for n in names]
    rank = spearmanr([said[n].speed for n in names], [true[n].speed for n in names]).statistic if len(names) > 2 else math.nan
    return {"speed": float(np.median(speeds)), "turning deg/s": float(np.median([abs(said[n].turning - true[n].turning)
                                                                                for n in names])), "rank": float(rank)}


def one(vault: Vault, k: int, out: Path, count: int, tell: Callable[[str], None]) -> dict[str, Any]:
    """One robot, from its making to its score."""
    name = f"robot{k + 1:02d}"
    folder = out / "sessions" / name
    tell(f"{name}: recording")
    model = robot(vault, k, folder)
    tell(f"{name}: diagnosing")
    diagnosis = diagnose_session(load_session(folder / "session.yaml"), n_jobs=1).diagnosis
    diagnosis.save(out / DIAGNOSES / name)
    tell(f"{name}: predicting")
    motions = gaits(model, count)
    said = {who: predicted(m, motions) for who, m in (("diagnosed", diagnosis.model), ("nominal", diagnosis.nominal))}
    text = json.dumps({who: {n: vars(w) for n, w in s.items()} for who, s in said.items()}, indent=1, sort_keys=True) + "\n"
    digest = hashlib.sha256(text.encode()).hexdigest()
    (out / "results").mkdir(exist_ok=True)
    write_whole(out / "results" / f"{name}.predictions.json", text)
    write_whole(out / "results" / f"{name}.sha256", digest + "\n")
    tell(f"{name}: predictions {digest}; playing")
    real = hidden_robot(vault, name, model)
    true = {n: went(mujoco_take(real, g.commands, g.seconds), real, g) for n, g in motions.items()}
    return {"name": name, "sha256": digest, "verdict": diagnosis.verdict, "found": [f.effect for f in diagnosis.findings],
            "hidden": [e.effect for e in real.effects], "true": {n: vars(w) for n, w in true.items()},
            **{who: errors(s, true) for who, s in said.items()}}


def study(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Robot by robot; the page is written after each, so that a study that was stopped has one."""
    count, motions = (1, 3) if quick else (ROBOTS, len(MOTIONS))
    try:
        vault = Vault(out / "sealed", count, 58 if quick else None)
    except ValueError as e:
        raise InputError(None, str(e)) from None
    rows, said = list[dict[str, Any]](), ""
    for k in range(count):
        def tell(what: str, k: int = k) -> None:
            progress(what, k / count)

        rows.append(kept_result(out / "results" / f"robot{k + 1:02d}.json", partial(one, vault, k, out, motions, tell)))
        model = load_session(out / "sessions/robot01/session.yaml").model
        said = publish(out, model, _report(model, rows, vault), {"robots": rows, "seal": vault.digest()}, {})
    return said


def _report(model: RobotModel, rows: Sequence[Mapping[str, Any]], vault: Vault) -> Report:
    better = sum(r["diagnosed"]["speed"] <= 0.5 * r["nominal"]["speed"] for r in rows)
    fell = sum(math.isnan(r["nominal"]["speed"]) for r in rows)
    summary = (f"{len(rows)} of {vault.count} robots, {fell} of which fell in every gait and have no error. "
               "Diagnosed model: median error of speed "
               f"{100 * _median(rows, 'diagnosed', 'speed'):.0f} %, rank correlation {_median(rows, 'diagnosed', 'rank'):.2f}; "
               "nominal: "
               f"{100 * _median(rows, 'nominal', 'speed'):.0f} %, {_median(rows, 'nominal', 'rank'):.2f}. On {better} robots the "
               "diagnosed model has at most half the nominal one's error.")
    report = Report("Sealed predictions", summary, f"{__doc__}\n\n{PUPPY_CLAIM}", [], Provenance.of(model))
    report.add(Section("Robots", [Table(
        ["robot", "hidden", "found", "error of speed, diagnosed; nominal [%]", "turning [deg/s]", "rank", "SHA-256"],
        [[r["name"], ", ".join(r["hidden"]), ", ".join(r["found"]) or "–", _pair(r, "speed", 100), _pair(r, "turning deg/s"),
          _pair(r, "rank", digits=2), r["sha256"][:16]] for r in rows],
        "Medians over ten motions; first the diagnosed model, then the nominal one."),
        Text(f"Seal of the hidden effects: {vault.digest()}; seed drawn by {vault.drawn_by}.")]))
    return report


def _median(rows: Sequence[Mapping[str, Any]], who: str, what: str) -> float:
    """Over the robots that have a value."""
    known = [r[who][what] for r in rows if math.isfinite(r[who][what])]
    return float(np.median(known)) if known else math.nan


def _pair(r: Mapping[str, Any], what: str, factor: float = 1.0, digits: int = 1) -> str:
    return "; ".join(sign(factor * r[who][what], digits) for who in ("diagnosed", "nominal"))


if __name__ == "__main__":
    raise SystemExit(run_study("sealed_predictions", __doc__, study))
