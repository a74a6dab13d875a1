"""Recordings that lie beside the project and are not its own; tests that need them skip where they are missing."""

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"


def shared(relative: str) -> Path:
    """A file or folder under ../shared; skips the test, with the reason, where it is missing."""
    path = SHARED / relative
    if not path.exists():
        pytest.skip(f"needs ../shared/{relative}, which lies beside the project, not in it")
    return path
