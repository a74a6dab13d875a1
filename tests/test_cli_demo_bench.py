"""The demo and the bench do what they say, at a size that tests can afford."""

from pathlib import Path

import pytest

from tests.command import succeeds
from workbench.motion import load_motion
from workbench.recording.bench import reader_against_pandas
from workbench.robot import data_file, puppy_model
from workbench.simulation import bench
from workbench.view import demo


@pytest.mark.slow
def test_demo(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = succeeds(capsys, "demo", "--out", str(tmp_path / "demo"))
    for name, *values in demo.THESIS:
        assert name in said
        assert all(f"{v:.2f}" in said for v in values)
    assert said.count("servo law") == said.count("ideal joints") == 2
    assert said.rstrip().endswith(f"open {tmp_path}/demo/report.html")
    written = {p.relative_to(tmp_path / "demo").as_posix() for p in (tmp_path / "demo").rglob("*") if p.is_file()}
    assert {"report.html", "comparison.json", "firmware/pos.txt", "replay-walk.html", "servo_law-point.csv"} <= written
    goals = (tmp_path / "demo/firmware/pos.txt").read_text().splitlines()[2]
    assert goals == "412,482,532,722,632,552,762,642,512,412,442,492,512,442,522,"  # the contract's figures


def test_races_are_run_in_turns_and_count_the_best() -> None:
    order: list[str] = []
    bench.race(lambda: order.append("a"), lambda: order.append("b"), 3)
    assert order == ["a", "b"] * 3
    assert bench.Race(first=2.0, second=1.0).speed == 0.5


def test_the_bare_plant_walks_as_the_station_does() -> None:
    model = puppy_model()
    commands = load_motion(data_file("robotis_walk.csv"), model).commands(1)
    race = bench.station_against_bare_plant(model, commands, repeats=1)
    assert 0.2 < race.speed < 5  # the figure itself belongs to a quiet machine


def test_a_finer_step_errs_less() -> None:
    model = puppy_model()
    commands = load_motion(data_file("robotis_walk.csv"), model).commands(1)
    coarse, fine = (bench.joint_error(model, commands, step, converged=2.5e-4) for step in (2e-3, 5e-4))
    assert 0 < fine < coarse < 0.05


def test_the_reader_is_measured_on_what_it_reads() -> None:
    measured = reader_against_pandas(frames=2000, repeats=1)
    assert measured["ratio_to_fastest"] == pytest.approx(
        measured["seconds"] / min(measured["pandas_c_seconds"], measured["pandas_pyarrow_seconds"]))
