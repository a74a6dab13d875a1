"""`import workbench`: its public names, and results that save and show themselves."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import workbench
from models.build_fox import SHANK
from tests.gap_sessions import record_arm, write_session
from workbench.gait.examine import CertifyOptions
from workbench.gait.limits import GaitLimits
from workbench.gait.search import Budget
from workbench.robot.model import Ground
from workbench.view.scene.live import link_poses, open_meshcat, pose_by_sliders, show_session


def test_every_name_is_there_and_described() -> None:
    for name in workbench.__all__:
        assert getattr(workbench, name).__doc__, f"workbench.{name} has no docstring"
    assert set(workbench.__all__) <= set(dir(workbench))
    with pytest.raises(AttributeError, match="no attribute 'dance'"):
        _ = workbench.dance


def test_importing_it_loads_nothing_heavy() -> None:
    code = "import sys, workbench; print(*sorted({m.partition('.')[0] for m in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
    assert not {"numpy", "pydrake", "scipy", "pandas", "matplotlib"} & set(loaded)


@pytest.mark.parametrize(("name", "joints"), [("puppy", 15), ("fox", 12), ("package://fox/fox.sdf", 12)])
def test_robots_by_name(name: str, joints: int) -> None:
    assert len(workbench.load_model(name).joints) == joints


def test_the_fox_has_its_own_servos_and_a_robot_without_effects_is_refused_an_unknown_one(tmp_path: Path) -> None:
    fox = workbench.load_model("fox")
    assert fox.servo("LF_KFE").proportional_gain == 1.841
    odd = tmp_path / "model.yaml"
    with pytest.raises(workbench.InputError, match="effect 'magic' is not known"):
        workbench.save_model(fox.with_effect(workbench.EffectSpec("magic")), odd)
    assert not odd.exists()
    pulled = fox.with_effect(workbench.EffectSpec("tether_force", (), {"force": (1.0, 0.0, 0.0)}))
    odd.write_text(workbench.save_model(pulled, odd).read_text().replace("tether_force", "magic"))
    with pytest.raises(workbench.InputError, match=r"model\.yaml: effects: .*magic"):
        workbench.load_model(odd)


def test_a_station_of_any_robot() -> None:
    station = workbench.MakeStation(workbench.load_model("fox"), workbench.SimulationConfig(base="fixed"))
    assert station.GetInputPort("goal_position").size() == 12


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> workbench.Session:
    folder = tmp_path_factory.mktemp("session")
    write_session(folder)
    record_arm(folder)
    return workbench.load_session(folder / "session.yaml")


def test_a_comparison_saves_and_shows_itself(session: workbench.Session, tmp_path: Path) -> None:
    result = workbench.compare_session(session, workbench.SimulationConfig(time_step=2e-3), jobs=1)
    paths = result.save(tmp_path / "new" / "folder")
    assert paths[0].name == "report.html"
    assert all(p.stat().st_size > 0 for p in paths)
    (take,) = json.loads((tmp_path / "new/folder/comparison.json").read_text())["takes"]
    assert set(take["joints"]) == {"one", "two", "three"}
    shown = result._repr_html_()
    assert result.headline in shown.replace("&#x27;", "'")
    assert shown.count("<tr>") == 4


@pytest.mark.parametrize(("make", "said"), [
    (lambda: workbench.DiagnoseOptions(jobs=0), "jobs: expected 1 or more"),
    (lambda: workbench.SimulationConfig(base="fly"), "base: expected one of auto, free, fixed, path, got 'fly'"),
    (lambda: workbench.SimulationConfig(time_step=-1.0), "time_step: expected a non-negative number"),
    (lambda: workbench.SimulationConfig(time_step=0.0, drive="fast_servo"), "drive: fast_servo needs a discrete plant"),
    (lambda: workbench.Request(way="up"), "way: expected one of forward, backward, sideways, turn, arc, got 'up'"),
    (lambda: workbench.Request(speed=0.1, aim="beauty"), "aim: expected one of speed, gentleness, energy, smoothness"),
    (lambda: workbench.OptimizeOptions(n_jobs=0), "n_jobs: expected a whole number of at least 1, got 0"),
    (lambda: Budget(population=1), "population: expected a whole number of at least 2, got 1"),
    (lambda: Budget(draws=1.5), "draws: expected a whole number of at least 0, got 1.5"),
    (lambda: Budget(seeds="many"), "seeds: expected a whole number of at least 0, got 'many'"),
    (lambda: Budget(width=math.nan), "width: expected a positive number, got nan"),
    (lambda: CertifyOptions(seconds=0.0), "seconds: expected a positive number, got 0.0"),
    (lambda: CertifyOptions(variants=("3 ms",)), "variants: expected one of 2 ms, 1 ms, .*, got '3 ms'"),
    (lambda: GaitLimits(rms=-0.1), "rms: expected a positive number, got -0.1"),
    (lambda: Ground(friction=-1.0), "friction: expected a non-negative number"),
])
def test_options_say_what_is_wrong(make: Callable[[], object], said: str) -> None:
    with pytest.raises(workbench.InputError, match=said):
        make()


def test_a_run_says_what_it_lacks() -> None:
    still = workbench.Simulation(workbench.load_model("puppy"), workbench.SimulationConfig(time_step=2e-3, base="path"))
    with pytest.raises(workbench.InputError, match="expected commands, a trajectory or a duration"):
        still.run()
    with pytest.raises(workbench.InputError, match="base 'path' needs a take to follow"):
        still.run(duration=0.1)


def test_live_meshcat_shows_a_robot_and_moves_it_by_sliders() -> None:
    fox = workbench.load_model("fox")
    meshcat = workbench.show(fox)
    assert meshcat.HasPath("/robot/LF_FOOT/0")
    looks = iter([True, True, False])

    def wait() -> bool:
        meshcat.SetSliderValue("RH_KFE", 45.0)
        return next(looks)

    pose_by_sliders(meshcat, fox, wait)
    assert meshcat.GetSliderValue("RH_KFE") == pytest.approx(45.0, abs=0.6)


def test_a_pose_bends_the_joint_that_is_asked() -> None:
    fox = workbench.load_model("fox")
    bent = np.zeros(12)
    bent[fox.joints.index("RH_KFE")] = np.pi / 2
    straight, then = link_poses(fox, np.zeros(12)), link_poses(fox, bent)
    shank = then["RH_FOOT"].translation() - then["RH_SHANK"].translation()
    np.testing.assert_allclose(shank, [-SHANK, 0, 0], atol=1e-9)
    np.testing.assert_allclose(then["LF_FOOT"].translation(), straight["LF_FOOT"].translation(), atol=1e-9)


def test_live_meshcat_plays_a_session_with_the_recording_as_a_ghost(session: workbench.Session) -> None:
    meshcat = show_session(session)
    assert meshcat.HasPath("/simulated/lower")
    assert meshcat.HasPath("/recorded/lower")
    with pytest.raises(workbench.InputError, match="no take 'dance'; expected one of wave"):
        show_session(session, "dance")
    with pytest.raises(workbench.InputError, match="expected a RobotModel or a Session, got int"):
        workbench.show(3)


def test_a_port_that_is_taken_is_named() -> None:
    first = open_meshcat()
    with pytest.raises(workbench.InputError, match=f"port {first.port()}: Meshcat cannot be served there"):
        open_meshcat(first.port())
