"""Modules that a command without a simulation loads: importing everything would take most of its time."""

import subprocess
import sys
from pathlib import Path

import pytest

from workbench.robot import data_file, puppy_model

SLOW = ("matplotlib", "numba", "scipy", "joblib")
"""Packages that take tenths of a second to import."""
LOADED = "import sys; from workbench.cli.main import main; main(sys.argv[1:]); print('loaded', *sys.modules)"


@pytest.mark.parametrize("file", [Path(puppy_model().path), data_file("tutorial_arm/takes/slow.csv")], ids=["robot", "log"])
def test_inspect_imports_nothing_slow_that_it_does_not_use(file: Path) -> None:
    run = subprocess.run([sys.executable, "-c", LOADED, "inspect", str(file)], capture_output=True, text=True, check=True)
    loaded = run.stdout.splitlines()[-1].split()
    assert loaded[0] == "loaded"
    assert not set(SLOW) & set(loaded)
