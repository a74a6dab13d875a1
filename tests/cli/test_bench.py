"""The bench measures the figures it states, at a size that tests can afford; their values belong to a quiet machine."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import drives, engine
from benchmarks.arm import EXTRA, ODD, SERVO, arm, frictions, goals, measured, played, session
from benchmarks.bare_plant import BarePlant
from benchmarks.diagnose_time import READING, SEARCH, Stages, diagnose_time
from benchmarks.figure import Figure, in_turns, median_and_quartiles
from benchmarks.sysid import fit_against_mujoco_sysid
from tests.command import refused, succeeds
from workbench.compare.session_takes import read_takes
from workbench.motion import load_motion
from workbench.robot import data_file, puppy_model
from workbench.simulation import Simulation, SimulationConfig


@pytest.fixture(scope="module")
def puppy():
    return puppy_model()


@pytest.fixture(scope="module")
def walk(puppy):
    return load_motion(data_file("robotis_walk.csv"), puppy).commands(2)


def test_quick_bench_prints_and_writes_every_figure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new" / "bench.json"
    said = json.loads(succeeds(capsys, "bench", "--quick", "--out", str(out)))
    assert json.loads(out.read_text()) == said
    assert said["format"] == 1
    assert said["quick"]
    assert said["machine"]["cores"] >= 1
    assert {"workbench", "drake", "numpy", "pandas"} <= set(said["versions"])
    assert said["seconds"] > 0
    differs = (-np.inf, np.inf)  # of times of some dozens of steps: on a busy machine of either sign
    plausible = {"station_against_bare_plant": (0.2, 3), "station_with_contact_forces_against_bare_plant": (0.2, 3),
                 "station_against_mujoco_fixed_base": (0.01, 2), "station_against_mujoco_free_base": (0.01, 2),
                 "fast_servo_and_larger_steps": (1, 20), "motive_reader_against_pandas": (0.1, 20),
                 "compiled_against_drake_held": differs, "compiled_against_drake_standing": differs,
                 "compiled_against_drake_walking": differs, "compiled_against_mujoco_fixed_base": (0.01, 100),
                 "compiled_against_mujoco_free_base": (0.01, 100), "batch_on_two_threads": (0.1, 4),
                 "batch_on_two_processes": (0.1, 4), "fit_against_mujoco_sysid": (0.01, 1000),
                 "servo_log_rollouts_against_mujoco": (0.01, 1000), "servo_log_lanes_against_mujoco": (0.01, 1000),
                     "servo_log_lanes_against_alone": (0.01, 1000), "diagnose_time": (0, 0),
                 **{f"captured_rollouts_{case}": (0.1, 1000) for case in ("held", "held_with_play", "walking")}}
    assert set(said["figures"]) == set(plausible)
    required = set()
    for name, figure in said["figures"].items():
        assert figure["meaning"]
        if "skipped" in figure:
            assert "mujoco" in name or name == "diagnose_time"
            continue
        low, high = plausible[name]
        assert low < figure["value"] < high, (name, figure)
        if "requirement" in figure:
            required.add(name)
            within = figure["value"] >= figure["requirement"].get("at_least", 0)
            assert figure["met"] == (within and figure["value"] < figure["requirement"].get("below", np.inf))
    required_not = ("station_against_mujoco", "fit_against", "servo_log", "fast", "diagnose", "captured")
    measured = {n for n in plausible if "skipped" not in said["figures"][n]}
    assert required == {n for n in measured if not n.startswith(required_not)}


def test_a_file_that_cannot_be_written_is_refused_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "expected a file" in refused(capsys, "bench", "--out", str(tmp_path))
    (tmp_path / "file").write_text("")
    assert "is a file" in refused(capsys, "bench", "--out", str(tmp_path / "file" / "bench.json"))


def test_runs_take_turns_after_one_to_warm_up() -> None:
    order: list[str] = []
    ticks = iter([0.0, 1.0, 2.0, 5.0, 10.0, 12.0, 20.0, 21.0])
    seconds = in_turns({"a": lambda: order.append("a"), "b": lambda: order.append("b")}, 2, lambda: next(ticks))
    assert order == ["a", "b"] * 3
    assert seconds["a"].tolist() == [1, 2]
    assert seconds["b"].tolist() == [3, 1]
    assert median_and_quartiles(np.array([1.0, 2.0, 3.0, 4.0, 5.0])) == (3, (2, 4))


def test_a_requirement_is_met_or_not_or_open() -> None:
    assert Figure("f", "", 0.7, at_least=0.7).met
    assert not Figure("f", "", 0.69, at_least=0.7, aim=0.5).met
    assert not Figure("f", "", 2.0, below=2.0).met
    assert Figure("f", "", 0.5).met is None
    assert Figure("f", "", skipped="why", at_least=1.0).to_json() == {
        "meaning": "", "requirement": {"at_least": 1.0}, "skipped": "why"}


def test_the_bare_plant_makes_the_same_motion_as_the_station(puppy, walk) -> None:
    take = Simulation(puppy, SimulationConfig(contact_period=0.0)).run(walk, 0.4)
    bare = BarePlant(puppy, walk, take, 1e-3)
    for _ in range(2):  # again from the same start
        bare.run()
        q = bare.joint_angles()
        assert np.degrees(np.sqrt(np.mean(np.square(q - take.q[-1])))) < 5
        assert np.degrees(np.sqrt(np.mean(np.square(take.q[0] - take.q[-1])))) > 10  # it went somewhere


def test_a_finer_step_errs_less(puppy, walk) -> None:
    exact = drives.converged(puppy, walk, 0.3, "fixed", 2.5e-4)
    takes = [drives.converged(puppy, walk, 0.3, "fixed", step) for step in (2e-3, 1e-3, 2.5e-4)]
    coarse, fine, same = drives.joint_error(takes, exact)
    assert 0 == same < fine < coarse < 0.05


def test_without_the_other_engine_its_figure_says_why(puppy, walk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "studies.other_engine.bench", None)
    exact = Simulation(puppy, SimulationConfig(base="fixed")).run(walk, 0.05)
    figure = engine.station_against_mujoco(puppy, walk, 0.05, exact, 5e-4, 1e-3, 1)
    assert figure.value is None
    assert "source tree" in (figure.skipped or "")


def test_without_the_toolbox_the_fit_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "studies.other_engine.sysid", None)
    figure = fit_against_mujoco_sysid(0.3, 1, 0)
    assert figure.value is None
    assert "mujoco[sysid]" in (figure.skipped or "")


def test_both_engines_play_the_same_arm(tmp_path: Path) -> None:
    pytest.importorskip("mujoco.sysid").__dict__.get("optimize") or pytest.skip("mujoco[sysid] is not installed")
    from studies.other_engine.sysid import Identification

    model, log = arm(tmp_path), goals(0.5)
    truth = SERVO["coulomb_friction"] + EXTRA[0], SERVO["viscous_friction"] + EXTRA[1]
    other = Identification(model, ODD, log.commands, 5e-4)
    assert np.degrees(np.abs(other.played(truth, log.time) - played(model, log, frictions())).max()) < 0.2
    assert np.degrees(np.abs(other.played(truth, log.time) - other.played(other.nominal, log.time)).max()) > 0.5
    found = other.fitted(log.time, other.played(truth, log.time))
    assert found.friction == pytest.approx(truth, rel=1e-3)
    assert np.degrees(found.residual) < 1e-3


def test_the_arms_log_begins_at_rest_and_tells_its_goals(tmp_path: Path) -> None:
    arm(tmp_path)
    log = measured(goals(0.5), np.zeros((51, 3)), 0)
    (take,), _ = read_takes(session(tmp_path, log))
    assert take.start_state() is None
    assert take.commands is not None
    np.testing.assert_allclose(take.commands.goals[-1], log.goals[-1], atol=1e-8)


def test_stages_sum_up_what_is_said() -> None:
    ticks = iter([0.0, 1.0, 3.0, 6.0, 10.0, 15.0, 21.0, 28.0, 36.0])
    stages = Stages(lambda: next(ticks))
    for what, done in (("reading recordings", None), ("the nominal law recalibrated", 0.0),
                       ("effects, exploring, level 1", 0.0), ("effects, exploring, level 2", 0.5), ("takes kept back", 0.0),
                       ("names that are tied", 0.0), ("coulomb or load", 0.1)):
        stages(what, done)
    assert stages.ended() == {READING: 3.0, SEARCH: 3.0 + 4.0 + 5.0 + 6.0, "ties": 7.0, "next experiment": 8.0}


def test_a_diagnosis_is_not_for_the_quick_form() -> None:
    assert "quick" in (diagnose_time(None, 0).skipped or "")
