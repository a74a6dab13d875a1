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

from studies.concealed_effects.robots import quadruped
from studies.other_engine.excitation import MotionRows
from studies.other_engine.firmware import read_rows
from studies.other_engine.make_session import TakePlan, plan_takes, random_camera, write_recordings
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
    made = Path(tempfile.mkdtemp(prefix=f"{name}."))
    atexit.register(shutil.rmtree, made, True)
    rng = np.random.default_rng(1)
    model = replace(quadruped(rng), ground=FLOOR).model(made / "drawn.sdf")
    camera = random_camera(rng)
    plans = [_shorter(p) for p in plan_takes(MotionRows(*read_rows(data_file("robotis_walk.csv"))), rng)]
    write_recordings(made / name, model, model.with_effects(HIDDEN[name]), plans, camera, rng)
    return made / name


def _shorter(plan: TakePlan) -> TakePlan:
    """The beginning of its motion, or fewer cycles."""
    rows = plan.motion
    kept = rows.times <= LASTS.get(plan.name, np.inf)
    return TakePlan(plan.name, MotionRows(rows.joints, rows.times[kept], rows.angles[kept]), CYCLES.get(plan.name, plan.cycles),
                    plan.base, plan.predict)
