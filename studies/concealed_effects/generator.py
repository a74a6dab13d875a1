"""Makes the trial's sessions: a user's files in OUT/sessions/NAME, which reveal nothing of the hidden effects, and the truth in
OUT/sealed. An interrupted run continues."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Collection
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import yaml

from studies.concealed_effects.conceal import Bench, NoneFoundError, conceal
from studies.concealed_effects.plan import MAKERS, SessionPlan, dealt_again, plan_sessions
from studies.concealed_effects.sealed import Vault
from studies.concealed_effects.takes import LogPlan, filmed_takes, is_logged, log_csv, log_rows, logged_takes, play_log
from studies.concealed_effects.visible import FINE
from studies.other_engine.hidden import OUTSIDE
from studies.other_engine.make_session import TakePlan, random_camera, record, servo_yaml, session_entry
from studies.other_engine.motive_file import motive_csv
from workbench.robot import EffectSpec, RobotModel

Files = dict[str, str]
REDRAWS, STUBBORN = 100, 12
"""Robots that are drawn for a session, and after how many of them in vain other effects are dealt."""


def generate(out: Path, vault: Vault, workers: int = 1, say: Callable[[str], None] = print, done: Collection[str] = ()) -> None:
    """All sessions that are not there yet, on so many processes; `done`: those that nobody needs any more."""
    missing = [p for p in plan_sessions(vault.seed, vault.count)
               if p.name not in done and not (vault.holds(p.name) and (out / "sessions" / p.name).exists())]
    made = vault.count - len(missing)
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        for making in as_completed([pool.submit(make, out, vault, plan) for plan in missing]):
            name, seconds = making.result()
            made += 1
            say(f"made {name} in {seconds:.0f} s ({made} of {vault.count})")


def make(out: Path, vault: Vault, plan: SessionPlan) -> tuple[str, float]:
    """One session: its truth sealed first, then its folder put in place, whole. Its name, and seconds that it took."""
    began = time.monotonic()
    (out / "sessions").mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out, prefix=".making.") as temporary:
        folder = Path(temporary) / plan.name
        folder.mkdir()
        shown, hidden = write_session(folder, plan)
        if not vault.holds(plan.name):
            vault.seal(plan.name, hidden)
        for name, text in shown.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
        target = out / "sessions" / plan.name
        shutil.rmtree(target, ignore_errors=True)
        os.replace(folder, target)
    return plan.name, time.monotonic() - began


def is_what_was_sealed(vault: Vault, name: str) -> bool:
    """Whether the seed makes, again, the truth that was committed to; for whoever doubts it, on the same kind of machine."""
    plan = next((p for p in plan_sessions(vault.seed, vault.count) if p.name == name), None)
    if plan is None or name not in vault.commitments:
        raise ValueError(f"{name}: expected one of the {len(vault.commitments)} sessions that are sealed")
    with tempfile.TemporaryDirectory() as folder:
        packed = vault.packed(name, write_session(Path(folder), plan)[1])
    return hashlib.sha256(packed).hexdigest() == vault.commitments[name]


def write_session(folder: Path, plan: SessionPlan) -> tuple[Files, Files]:
    """A user's files, and the sealed ones, by name. `folder` gets the robot's SDF."""
    rng = np.random.default_rng(plan.seed)
    for n in range(REDRAWS):  # robots that do not walk as drawn, and hiding places that do not exist, are drawn again
        if n and n % STUBBORN == 0:
            plan = dealt_again(plan, rng)
        robot = MAKERS[plan.robot](rng)
        (folder / "robot.sdf").unlink(missing_ok=True)
        model = robot.model(folder / "robot.sdf")
        takes: list[TakePlan] | list[LogPlan] = logged_takes(model, rng) if is_logged(robot) else filmed_takes(rng)
        bench = Bench(robot, model, [t for t in takes if not t.predict])  # type: ignore[arg-type]
        if not bench.sound:
            continue
        try:
            effects = conceal(bench, plan.effects, plan.masked, rng)
            break
        except NoneFoundError:
            continue
    else:
        raise RuntimeError(f"{plan.name}: none of {REDRAWS} robots can hide the drawn effects")
    hidden = bench.with_effects(effects)
    session = session_entry(model, "robot.sdf" if robot.sdf else model.description, "servo.yaml")
    shown, sealed = {"servo.yaml": servo_yaml(model)}, Files()
    record_all: Callable[..., tuple[dict[str, object], dict[str, object]]] = _logs if is_logged(robot) else _films
    entries, facts = record_all(model, hidden, takes, rng, shown, sealed)
    if is_logged(robot):
        session.pop("ground")
        session["robot"].pop("rigid_bodies")  # type: ignore[attr-defined]
        session["robot"]["bus_ids"] = dict(robot.bus_ids)  # type: ignore[index]
    shown["session.yaml"] = yaml.safe_dump(session | entries, sort_keys=False)
    truth = {"name": plan.name, "robot": robot.kind, "effects": [_truth_of(e) for e in effects], "masked": plan.masked,
             "outside": [e.effect for e in effects if e.effect in OUTSIDE], "takes": facts}
    sealed["truth.json"] = json.dumps(truth, indent=1) + "\n"
    return shown, sealed


def _truth_of(effect: EffectSpec) -> dict[str, object]:
    return json.loads(json.dumps(asdict(effect)))  # type: ignore[no-any-return]


def _films(model: RobotModel, hidden: RobotModel, takes: list[TakePlan], rng: np.random.Generator, shown: Files,
           sealed: Files) -> tuple[dict[str, object], dict[str, object]]:
    camera = random_camera(rng)
    learn: list[dict[str, object]] = []
    predict: list[dict[str, object]] = []
    facts: dict[str, object] = {}
    for plan in takes:
        entry: dict[str, object] = {"name": plan.name, "motion": f"{'predict' if plan.predict else 'motions'}/{plan.name}.csv",
                                    "cycles": plan.cycles}
        shown[str(entry["motion"])] = plan.motion.to_csv()
        state = rng.bit_generator.state
        run, capture, _ = record(hidden, plan, camera, rng, FINE)
        ends = run.poses(np.array([0.0, run.time[-1]]), (model.base,))[model.base][0]
        facts[plan.name] = {"lead": capture.starts_at, "travel": float(np.linalg.norm((ends[1] - ends[0])[:2]))}
        if plan.predict:
            after, rng.bit_generator.state = rng.bit_generator.state, state  # seen from where the other was
            _, _, nominal = record(model, plan, camera, rng, FINE)
            rng.bit_generator.state = after
            start = capture.cut(int(capture.starts_at * capture.rate) - 2)
            shown[f"predict/{plan.name}_start.csv"] = motive_csv(start, plan.name, frames_in_take=len(capture))
            sealed[f"{plan.name}.csv"] = motive_csv(capture, plan.name)
            sealed[f"{plan.name}.nominal.csv"] = motive_csv(nominal, plan.name)
            predict.append(entry | {"start": f"predict/{plan.name}_start.csv", "starts_at": capture.starts_at,
                                    "frames": len(capture), "base": plan.base})
        else:
            shown[f"takes/{plan.name}.csv"] = motive_csv(capture, plan.name)
            learn.append(entry | {"recording": f"takes/{plan.name}.csv", "base": plan.base})
    return {"takes": learn, "predict": predict}, facts


def _logs(model: RobotModel, hidden: RobotModel, takes: list[LogPlan], rng: np.random.Generator, shown: Files,
          sealed: Files) -> tuple[dict[str, object], dict[str, object]]:
    learn: list[dict[str, object]] = []
    predict: list[dict[str, object]] = []
    facts: dict[str, object] = {}
    for plan in takes:
        chance = int(rng.integers(2**31))
        position, velocity = log_rows(play_log(hidden, plan, FINE, chance), plan, rng)
        facts[plan.name] = {"lead": 0.0}
        if plan.predict:
            nominal, _ = log_rows(play_log(model, plan, FINE, chance), plan, np.random.default_rng(0))
            shown[f"predict/{plan.name}.csv"] = log_csv(plan, position, velocity, start_only=True)
            sealed[f"{plan.name}.csv"] = log_csv(plan, position)
            sealed[f"{plan.name}.nominal.csv"] = log_csv(plan, nominal)
            predict.append({"name": plan.name, "commands": f"predict/{plan.name}.csv", "base": "fixed"})
        else:
            shown[f"takes/{plan.name}.csv"] = log_csv(plan, position)
            learn.append({"name": plan.name, "recording": f"takes/{plan.name}.csv", "base": "fixed"})
    return {"takes": learn, "predict": predict}, facts
