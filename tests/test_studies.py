"""The studies: what they measure with, on cases with known answers, and each one run from end to end, quickly."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studies import inputs
from studies.common import COORDINATES, body_end, run_study
from studies.filters.__main__ import filters
from studies.solvers_and_steps import solvers_and_steps
from studies.thesis_runs.__main__ import thesis_runs
from studies.thesis_runs.findings import findings
from studies.thesis_runs.runs import ANIMATION, SIMULATED, SMOOTH, Run
from studies.walk_spread import runs as spread_runs
from studies.walk_spread.__main__ import walk_spread
from studies.walk_spread.analysis import decompose
from studies.walk_spread.design import MASS_RANGE, Case, make_design, mass_factors, with_masses
from workbench.motion import load_motion
from workbench.recording.take import Take
from workbench.robot import BUS_IDS, data_file, puppy_model
from workbench.simulation import SimulationConfig

PUPPY = puppy_model().description


def test_the_body_in_the_thesis_axes() -> None:
    """A body that starts turned away, goes forward, left and up, turns left by 120 deg and ends nose up, right side down."""
    left, nose_up, right_down = np.radians([120.0, 8.0, 5.0])
    start = Rotation.from_euler("Z", 0.3)
    end = Rotation.from_euler("ZYX", [0.3 + left, -nose_up, right_down])  # world z up, y left: nose up turns about -y
    half = Rotation.from_euler("Z", 0.3 + left / 2)
    quat = Rotation.concatenate([start, start, half, end]).as_quat(scalar_first=True)
    p = np.array([[0.5, 0.1, 0.2], [0.5, 0.1, 0.2], [0.6, 0.1, 0.2], [0.8, 0.25, 0.21]])
    take = Take("known", "simulation", np.array([-1.0, 0.0, 1.0, 2.0]), ("flb",), np.zeros((4, 1)), 0.0, p_WB=p, quat_WB=quat)
    found = dict(zip(COORDINATES, body_end(take, 2.0)))
    assert found == pytest.approx({"x": 30, "y": 1, "z": -15, "rx": 5, "ry": 120, "rz": 8}, abs=1e-9)


def test_whole_turns_are_counted() -> None:
    time = np.linspace(-0.1, 6.0, 62)
    quat = Rotation.from_euler("Z", 1.2 * np.maximum(time, 0)[:, None]).as_quat(scalar_first=True)
    take = Take("spin", "simulation", time, ("flb",), np.zeros((62, 1)), 0.0, p_WB=np.zeros((62, 3)), quat_WB=quat)
    assert body_end(take, 5.5)[COORDINATES.index("ry")] == pytest.approx(np.degrees(6.6), abs=0.1)


def test_variance_is_shared_out_as_it_was_put_in() -> None:
    """A main effect, a pair's effect and noise of known variances."""
    rng = np.random.default_rng(1)
    a = np.array([-1.0, 0.0, 1.0]) * math.sqrt(3 / 2)  # variance 1
    pair = np.outer([1.0, -1.0], [1.0, -1.0])  # no mean along either
    values = 3.0 * a[:, None, None] + 2.0 * pair[None] + 7.0
    shares = decompose(values, ("a", "b", "c"))
    assert shares.main == pytest.approx({"a": 9 / 13, "b": 0, "c": 0})
    assert shares.pairs[("b", "c")] == pytest.approx(4 / 13)
    assert shares.rest == pytest.approx(0)
    assert shares.std == pytest.approx(math.sqrt(13))
    noise = decompose(rng.normal(size=(20, 20, 20)), ("a", "b", "c"))
    assert noise.rest == pytest.approx(19**3 / (20**3 - 1), abs=0.02)
    assert sum(noise.main.values()) + sum(noise.pairs.values()) + noise.rest == pytest.approx(1)


@pytest.mark.parametrize(("masses", "low", "high"), [("-15 %", 0.85, 0.85), ("as built", 1, 1), ("seed 1", *MASS_RANGE)])
def test_changed_masses_are_in_the_file(masses: str, low: float, high: float, tmp_path: Path) -> None:
    puppy, changed = puppy_model(), puppy_model(description=with_masses(PUPPY, masses, tmp_path))
    ratio = np.array([changed.kinematics.masses[link] / m for link, m in puppy.kinematics.masses.items() if m > 0])
    assert low - 1e-6 <= ratio.min() <= ratio.max() <= high + 1e-6
    if masses == "seed 1":
        assert np.ptp(ratio) > 0.1
        assert np.array_equal(mass_factors(masses, 5), mass_factors(masses, 5))
    same = "<ixz>", "<pose>"
    before, after = Path(puppy.path).read_text(), Path(changed.path).read_text()
    assert [before.count(tag) for tag in same] == [after.count(tag) for tag in same]


