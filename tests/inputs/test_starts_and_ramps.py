"""A motion beside a servo log begins where the log's goals do; servos that ramp their goals are told by their lag."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from workbench.motion.commands import Commands
from workbench.recording import Recording, read_recording
from workbench.recording.servo_log.started import ramp_problems, start_in_log

ROW, DWELL = 0.02, 0.24
POSES = np.array([[0, 0], [12, -8], [-5, 14], [9, 3], [-11, -6], [0, 0]], dtype=float)


def _log(folder: Path, begins: float, ramped: bool, speed: bool = False) -> Recording:
    """Two joints that stand at 0 and from `begins` on play the poses, each for a dwell; at once, or over the dwell."""
    time = np.arange(0, begins + DWELL * len(POSES) + 1, ROW)
    pose = np.clip(((time - begins) / DWELL + 1e-9).astype(int), 0, len(POSES) - 2)
    moving = time >= begins - 1e-9
    goal = np.where(moving[:, None], POSES[pose + 1], 0.0)
    if ramped:
        at = begins + DWELL * np.arange(len(POSES))
        position = np.column_stack([np.interp(time, at, of) for of in POSES.T])
    else:
        position = np.vstack([goal[:1], goal[:1], goal[:-2]])
    names = ["time", "goal.hip", "position.hip", "goal.knee", "position.knee"]
    table = np.column_stack([time, goal[:, 0], position[:, 0], goal[:, 1], position[:, 1]])
    if speed:
        names += ["speed.hip", "speed.knee"]
        table = np.column_stack([table, np.full((len(time), 2), 60.0)])
    path = folder / "log.csv"
    path.write_text("\n".join([",".join(names), *(",".join(f"{v:.6g}" for v in row) for row in table)]) + "\n")
    return read_recording(path)


def _motion() -> Commands:
    goals = np.deg2rad(POSES[1:])
    return Commands(times=DWELL * np.arange(len(goals)), joints=("hip", "knee"), goals=goals, speeds=np.zeros(goals.shape),
                    enabled=np.ones(goals.shape, dtype=bool), end=DWELL * len(goals), poses=np.arange(len(goals)))


@pytest.mark.parametrize("begins", [0.5, 1.5])
def test_a_motion_begins_where_the_goals_do(tmp_path: Path, begins: float) -> None:
    assert start_in_log(_log(tmp_path, begins, ramped=True), _motion()) == pytest.approx(begins, abs=ROW / 2)


def test_servos_that_ramp_their_goals_are_told_unless_the_log_says_how(tmp_path: Path) -> None:
    told = _log(tmp_path, 0.5, ramped=True).problems
    assert any("all 2 joints that move lag by" in p and "speed.J" in p for p in told)
    assert list(ramp_problems(_log(tmp_path, 0.5, ramped=False))) == []
    assert not any("ramp" in p for p in _log(tmp_path, 0.5, ramped=True, speed=True).problems)
