"""Time to read a Motive CSV, against pandas on the same file."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.figure import Figure, in_turns, median_and_quartiles
from workbench.recording import read_motive, write_motive
from workbench.recording.body_track import BodyTrack
from workbench.robot import RIGID_BODIES

HEADER_LINES = 7
RATE = 120.0


def reader_against_pandas(frames: int, repeats: int, seed: int) -> Figure:
    """Wall time, as both use threads, to read a generated export of the puppy's rigid bodies at 120 Hz."""
    with tempfile.TemporaryDirectory() as folder:
        path = _write_long_recording(Path(folder) / "long.csv", frames, seed)

        def workbench() -> None:
            assert len(read_motive(path).time) == frames

        def pandas(engine: str) -> Callable[[], None]:
            def read() -> None:
                assert len(pd.read_csv(path, header=None, skiprows=HEADER_LINES, engine=engine)) == frames  # type: ignore[call-overload]
            return read

        seconds = in_turns({"workbench": workbench, "c": pandas("c"), "pyarrow": pandas("pyarrow")}, repeats, time.perf_counter)
        megabytes = path.stat().st_size / 1e6
    fastest = min(("c", "pyarrow"), key=lambda engine: float(np.median(seconds[engine])))
    value, quartiles = median_and_quartiles(seconds["workbench"] / seconds[fastest])
    return Figure(
        "motive_reader_against_pandas", "time to read a Motive CSV over that of pandas' fastest engine on the same file", value,
        quartiles, below=2.0,
        details={"frames": frames, "bodies": len(RIGID_BODIES), "megabytes": megabytes, "fastest_engine": fastest,
                 "seconds": {name: float(np.median(s)) for name, s in seconds.items()}})


def _write_long_recording(path: Path, frames: int, seed: int) -> Path:
    random = np.random.default_rng(seed)
    turn = random.standard_normal((frames, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    error = np.full(frames, 2e-4)
    bodies = {asset: BodyTrack(random.standard_normal((frames, 3)), turn, error) for asset in RIGID_BODIES}
    return write_motive(path, bodies, RATE)
