"""A quadruped with the puppy's names and its motions, made by the trial's own generator: the same on every machine."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from studies.concealed_effects.robots import quadruped
from studies.other_engine.excitation import MotionRows, stand_motion
from studies.other_engine.firmware import read_rows
from workbench.robot import data_file

SEED = 1


@cache
def _folder() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="workbench-quadruped-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    (folder / "robot.sdf").write_text(quadruped(np.random.default_rng(SEED)).sdf, encoding="utf-8")
    stand = stand_motion(MotionRows(*read_rows(data_file("robotis_walk.csv"))), np.random.default_rng(SEED))
    (folder / "stand.csv").write_text(stand.to_csv(), encoding="utf-8")
    return folder


def quadruped_sdf() -> Path:
    """Its description."""
    return _folder() / "robot.sdf"


def stand_csv() -> Path:
    """A motion of all its joints, for a base that is held."""
    return _folder() / "stand.csv"
