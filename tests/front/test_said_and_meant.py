"""Misspelled names are answered with the likely one; Python arguments are checked before Drake is called."""

from __future__ import annotations

import pytest

import workbench
from workbench.cli.main import main
from workbench.files import InputError
from workbench.simulation import SimulationConfig


@pytest.mark.parametrize(("line", "said"), [
    (["diganose", "x"], "did you mean diagnose"), (["simulate", "x.csv", "--modle", "puppy"], "did you mean --model"),
])
def test_a_slip_gets_a_guess(line: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(line)
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1


@pytest.mark.parametrize("line", [["help"], ["help", "inspect"]])
def test_help_is_a_verb_too(line: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(line)
    assert ended.value.code == 0
    assert "usage: workbench" in capsys.readouterr().out


@pytest.mark.parametrize("step", [-1, -1e-3, "1e-3", None, True, float("nan")])
def test_a_step_that_is_none_is_refused(step: object) -> None:
    with pytest.raises(InputError, match="time_step: expected a non-negative number"):
        SimulationConfig(time_step=step)  # type: ignore[arg-type]


def test_the_package_lists_what_it_gives() -> None:
    assert [name for name in dir(workbench) if not name.startswith("__")] == sorted(workbench.__all__)