def test_speeds_by_name_give_a_servo_anothers_speed() -> None:
    commands = load_motion(data_file("robotis_walk.csv")).commands()
    mixed = spread_runs.speeds_by_name(commands)
    first_id = min(BUS_IDS, key=lambda j: BUS_IDS[j])  # tail, ID 1, gets the speed of the first name, blb
    assert np.array_equal(mixed.speeds[:, mixed.column(first_id)], commands.speeds[:, commands.column("blb")])
    assert np.array_equal(np.sort(mixed.speeds, axis=1), np.sort(commands.speeds, axis=1))
    assert np.array_equal(mixed.goals, commands.goals)


def test_a_design_names_its_inputs_and_every_run_once() -> None:
    design, quick = make_design(PUPPY, False), make_design(PUPPY, True)
    assert design.sha256 == make_design(PUPPY, False).sha256 != quick.sha256
    assert replace(design, seconds=5.0).sha256 != design.sha256
    assert replace(design, inputs_sha256={**design.inputs_sha256, "model": "another"}).sha256 != design.sha256
    assert len(set(design.cases)) == len(design.cases) == json.loads(design.text)["runs"]
    crossed = [c for c in design.cases if not c.excursion]
    assert {c.friction for c in crossed} == {0.5, 0.6, 0.7}
    assert len({c.step for c in crossed}) == 3
    assert {c.contact for c in crossed} == {"point", "hydroelastic"}


def test_runs_that_were_made_are_not_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All but one of a design's runs are kept: only that one is made, and the kept numbers stay."""
    design = make_design(PUPPY, True)
    missing, *kept = design.cases
    made: list[str] = []

    def simulate(jobs: list[Any], progress: Callable[[int, int], None]) -> list[Take]:
        made.extend(job.config.drive for job in jobs)
        p = np.zeros((3, 3))
        quat = np.tile([1.0, 0, 0, 0], (3, 1))
        time = np.array([-0.1, 0, 1.0])
        return [Take("still", "simulation", time, ("flb",), np.zeros((3, 1)), 0.0, p_WB=p, quat_WB=quat)] * len(jobs)

    monkeypatch.setattr(spread_runs, "simulate_batch", simulate)
    spread_runs.save_runs(tmp_path / f"runs-{design.sha256[:12]}.csv", {c: np.arange(7.0) + i for i, c in enumerate(kept)})
    ends = spread_runs.run_design(design, puppy_model(), tmp_path, lambda what, done: None)
    assert made == [missing.drive]
    assert list(ends) == design.cases
    assert ends[missing][:6] == pytest.approx(np.zeros(6))
    assert ends[kept[1]] == pytest.approx(np.arange(7.0) + 1)
    assert set(spread_runs.load_runs(tmp_path / f"runs-{design.sha256[:12]}.csv", design)) == set(design.cases)


def test_friction_and_supply_reach_the_run() -> None:
    case = Case("servo", "as built", 0.7, 1e-3, "point")
    assert spread_runs.job_of(puppy_model(), case, 0.1).model.ground.friction == 0.7
    assert spread_runs.job_of(puppy_model(), replace(case, excursion="friction 0.3"), 0.1).model.ground.friction == 0.3
    assert spread_runs.job_of(puppy_model(), replace(case, excursion="supply 9 V"), 0.1).model.servo("flm").supply_voltage == 9


def test_an_ideal_reference_is_as_fine_as_the_step() -> None:
    path = inputs.robotis()[0]
    model = puppy_model()
    for step in (1e-3, 2.5e-4):
        trajectory = inputs.ideal_job(model, SimulationConfig(time_step=step, drive="ideal"), path, 0.1).trajectory
        assert trajectory is not None
        assert np.diff(trajectory[0]) == pytest.approx(step)
        at = np.searchsorted(path.time, trajectory[0][8] - 1e-9)
        assert trajectory[1][8, model.joints.index("flb")] == pytest.approx(path.q[at, path.column("flb")], abs=1e-6)


