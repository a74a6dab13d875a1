"""The fuzzers' kept corpus is run again; the campaigns themselves, and the mutants, belong to `make prove`."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "firmware/fuzz"))

from campaign import kept_inputs

from tests.firmware.native import FIRMWARE

CAMPAIGN = [sys.executable, str(FIRMWARE / "fuzz/campaign.py")]
needs_clang = pytest.mark.skipif(shutil.which("clang") is None, reason="needs clang")


@needs_clang
@pytest.mark.parametrize("target", ["robot", "table", "answer"])
def test_kept_inputs_and_seeds_still_run_clean(target: str, tmp_path: Path) -> None:
    table = f'-DTABLE_FILE="{FIRMWARE / "robotis_walk.table"}"'
    sources = [FIRMWARE / f"fuzz/fuzz_{target}.c", *sorted(FIRMWARE.glob("core/*.c")), FIRMWARE / "tests/sim.c"]
    flags = ["-std=c11", "-O1", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all"]
    subprocess.run(["clang", *flags, table, *map(str, sources), "-o", str(tmp_path / "fuzzer")], check=True)
    inputs = kept_inputs(target, tmp_path / "inputs")
    assert 3 <= len(inputs) < 400
    run = subprocess.run([str(tmp_path / "fuzzer"), *map(str, inputs)], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr[-2000:]


def campaign(*arguments: str) -> str:
    run = subprocess.run([*CAMPAIGN, *arguments], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout


@needs_clang
@pytest.mark.slow
def test_ten_planted_faults_are_found_within_a_minute_each() -> None:
    assert "10 of 10" in campaign("plant", "--seconds", "60")


@needs_clang
@pytest.mark.slow
def test_ten_minutes_of_fuzzing_find_nothing() -> None:
    assert campaign("clean", "--seconds", "600").count("clean in") == 3


@pytest.mark.skipif(shutil.which("gcov") is None, reason="needs gcov")
@pytest.mark.slow
def test_the_corpus_reaches_95_percent_of_the_branches() -> None:
    campaign("cover")


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
@pytest.mark.slow
def test_47_of_50_mutants_are_noticed() -> None:
    run = subprocess.run([sys.executable, str(FIRMWARE / "tests/mutants.py")], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout
