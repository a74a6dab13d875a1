"""Commands: the ramped reference, and commands from logs."""

import numpy as np
import pytest

from workbench.motion import Commands
from workbench.recording.formats.log_commands import commands_of_rows


def test_reference_ramps_from_where_it_is() -> None:
    commands = Commands(np.array([0.0, 1.0, 1.5]), ("a",), np.array([[2.0], [0.0], [5.0]]), np.array([[1.0], [4.0], [0.0]]),
                        np.ones((3, 1), dtype=bool), 2.0, np.arange(3))
    t = np.array([-1, 0, 0.5, 1.0, 1.1, 1.25, 1.4, 1.5, 9])
    assert commands.reference(t)[:, 0] == pytest.approx([0, 0, 0.5, 1.0, 0.6, 0.0, 0.0, 5.0, 5.0])


def test_log_keeps_only_what_changes() -> None:
    time = 3.0 + np.array([0, 0.1, 0.2, 0.3, 0.45])
    goals = np.array([[0, 1], [0, 1], [0.5, np.nan], [0.5, 1], [0.5, 1]])
    enabled = np.array([[1, 1], [1, 1], [1, 1], [1, 0], [1, 0]], dtype=bool)
    commands = commands_of_rows(time, ("a", "b"), goals, enabled)
    assert commands.times == pytest.approx([0, 0.2, 0.3])
    assert commands.goals.tolist() == [[0, 1], [0.5, 1], [0.5, 1]]
    assert commands.enabled.tolist() == [[True, True], [True, True], [True, False]]
    assert not commands.speeds.any()
    assert commands.end == pytest.approx(0.45)
    assert (commands.poses == -1).all()
    every = commands.reference(time - time[0])  # at once: the reference is the goal of each sample
    assert every == pytest.approx(np.where(np.isnan(goals), 1, goals))


def test_the_commands_until_a_time_end_when_the_next_would_have_come() -> None:
    commands = commands_of_rows(np.arange(5.0), ("a",), np.array([[0.0], [1], [2], [3], [3]]), np.ones((5, 1), dtype=bool))
    early = commands.until(1.5)
    assert (early.times.tolist(), early.goals[:, 0].tolist(), early.end) == ([0, 1], [0, 1], 2.0)
    assert len(early.poses) == len(early.enabled) == len(early.speeds) == 2
    np.testing.assert_array_equal(early.reference(np.linspace(-1, 1.9, 9)), commands.reference(np.linspace(-1, 1.9, 9)))
    assert commands.until(2.0).times.tolist() == [0, 1, 2]
    assert commands.until(3.0) is commands
