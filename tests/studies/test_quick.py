"""Every study's quick form runs from end to end, as its page says that it does."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.shared_data import shared

ROOT = Path(__file__).parents[2]
STUDIES = sorted(name for path in (ROOT / "studies").rglob("*.py")
                 for name in re.findall(r'run_study\("(\w+)"', path.read_text(encoding="utf-8")))
RECORDINGS = {"evidence": "data/xl330", "sts3215": "data/sts3215", "xl330": "data/xl330"}
"""Recordings that are not distributed, by the study that needs them."""
LEARNERS = {"learned_gait": "stable_baselines3"}
"""Packages that [dev] does not install, by the study that needs them."""


def test_studies_are_found():
    assert {"evidence", "next_experiment", "puppy_gap"} <= set(STUDIES)


@pytest.mark.slow
@pytest.mark.parametrize("name", STUDIES)
def test_a_study_runs(name: str, tmp_path: Path) -> None:
    if name in LEARNERS:
        pytest.importorskip(LEARNERS[name], reason="needs the extra [learn]")
    if name in RECORDINGS:
        shared(RECORDINGS[name])
    run = subprocess.run([sys.executable, "-m", f"studies.{name}", "--quick", "--out", str(tmp_path)], cwd=ROOT, check=False,
                         capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert run.returncode == 0, run.stderr[-2000:]
    assert any(tmp_path.iterdir())
