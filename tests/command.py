"""Runs the command as a user would, in this process."""

from unittest.mock import patch

import pytest

from workbench.cli.main import main


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line with which bad input is refused."""
    capsys.readouterr()
    with patch("workbench.cli.progress.QUIET", 1000.0):  # however slow the machine is
        code = main(arguments)
    captured = capsys.readouterr()
    assert code == 2, captured.err
    lines = captured.err.splitlines()
    assert len(lines) == 1, captured.err
    assert lines[0].startswith(f"workbench {arguments[0]}: error: ")
    return lines[0]


def succeeds(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> str:
    """Runs the command, checks its exit code, and returns its standard output."""
    capsys.readouterr()
    ended = main(arguments)
    captured = capsys.readouterr()
    assert ended == code, captured.err
    return captured.out
