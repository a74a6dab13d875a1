"""The map of gaits: its cells, and how a gait is looked up."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path

import pytest

from workbench.cli.main import main
from workbench.files import InputError
from workbench.gait.ensemble import Ensemble
from workbench.gait.gait_map import Cell, GaitMap, MapOptions, build_map, load_map
from workbench.gait.request import Request
from workbench.gait.shape import GaitShape
from workbench.robot import EffectSpec, data_file, puppy_model

SMALL = MapOptions(cells=3, generations=1, batch=4, robots=1, measured=1, fresh=1, seconds=0.5)


def of(*cells: Cell) -> GaitMap:
    return GaitMap(SMALL, cells, 0, "")


def test_the_nearest_cell_is_one_that_fresh_robots_reproduced(tmp_path: Path) -> None:
    near, far = Cell(GaitShape(), 0.1, 0.0, 0.1), Cell(GaitShape(), 0.3, 0.5, 0.1, (0.3, 0.5), True)
    found = of(near, far)
    assert found.nearest(0.1, 0.0) is far
    assert (found.filled, found.reproduced) == (pytest.approx(2 / 9), 0.5)
    assert json.loads(found.save(tmp_path / "map.json").read_text())["cells"][1]["reproduced"] is True
    with pytest.raises(InputError, match="no gait that fresh robots reproduce"):
        of(near).nearest(0.1, 0.0)


def test_a_map_is_read_back_and_gives_a_search_its_start(tmp_path: Path) -> None:
    model = puppy_model()
    slow = Cell(GaitShape(stride=0.02), 0.05, 0.0, 0.1, (0.05, 0.0), True)
    quick = Cell(GaitShape(stride=0.05), 0.3, 0.0, 0.1, (0.3, 0.0), True)
    left = Cell(GaitShape(stride=0.02, turn=0.3), 0.05, 0.6, 0.1, (0.05, 0.6), True)
    unsure = Cell(GaitShape(), 0.1, 0.0, 0.1)
    found = GaitMap(SMALL, (slow, quick, left, unsure), 7, model.sha256)
    read = load_map(found.save(tmp_path / "map.json"), model)
    assert read == found
    assert read.start_for(Request()) == quick.shape
    assert read.start_for(Request(speed=0.08)) == slow.shape
    assert read.start_for(Request(way="turn", speed=0.8)) == left.shape
    assert read.start_for(Request(way="arc", speed=0.05, radius=0.1)) == left.shape
    with pytest.raises(InputError, match="sideways"):
        read.start_for(Request(way="sideways"))
    with pytest.raises(InputError, match="another robot"):
        load_map(tmp_path / "map.json", model.with_effects((EffectSpec("ground_friction", (), {"friction": 0.4}),)))


def test_a_file_that_is_no_map_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "map.json").write_text('{"format": 1}')
    assert main(["optimize", "--map", str(tmp_path / "map.json"), "--out", str(tmp_path / "out")]) == 2
    assert "not a map of gaits" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_map_that_ships_is_of_the_puppy_and_holds_gaits_that_are_reproduced() -> None:
    found = load_map(data_file("gaits/map.json"), puppy_model())
    assert found.filled > 0.6
    assert found.reproduced > 0.9
    assert found.start_for(Request(speed=0.2)).stride > found.start_for(Request(speed=0.05)).stride


def test_a_map_with_a_method_that_does_not_search_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["optimize", "--map", "--method", "plan", "--out", str(tmp_path / "out")]) == 2
    assert "--map with --method plan" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ribs") is None, reason="needs pyribs (the extra [map])")
def test_the_same_seed_gives_the_same_map_on_one_thread_or_two(tmp_path: Path) -> None:
    model, frictions = puppy_model(), Ensemble(ranges={"friction": (0.5, 0.8)})
    maps = [build_map(model, frictions, tmp_path, 3, SMALL, n_jobs) for n_jobs in (1, 2)]
    assert maps[0] == maps[1]
    assert maps[0].cells
    assert all(0 <= c.speed <= SMALL.speed for c in maps[0].cells)
