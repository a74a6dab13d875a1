"""What a person mistypes is refused at once, and named; what is damaged is left out, and said before the work."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.command import refused
from workbench.cli import progress
from workbench.cli.check import check_session
from workbench.cli.memory import rollout_memory
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes
from workbench.files import InputError
from workbench.files.errors import MistypedError
from workbench.robot.servo_constants import ServoConstants

ARM = Path(__file__).parents[2] / "data" / "tutorial_arm"


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    shutil.copytree(ARM, tmp_path / "arm")
    return tmp_path / "arm"


def _replace(path: Path, old: str, new: str, count: int = -1) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, count))


@pytest.mark.parametrize(("old", "new", "said"), [
    ("model: robot.sdf", "modle: robot.sdf", "robot.modle: unknown key; expected one of model"),
    ("recording: takes/slow", "recordng: takes/slow", "takes[0].recordng: unknown key; expected one of name"),
    ("format: 1", "fromat: 1", "fromat: unknown key"), ("format: 1", "format: 2", "format: expected 1"),
    ("takes:", "tekes:", "tekes: unknown key"),
])
def test_a_misspelled_key_is_told_as_such(arm: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, said: str) -> None:
    _replace(arm / "session.yaml", old, new, 1)
    assert said in refused(capsys, "diagnose", str(arm), "--out", str(arm / "out"))


def test_a_joint_that_the_model_lacks_is_refused_before_the_work(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _replace(arm / "takes/slow.csv", ".elbow", ".elbwo")
    said = refused(capsys, "diagnose", str(arm), "--out", str(arm / "out"))
    assert "take 'slow'" in said
    assert "unknown joint 'elbwo'; the model's are" in said
    with pytest.raises(MistypedError, match="elbwo"):
        read_takes(load_session(arm))


def test_a_word_among_numbers_is_refused_and_damage_is_left_out(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = arm / "takes/slow.csv"
    rows = path.read_text().splitlines()
    path.write_text("\n".join([*rows[:9], ",".join(["none", *rows[9].split(",")[1:]]), *rows[10:]]) + "\n")
    assert "expected a number, got 'none'" in refused(capsys, "compare", str(arm), "--out", str(arm / "out"))
    path.write_text("\n".join(rows[:40])[:-12] + "\n")
    progress.forget_warnings()
    assert check_session("diagnose", load_session(arm)) == {"slow"}
    progress.show_warnings()
    assert "warning: take 'slow' left out: " in capsys.readouterr().err


@pytest.mark.parametrize(("error", "stays"), [(InputError(None, "bad"), False), (KeyboardInterrupt(), True)])
def test_what_was_worked_out_goes_with_refused_input(arm: Path, error: BaseException, stays: bool) -> None:
    folders = []

    def work() -> None:
        with rollout_memory(arm / "out", load_session(arm)) as folder:
            folders.append(folder)
            raise error

    with pytest.raises(type(error)):
        work()
    assert folders[0].exists() is stays


def test_a_stall_torque_in_kg_cm_is_doubted() -> None:
    assert not ServoConstants(stall_torque=1.08, no_load_speed=7.5).doubts
    assert any("kg cm" in text for text in ServoConstants(stall_torque=11.0, no_load_speed=7.5).doubts)
