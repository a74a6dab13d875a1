"""Shared parts of the studies: the body in the thesis's axes, and one line for an output folder that cannot be written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studies.common import COORDINATES, body_end, run_study
from workbench.recording.take import Take


def test_the_body_in_the_thesis_axes() -> None:
    """A body that starts turned away, goes forward, left and up, turns left by 120 deg and ends nose up, right side down."""
    left, nose_up, right_down = np.radians([120.0, 8.0, 5.0])
    start = Rotation.from_euler("Z", 0.3)
    end = Rotation.from_euler("ZYX", [0.3 + left, -nose_up, right_down])  # world z up, y left: nose up turns about -y
    half = Rotation.from_euler("Z", 0.3 + left / 2)
    quat = Rotation.concatenate([start, start, half, end]).as_quat(scalar_first=True)
    p = np.array([[0.5, 0.1, 0.2], [0.5, 0.1, 0.2], [0.6, 0.1, 0.2], [0.8, 0.25, 0.21]])
    take = Take("known", "simulation", np.array([-1.0, 0.0, 1.0, 2.0]), ("flb",), np.zeros((4, 1)), 0.0, p_WB=p, quat_WB=quat)
    found = dict(zip(COORDINATES, body_end(take, 2.0)))
    assert found == pytest.approx({"x": 30, "y": 1, "z": -15, "rx": 5, "ry": 120, "rz": 8}, abs=1e-9)


def test_whole_turns_are_counted() -> None:
    time = np.linspace(-0.1, 6.0, 62)
    quat = Rotation.from_euler("Z", 1.2 * np.maximum(time, 0)[:, None]).as_quat(scalar_first=True)
    take = Take("spin", "simulation", time, ("flb",), np.zeros((62, 1)), 0.0, p_WB=np.zeros((62, 3)), quat_WB=quat)
    assert body_end(take, 5.5)[COORDINATES.index("ry")] == pytest.approx(np.degrees(6.6), abs=0.1)


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert run_study("any", "Doc.", lambda out, quick, progress: "done", ["--quick", "--out", str(tmp_path / "file")]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