@pytest.mark.parametrize(("x", "heading", "floor", "said"), [
    (32.0, 5.0, 1.0, ()), (2.0, 5.0, 1.0, ("miss that by −30.7 and −30.4 cm",)), (2.0, 5.0, 40.0, ()),
    (32.0, 60.0, 1.0, ("turn,",)), (2.0, 60.0, 1.0, ("turn and miss",))])
def test_a_walk_unlike_the_thesis_is_named_beyond_the_floor_only(x: float, heading: float, floor: float,
                                                               said: tuple[str, ...]) -> None:
    track = np.array([[x, 0, 0, 0, heading, 0.0]])
    runs = [Run(name, np.zeros(1), track, (track + floor,), track) for name in (*SIMULATED, SMOOTH)]
    text = " ".join(here for _, here in findings([Run(ANIMATION, np.zeros(1), track), *runs]))
    assert ("is not as in the thesis" in text) == bool(said)
    assert all(words in text for words in said)


@pytest.mark.parametrize(("name", "study"), [("thesis_runs", thesis_runs), ("solvers_and_steps", solvers_and_steps),
                                             ("walk_spread", walk_spread)])
def test_a_study_from_end_to_end(name: str, study: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_study(name, study.__doc__, study, ["--quick", "--out", str(tmp_path)]) == 0
    assert str(tmp_path) in capsys.readouterr().out
    page = (tmp_path / "index.html").read_text()
    assert "NaN" not in page
    assert ">nan" not in page
    content = json.loads((tmp_path / "numbers.json").read_text())
    assert content["model_sha256"] == puppy_model().sha256
    assert len(_numbers(content)) > 20
    assert any(path.stat().st_size > 10_000 for path in tmp_path.glob("*.png"))
    match name:
        case "thesis_runs":
            runs = content["runs"]
            assert set(runs) == {"animation", "robotis M", "robotis", "mocap M", "mocap", "robotis, smooth"}
            ends = {run: tuple(round(v["end"], 3) for v in values.values()) for run, values in runs.items()}
            assert len(set(ends.values())) == 6
            assert all(abs(e[0]) < 50 for e in ends.values())
            assert all(runs[r]["x"]["floor"] > 0 for r in ends if r != "animation")
        case "solvers_and_steps":
            ran = {(r["drive"], r["solver"], r["setting"]): r for r in content["runs"]}
            assert {s for _, s, _ in ran} == {"lagged", "sap", "similar", "cenic", "runge_kutta3"}
            x = np.array([r["x"] for r in ran.values() if r["drive"] == "servo" and r["seconds"] == 0.1])
            assert np.all(np.isfinite(x))
            assert 0 < np.ptp(x) < 0.5  # cm: solvers agree over a tenth of a second, but are not the same one
            assert all(r["cpu"] > 0 for r in ran.values())
        case "walk_spread":
            assert content["design_sha256"] == make_design(PUPPY, True).sha256
            table = (tmp_path / f"runs-{content['design_sha256'][:12]}.csv").read_text()
            assert json.loads((tmp_path / "design.json").read_text())["runs"] == len(table.splitlines()) - 1
            assert content["spread"]["servo"]["x"]["std"] > 0


def test_the_filters_study_from_end_to_end(tmp_path: Path) -> None:
    assert run_study("filters", filters.__doc__, filters, ["--quick", "--out", str(tmp_path)]) == 0
    rows = json.loads((tmp_path / "filters.json").read_text())["capture (synthetic)"]["rows"]
    error = {r["filter"]: r["velocity_error"] for r in rows}
    assert error["unfiltered"] > error["window 91"] > error["window 1001"] > 0
    assert "window 2001" in (tmp_path / "filters.md").read_text()


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert run_study("walk_spread", walk_spread.__doc__, walk_spread, ["--quick", "--out", str(tmp_path / "file")]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def _numbers(content: Any) -> list[float]:
    match content:
        case dict():
            return [x for v in content.values() for x in _numbers(v)]
        case list():
            return [x for v in content for x in _numbers(v)]
        case bool() | str() | None:
            return []
    assert math.isfinite(content), content
    return [float(content)]
