"""What every study shares: its command line, the body's way in the thesis's axes, the thesis's numbers, and its page."""

from __future__ import annotations

import argparse
import io
import json
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from workbench.cli.progress import Progress
from workbench.files import InputError
from workbench.files.reading import read_text, write_together, write_whole
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.types import Array
from workbench.view.figures.style import in_house_style
from workbench.view.report.page import Report

T = TypeVar("T")
ROOT = Path(__file__).resolve().parents[1]

COORDINATES = ("x", "y", "z", "rx", "ry", "rz")
"""Of the body in the thesis's axes: x forward, y up, z right [cm], and the rotations about them [deg]; ry is the heading, left
positive, rx the right side down, rz the nose up."""
REAL = (37.01, -0.18, -0.10)
"""Where the real robot was after six seconds of the ROBOTIS walk [cm], x, y, z (thesis, 7.2)."""

_TO_THESIS = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
Study = Callable[[Path, bool, Callable[[str, float | None], None]], str]


def body_track(take: Take, times: Array) -> Array:
    """COORDINATES of the body (M, 6) at `times` (M,) [s] since the first command.

    Position and heading count from time 0, where the robot still stands; the tilts are those of the link. The rotation is taken
    apart as heading, then pitch, then roll (intrinsic Y Z X), which has no singularity at any heading; for the tilts of a walk
    that is the thesis's XYZ to a few hundredths of a degree.
    """
    assert not np.isnan(take.starts_at)
    seen = take.resampled(np.concatenate([[0.0], times]) + take.starts_at)
    assert seen.p_WB is not None
    assert seen.quat_WB is not None
    p = 100 * (seen.p_WB - seen.p_WB[0]) @ _TO_THESIS.T
    R = _TO_THESIS @ Rotation.from_quat(seen.quat_WB, scalar_first=True).as_matrix() @ _TO_THESIS.T
    heading, pitch, roll = np.degrees(np.unwrap(Rotation.from_matrix(R).as_euler("YZX"), axis=0)).T
    return np.column_stack([p, roll, heading - heading[0], pitch])[1:]


def kept_result(path: Path, make: Callable[[], T]) -> T:
    """The content of a JSON file, computed and written at the first call, so that an interrupted study resumes."""
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps(make(), indent=1) + "\n")
    result: T = json.loads(read_text(path))
    return result


def body_end(take: Take, seconds: float) -> Array:
    """COORDINATES (6,) of the body so long after the first command; whole turns on the way are counted."""
    return np.asarray(body_track(take, np.linspace(0.0, seconds, 2 + int(seconds / 0.02)))[-1])


def sign(value: float, digits: int = 1) -> str:
    """A number as text with a true minus."""
    text = f"{value:.{digits}f}"
    return ("0" + text[2:] if float(text) == 0 and text.startswith("-") else text).replace("-", "−")


@in_house_style
def png(figure: Figure) -> bytes:
    """A figure's PNG."""
    out = io.BytesIO()
    figure.savefig(out, format="png", metadata={"Software": None})
    return out.getvalue()


def publish(out: Path, model: RobotModel, report: Report, numbers: Mapping[str, object], figures: Mapping[str, Figure]) -> str:
    """index.html, numbers.json and the figures as PNG: all of them, or none. Returns the paths.

    InputError if the model's file has changed since `model` was made: its runs are then of two robots.
    """
    if replace(model).sha256 != model.sha256:
        raise InputError(model.description, "the model changed while the study ran; run it again")
    numbers = {"model_sha256": model.sha256, **numbers}
    contents: dict[str, str | bytes] = {"index.html": report.html(), "numbers.json": json.dumps(numbers, indent=1) + "\n"}
    contents |= {f"{name}.png": png(figure) for name, figure in figures.items()}
    write_together(out, contents)
    return f"wrote {out}: {', '.join(contents)}"


def run_study(name: str, doc: str | None, study: Study, argv: list[str] | None = None) -> int:
    """`python -m studies.NAME [--out DIR] [--quick]`: 0, or 2 with one line on stderr where an input is bad."""
    parser = argparse.ArgumentParser(prog=f"python -m studies.{name}", description=(doc or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "runs/studies" / name, metavar="DIR", help="default: %(default)s")
    parser.add_argument("--quick", action="store_true", help="less of it, in seconds: to see that it runs, not for its numbers")
    arguments = parser.parse_args(argv)
    began = time.monotonic()
    try:
        arguments.out.mkdir(parents=True, exist_ok=True)  # found out before the long work, not after
    except OSError as e:
        print(f"studies.{name}: {arguments.out}: cannot be written ({e.strerror})", file=sys.stderr)
        return 2
    try:
        with Progress(f"study {name}") as progress:
            said = study(arguments.out, arguments.quick, progress)
    except InputError as e:
        print(f"studies.{name}: {e}", file=sys.stderr)
        return 2
    print(f"{said} ({time.monotonic() - began:.0f} s)")
    return 0
