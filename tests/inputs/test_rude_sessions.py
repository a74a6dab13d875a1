"""Sessions and models of a rude kind: entries without effect, loads of another unit, posteriors of other effects."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.command import refused
from tests.inputs.corpus import MODEL
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.files.yaml_file import read_yaml
from workbench.inspect.problems import Part, model_problems_of, session_check
from workbench.robot import load_model

ARM = Path(__file__).parents[2] / "data" / "tutorial_arm"


def _slow(folder: Path, *lines: str) -> list[str]:
    """Problems of the arm's first take with further entries in it."""
    shutil.copytree(ARM, folder / "arm", dirs_exist_ok=True)
    path = folder / "arm/session.yaml"
    first, rest = path.read_text().split("  base: fixed\n", 1)
    path.write_text(first + "".join(f"  {line}\n" for line in ("base: fixed", *lines)) + rest)
    return list(session_check(load_session(path)).problems.get(Part("take", "slow"), []))


def test_entries_that_cannot_be_meant_are_told(tmp_path: Path) -> None:
    assert _slow(tmp_path) == []
    assert any("cycles: 3 has no effect" in text for text in _slow(tmp_path, "cycles: 3"))
    heavy = _slow(tmp_path, "load: {link: hand, mass: 3, at: [0, 0, 0]}")
    assert any("load: 3 kg weighs more than the robot" in text for text in heavy)
    with pytest.raises(InputError, match=r"load\.mass: expected a number of at least 0 and at most 5, got 200"):
        _slow(tmp_path, "load: {link: hand, mass: 200, at: [0, 0, 0]}")


@pytest.mark.parametrize(("old", "new", "said"), [
    ("name: slow", 'name: "a\\x07b"', r"takes\[0\]\.name: expected a name that can be a file's"),
    ("format: 1", "format: true", "format: expected 1")])
def test_entries_of_a_rude_kind_are_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    shutil.copytree(ARM, tmp_path / "arm")
    path = tmp_path / "arm/session.yaml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError, match=said):
        load_session(path)


def test_a_session_of_another_robot_names_its_file_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(ARM, tmp_path / "arm")
    path = tmp_path / "arm/session.yaml"
    lines = [line for line in path.read_text().splitlines() if "model:" not in line and "base: base" not in line]
    path.write_text("\n".join(lines) + "\n")
    assert refused(capsys, "inspect", str(path)).count(f"{path}: ") == 1


def test_a_take_of_less_than_half_a_second_is_told(tmp_path: Path) -> None:
    shutil.copytree(ARM, tmp_path / "arm")
    log = tmp_path / "arm/takes/slow.csv"
    log.write_text("".join(f"{line}\n" for line in log.read_text().splitlines()[:40]))
    problems = session_check(load_session(tmp_path / "arm")).problems[Part("take", "slow")]
    assert any(text.startswith("lasts 0.38 s: a search compares stretches of 0.5 s") for text in problems)


def test_a_log_of_goals_alone_is_left_out_before_anything_is_simulated(tmp_path: Path) -> None:
    shutil.copytree(ARM, tmp_path / "arm")
    log = tmp_path / "arm/takes/slow.csv"
    log.write_text("\n".join(",".join(line.split(",")[:3]) for line in log.read_text().splitlines()) + "\n")
    check = session_check(load_session(tmp_path / "arm"))
    assert check.damaged_takes == {"slow"}
    assert "no joint has a position to compare with" in check.problems[Part("take", "slow")][0]


def test_a_take_that_is_over_in_no_time_is_left_out(tmp_path: Path) -> None:
    shutil.copytree(ARM, tmp_path / "arm")
    log = tmp_path / "arm/takes/slow.csv"
    names, *rows = log.read_text().splitlines()
    cells = [row.split(",", 1) for row in rows]
    log.write_text("\n".join([names, *(f"{1e-6 * float(t):.12f},{rest}" for t, rest in cells)]) + "\n")
    check = session_check(load_session(tmp_path / "arm"))
    assert check.damaged_takes == {"slow"}
    assert "lasts 4.99e-06 s; expected 0.1 s or more: are its times in seconds?" in check.problems[Part("take", "slow")][0]


def _model(folder: Path, text: str) -> Path:
    (folder / "model.yaml").write_text(text)
    return folder / "model.yaml"


def test_an_edited_effect_asks_to_delete_the_posterior(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"backlash\(frm\)\.gap; where an effect was edited, delete `posterior`"):
        load_model(_model(tmp_path, MODEL.replace("where: [flm]", "where: [frm]")))


@pytest.mark.parametrize("variance", ["-0.01", "-.inf"])
def test_a_negative_variance_is_refused(tmp_path: Path, variance: str) -> None:
    with pytest.raises(InputError, match=r"posterior\.covariance: expected a variance of backlash\(flm\)\.gap, got -"):
        load_model(_model(tmp_path, MODEL.replace("[[0.01]]", f"[[{variance}]]")))


@pytest.mark.parametrize(("old", "new", "said"), [
    ("mean: [3.1]", "mean: [9]", r"mean: expected 3\.1 of backlash\(flm\)\.gap, as the effect has it, got 9; where an effect"),
    ("gap: 3.1", "gap: 2.1", r"mean: expected 2\.1 of backlash\(flm\)\.gap"),
    (", parameters: {gap: 3.1}}", ", parameters: {gap: 3.1}}\n- {effect: backlash, where: [frm], parameters: {gap: 1}}",
     "posterior.names: expected those of the effects")])
def test_a_posterior_of_other_effects_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in MODEL
    with pytest.raises(InputError, match=said):
        load_model(_model(tmp_path, MODEL.replace(old, new)))


@pytest.mark.parametrize(("rows", "said"), [("[[1, 0.5], [0, 1]]", "the same numbers across the diagonal"),
                                            ("[[1, 2], [2, 1]]", "no negative variance in any direction")])
def test_a_matrix_that_is_no_covariance_is_refused(tmp_path: Path, rows: str, said: str) -> None:
    text = MODEL.replace(", parameters: {gap: 3.1}}", ", parameters: {gap: 3.1}}\n"
                         "- {effect: backlash, where: [frm], parameters: {gap: 1}}")
    text = text.replace("[backlash(flm).gap], mean: [3.1], covariance: [[0.01]]",
                        f"[backlash(flm).gap, backlash(frm).gap], mean: [3.1, 1], covariance: {rows}")
    with pytest.raises(InputError, match=f"posterior.covariance: expected {said}"):
        load_model(_model(tmp_path, text))


def test_an_effect_given_twice_is_told(tmp_path: Path) -> None:
    text = MODEL.replace("effects:\n", "effects:\n- {effect: backlash, where: [flm], parameters: {gap: 1.0}}\n")
    text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith("posterior"))
    assert "effect 'backlash flm' is given 2 times: they act together" in model_problems_of(load_model(_model(tmp_path, text)))


def test_text_in_utf_16_is_named_as_such(tmp_path: Path) -> None:
    (tmp_path / "model.yaml").write_bytes(MODEL.encode("utf-16"))
    with pytest.raises(InputError, match="text in UTF-16; save it as UTF-8"):
        read_yaml(tmp_path / "model.yaml")
    with pytest.raises(InputError, match="duplicate key 'robot', line 2, column 1"):
        read_yaml(_model(tmp_path, "robot: {}\nrobot: {}\n"))
