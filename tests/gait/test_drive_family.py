"""The family's certificate: its numbers, its bonds, and that driving the robot needs it."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from workbench.cli.main import main
from workbench.files import InputError
from workbench.gait.drive.certify import (
    FILE,
    FamilyOptions,
    bounded_steers,
    broken_limits,
    certify_family,
    gait_sha256,
    read_family,
)
from workbench.gait.drive.family import GaitFamily, load_family
from workbench.gait.ensemble import Ensemble
from workbench.robot import EffectSpec, puppy_model

GAIT = Path(__file__).parents[2] / "data/gaits/demo/gait.csv"


@pytest.fixture
def gait(tmp_path: Path) -> Path:
    for name in ("gait.csv", "certificate.json"):
        shutil.copy(GAIT.parent / name, tmp_path / name)
    return tmp_path / "gait.csv"


def test_turns_meet_their_limits_and_stay_within() -> None:
    o = FamilyOptions(cycles=200)
    steers = np.array([[u.turn, u.side] for u in bounded_steers(np.random.default_rng(0), o)])
    assert np.abs(steers).max(axis=0) == pytest.approx([o.most, o.most_side])
    assert np.abs(np.diff(steers, axis=0)).max(axis=0) == pytest.approx([o.most_change, o.most_side_change])


def test_the_certificate_states_gain_and_falls_and_is_bound_to_gait_and_robot(gait: Path, tmp_path: Path) -> None:
    """Two robots drawn with other friction, ten cycles each."""
    model = puppy_model()
    few, frictions = FamilyOptions(draws=2, cycles=10), Ensemble(ranges={"friction": (0.5, 0.8)})
    certificate = certify_family(load_family(gait, model), gait_sha256(gait), frictions, tmp_path, 1, few)
    assert certificate.kept
    assert certificate.draws["falls"] == 0
    assert certificate.draws["falls at most"] == pytest.approx(1 - 0.05**0.5)
    low, _, high = certificate.draws["gain rad/rad"]
    assert 0.5 < low <= high < 4
    certificate.write(tmp_path)
    read = read_family(gait, model)
    assert read.step_map == certificate.step_map
    assert (read.most, read.most_change, read.most_side, read.most_side_change) == (0.15, 0.08, 0.008, 0.003)
    assert 1.0 < certificate.step_map.side_gain < 2.0, "a stride to the side is that of a stance, not of a cycle"
    content = json.loads((tmp_path / FILE).read_text())
    (tmp_path / FILE).write_text(json.dumps({**content, "most": 0.5}))
    with pytest.raises(InputError, match="changed"):
        read_family(gait, model)
    (tmp_path / FILE).write_text("[]")
    with pytest.raises(InputError, match="not a family's certificate"):
        read_family(gait, model)
    certificate.write(tmp_path)
    with pytest.raises(InputError, match="another robot"):
        read_family(gait, model.with_effects((EffectSpec("ground_friction", (), {"friction": 0.4}),)))
    replace(certificate, problems=("one fell",)).write(tmp_path)
    with pytest.raises(InputError, match="one fell"):
        read_family(gait, model)


def test_a_gait_that_is_not_there_or_was_edited_has_no_family(gait: Path) -> None:
    """The certificate has its shape, which would be driven whatever file is named."""
    with pytest.raises(InputError, match=r"other\.csv: file not found"):
        load_family(gait.with_name("other.csv"), puppy_model())
    lines = gait.read_text().splitlines()
    time, angle, *others = lines[-1].split(",")
    gait.write_text("\n".join([*lines[:-1], ",".join([time, str(float(angle) + 3), *others])]) + "\n")
    with pytest.raises(InputError, match=r"certificate\.json: it is another table's than gait\.csv"):
        load_family(gait, puppy_model())


def test_a_family_whose_tables_break_a_joints_limit_says_at_which_turn(gait: Path) -> None:
    family = load_family(gait, puppy_model())
    deep = GaitFamily(family.machine, replace(family.shape, crouch=0.07))
    assert broken_limits(family, FamilyOptions(grid=3)) == []
    assert "turn -0.150" in broken_limits(deep, FamilyOptions(grid=3))[0]


def test_the_robot_is_not_driven_without_it(gait: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    board = ["--port", "virtual", "--image", "x.bin"]
    assert main(["drive", "1,0", "--gait", str(gait), *board, "--out", str(tmp_path / "out")]) == 2
    assert "--certify" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
