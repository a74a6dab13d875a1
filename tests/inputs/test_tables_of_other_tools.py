"""Tables of other tools: cameras that lost frames, ROS messages that name their joints in another order each time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.command import refused
from tests.inputs.corpus import swing
from workbench.files import InputError
from workbench.inspect.recognise import inspect_file
from workbench.recording import read_recording
from workbench.recording.mocap.tracks import tracks_of

RATE = 100


def _poses(folder: Path, change: Callable[[pd.DataFrame], pd.DataFrame]) -> Path:
    """A body that swings, seen for 3 s."""
    time = np.arange(3 * RATE) / RATE
    turn = 0.2 * np.sin(3 * time)
    table = {"time": time, "trunk.x": 0.05 * np.sin(2 * time), "trunk.y": 0 * time, "trunk.z": 0.2 + 0 * time,
             "trunk.qw": np.cos(turn), "trunk.qx": 0 * time, "trunk.qy": np.sin(turn), "trunk.qz": 0 * time}
    change(pd.DataFrame(table)).to_csv(folder / "poses.csv", index=False, float_format="%.6f")
    return folder / "poses.csv"


def _lost(share: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """Frames lost at random, but for the first and the last."""
    def change(table: pd.DataFrame) -> pd.DataFrame:
        kept = np.random.default_rng(0).random(len(table)) >= share
        kept[[0, -1]] = True
        jitter = np.random.default_rng(1).normal(0, 4e-4, len(table))
        return table.assign(time=table.time + jitter)[kept]
    return change


@pytest.mark.parametrize("share", [0.0, 0.02, 0.1, 0.5])
def test_frames_that_a_camera_lost_are_gaps(tmp_path: Path, share: float) -> None:
    path = _poses(tmp_path, _lost(share))
    recording = read_recording(path)
    tracks = tracks_of(recording)
    assert recording.rate == pytest.approx(RATE, rel=2e-3)
    assert len(tracks.time) == 3 * RATE
    assert np.isnan(tracks.p[0, :, 0]).mean() == pytest.approx(share, abs=0.08 if share else 0)
    np.testing.assert_allclose(tracks.p[0, :, 0], np.where(tracks.seen[0], 0.05 * np.sin(2 * tracks.time), np.nan), atol=3e-4)
    inspect_file(path)


def test_poses_without_a_steady_rate_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    times = np.cumsum(np.random.default_rng(0).exponential(0.01, 3 * RATE))
    path = _poses(tmp_path, lambda table: table.assign(time=times))
    assert "no steady rate with lost frames explains their times" in refused(capsys, "inspect", str(path))


@pytest.mark.parametrize(("change", "said"), [
    (lambda table: table.drop(columns="trunk.qw"), r"line 1: body 'trunk' has no column 'trunk\.qw'"),
    (lambda table: table.drop(columns="trunk.z"), r"line 1: body 'trunk' has no column 'trunk\.z'"),
    (lambda table: table.rename(columns={"time": "frame"}), r"line 1: expected a column 'time' \[s\], found frame, trunk\.x"),
])
def test_the_column_that_a_table_of_poses_lacks_is_named(
        tmp_path: Path, change: Callable[[pd.DataFrame], pd.DataFrame], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_recording(_poses(tmp_path, change))


def _ros(folder: Path, names: Callable[[int], tuple[str, str]]) -> Path:
    """A controller's state, whose rows name their joints in the order of `names`; the knee goes half as far as the hip."""
    time, goal, position = swing(60)
    sizes = {"hip": 1.0, "knee": 0.5}
    rows = ["%time,joint_names0,joint_names1,desired.positions0,desired.positions1,actual.positions0,actual.positions1"]
    for n, (t, g, p) in enumerate(zip(time, np.deg2rad(goal), np.deg2rad(position))):
        cells = [f"{t:.3f}", *names(n), *(f"{v * sizes.get(j, 1.0):.6g}" for v in (g, p) for j in names(n))]
        rows.append(",".join(cells))
    (folder / "state.csv").write_text("\n".join(rows) + "\n")
    return folder / "state.csv"


def test_each_row_of_a_controller_names_its_own_order(tmp_path: Path) -> None:
    straight = read_recording(_ros(tmp_path, lambda n: ("hip", "knee")))
    mixed = read_recording(_ros(tmp_path, lambda n: ("hip", "knee") if n % 3 else ("knee", "hip")))
    assert set(mixed.channels) == set(straight.channels)
    for name, values in straight.channels.items():
        np.testing.assert_allclose(mixed.channels[name], values, atol=1e-6)


@pytest.mark.parametrize(("names", "said"), [
    (lambda n: ("hip", "knee") if n != 7 else ("hip", "ankle"), "row 8 names hip, ankle; expected hip, knee"),
    (lambda n: ("hip", "hip"), "two columns of names say 'hip'")])
def test_a_row_that_names_other_joints_is_refused(tmp_path: Path, names: Callable[[int], tuple[str, str]], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_recording(_ros(tmp_path, names))
