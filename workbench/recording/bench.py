"""How fast the Motive reader is, against pandas on the same file."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from workbench.recording.motive import read_motive
from workbench.recording.motive_write import write_motive
from workbench.recording.take import BodyTrack
from workbench.robot import RIGID_BODIES

HEADER_LINES = 7


def reader_against_pandas(frames: int = 72_000, repeats: int = 3) -> dict[str, float]:
    """Seconds that `read_motive` and each CSV engine of pandas take for 14 rigid bodies at 120 Hz, in turns, the best of
    `repeats`; and the ratio to the fastest engine."""
    random = np.random.default_rng(0)
    turn = random.standard_normal((frames, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    bodies = {asset: BodyTrack(random.standard_normal((frames, 3)), turn, np.full(frames, 2e-4)) for asset in RIGID_BODIES}
    best: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = write_motive(Path(folder) / "long.csv", bodies, 120.0)
        readers: dict[str, Callable[[], int]] = {
            "workbench": lambda: len(read_motive(path).time),
            "c": lambda: len(pd.read_csv(path, header=None, skiprows=HEADER_LINES, engine="c")),
            "pyarrow": lambda: len(pd.read_csv(path, header=None, skiprows=HEADER_LINES, engine="pyarrow"))}
        for _ in range(repeats):
            for name, read in readers.items():
                began = time.perf_counter()
                assert read() == frames
                best[name] = min(best.get(name, np.inf), time.perf_counter() - began)
    fastest = min(best["c"], best["pyarrow"])
    return {"seconds": best["workbench"], "pandas_c_seconds": best["c"], "pandas_pyarrow_seconds": best["pyarrow"],
            "ratio_to_fastest": best["workbench"] / fastest}
