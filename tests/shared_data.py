"""Recordings that lie beside the project and are not its own; tests that need them skip where they are missing. Practice
sessions are made here instead, shorter, by the project's own second engine."""

import atexit
import shutil
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

from studies.concealed_effects.robots import quadruped
from studies.other_engine.excitation import MotionRows
from studies.other_engine.firmware import read_rows
from studies.other_engine.make_session import TakePlan, plan_takes, random_camera, record, servo_yaml, session_entry
from studies.other_engine.motive_file import write_motive_csv
from workbench.robot import EffectSpec, Ground, data_file

SHARED = Path(__file__).resolve().parents[2] / "shared"
HIDDEN = {
    "p0_nothing_hidden": (), "p1_backlash": (EffectSpec("backlash", ("flm",), {"gap": 3.0}),),
    "p2_slippery_foot": (EffectSpec("foot_friction", ("brb",), {"friction": 0.15}),),
    "p3_payload": (EffectSpec("payload", ("body_link",), {"mass": 0.25, "position": (-0.02, 0.03, 0.05)}),),
    "p4_late_firmware": (EffectSpec("timing_drift", (), {"per_pose": 0.006}),),
    "p5_sagging_supply": (EffectSpec("supply_voltage", (), {"voltage": 8.4}),),
    "p6_stiff_gearbox": (EffectSpec("coulomb_friction", ("frm",), {"torque": 0.18}),),
    "p7_two_at_once": (EffectSpec("servo_gain", ("brb",), {"ratio": 0.45}), EffectSpec("ground_friction", (), {"friction": 0.3}))}
"""What is hidden in the practice sessions."""
FLOOR = Ground(friction=0.6, stiffness=1e5, dissipation=20.0)
LASTS = {"stand": 4.6, "sway": 2.6, "hidden_stand": 3.6}
"""After what a take's motion ends there [s]."""
CYCLES = {"walk": 6, "hidden_walk": 4}


def shared(relative: str) -> Path:
    """A file or folder under ../shared; skips the test, with the reason, where it is missing."""
    path = SHARED / relative
    if not path.exists():
        pytest.skip(f"needs ../shared/{relative}, which lies beside the project, not in it")
    return path


def practice(name: str) -> Path:
    """The folder of a practice session; where ../shared is missing, one like it that is made here."""
    return SHARED / "practice" / name if (SHARED / "practice" / name).exists() else _made(name)


@cache
def _made(name: str) -> Path:
    """A quadruped with the puppy's names, filmed by the second engine with what is hidden in it; laid out as those are."""
    folder = Path(tempfile.mkdtemp(prefix=f"{name}."))
    atexit.register(shutil.rmtree, folder, True)
    rng = np.random.default_rng(1)
    for part in ("motions", "takes", "predict", "answer"):
        (folder / part).mkdir()
    model = replace(quadruped(rng), ground=FLOOR).model(folder / "robot.sdf")
    (folder / "servo.yaml").write_text(servo_yaml(model))
    camera, takes, predict = random_camera(rng), [], []
    for plan in map(_shorter, plan_takes(MotionRows(*read_rows(data_file("robotis_walk.csv"))), rng)):
        _, capture, _ = record(model.with_effects(HIDDEN[name]), plan, camera, rng)
        motion = f"{'predict' if plan.predict else 'motions'}/{plan.name}.csv"
        (folder / motion).write_text(plan.motion.to_csv())
        entry = {"name": plan.name, "motion": motion, "cycles": plan.cycles, "base": plan.base}
        if plan.predict:
            start = capture.cut(int(capture.starts_at * capture.rate) - 2)
            write_motive_csv(folder / f"predict/{plan.name}_start.csv", start, plan.name, frames_in_take=len(capture))
            write_motive_csv(folder / f"answer/{plan.name}.csv", capture, plan.name)
            predict.append(entry | {"start": f"predict/{plan.name}_start.csv", "starts_at": capture.starts_at,
                                    "frames": len(capture)})
        else:
            write_motive_csv(folder / f"takes/{plan.name}.csv", capture, plan.name)
            takes.append(entry | {"recording": f"takes/{plan.name}.csv"})
    session = session_entry(model, "robot.sdf", "servo.yaml") | {"takes": takes, "predict": predict}
    (folder / "session.yaml").write_text(yaml.safe_dump(session, sort_keys=False))
    return folder


def _shorter(plan: TakePlan) -> TakePlan:
    """The beginning of its motion, or fewer cycles."""
    rows = plan.motion
    kept = rows.times <= LASTS.get(plan.name, np.inf)
    return TakePlan(plan.name, MotionRows(rows.joints, rows.times[kept], rows.angles[kept]), CYCLES.get(plan.name, plan.cycles),
                    plan.base, plan.predict)
