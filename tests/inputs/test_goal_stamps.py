"""Goals that were sent between rows: recognised by their uneven dwells, and set to the times at which they were sent."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.inputs.corpus import joint_log
from workbench.recording import Recording, read_recording
from workbench.recording.servo_log.goal_stamps import STAMPS, sent_goals

ROW = 0.02


def _log(folder: Path, period: float, begins: float, poses: int = 30) -> tuple[Recording, np.ndarray]:
    """Goals sent at a period from `begins` on, in a log of rows at 50 Hz; and when they were sent."""
    rng = np.random.default_rng(3)
    sent = begins + period * np.arange(poses)
    goals = rng.uniform(-20, 20, poses)
    time = np.arange(0, sent[-1] + 0.5, ROW)
    stands = np.searchsorted(sent, time + 1e-9, side="right") - 1
    goal = np.where(stands >= 0, goals[np.maximum(stands, 0)], 0.0)
    position = np.interp(time - 0.06, time, goal)
    path = folder / "log.csv"
    path.write_text(joint_log(time, goal, np.round(position / 0.24) * 0.24))
    return read_recording(path), sent


@pytest.mark.parametrize(("period", "begins"), [(0.25, 1.0), (0.25, 1.013), (0.21, 0.5), (0.3333, 0.777), (0.11, 0.4)])
def test_goals_are_set_to_the_times_at_which_they_were_sent(tmp_path: Path, period: float, begins: float) -> None:
    log, sent = _log(tmp_path, period, begins)
    assert log.commands is not None
    late = log.commands.times[1:] - sent
    within = float(log.metadata[STAMPS])
    assert len(log.commands.times) == len(sent) + 1
    assert within <= ROW / 2 + 1e-9
    assert np.ptp(late) < 0.002
    assert np.abs(late).max() <= within / 2 + 0.002
    assert any("were stamped with the next row" in note for note in log.notes)


def test_goals_that_rows_hold_are_left_as_they_are(tmp_path: Path) -> None:
    log, sent = _log(tmp_path, 0.24, 1.0)
    assert log.commands is not None
    np.testing.assert_allclose(log.commands.times[1:], sent)
    assert STAMPS not in log.metadata


@pytest.mark.parametrize("rows", [np.cumsum([12, 9, 30, 14, 17, 11, 12, 25, 13]), np.arange(9) * 1.0, np.array([3.0, 9.0])])
def test_goals_without_a_period_tell_no_time(rows: np.ndarray) -> None:
    assert sent_goals(rows.astype(float)) is None
