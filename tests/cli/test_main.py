"""The command as a user meets it: help, exit codes, one line for each error."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.command import refused
from workbench.cli.main import VERBS, main


def test_help_names_every_verb(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--help"])
    assert stop.value.code == 0
    words = capsys.readouterr().out.split()
    assert all(verb in words for verb in VERBS)


@pytest.mark.parametrize("wanted", [None, "2"])
def test_matrices_take_one_core_unless_the_user_says_otherwise(wanted: str | None, tmp_path: Path) -> None:
    motion = tmp_path / "motion.csv"
    motion.write_text("time,one\n0,0\n1,5\n")
    code = ("import os, sys; from workbench.cli.main import main; assert 'numpy' not in sys.modules; main();"
            "assert 'numpy' in sys.modules; print(os.environ['OPENBLAS_NUM_THREADS'])")
    kept = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    done = subprocess.run([sys.executable, "-c", code, "inspect", str(motion)], check=True, capture_output=True, text=True,
                          env=kept | ({"OPENBLAS_NUM_THREADS": wanted} if wanted else {}))
    assert done.stdout.splitlines()[-1] == (wanted or "1")


@pytest.mark.parametrize("verb", VERBS)
def test_each_verb_explains_itself(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main([verb, "--help"])
    assert stop.value.code == 0
    out = capsys.readouterr().out
    assert out.startswith(f"usage: workbench {verb}")
    assert len(out.split("\n\n")[1]) > 60  # a description, not only arguments


def test_the_package_is_the_command() -> None:
    says = [sys.executable, "-m", "workbench", "--version"]
    assert subprocess.run(says, check=True, capture_output=True, text=True).stdout.startswith("workbench ")


def test_help_comes_at_once_and_loads_no_heavy_module() -> None:
    code = ("import sys, time; t = time.process_time(); from workbench.cli.main import make_parser; make_parser().format_help();"
            "print(time.process_time() - t, *sorted({m.partition('.')[0] for m in sys.modules}))")
    seconds, *modules = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
    assert not {"numpy", "scipy", "pandas", "matplotlib", "pydrake"} & set(modules)
    assert float(seconds) < 0.5


@pytest.mark.parametrize("arguments", [[], ["dance"], ["inspect"], ["inspect", "a", "b"], ["inspect", "--jason", "a"],
                                       ["diagnose", "session.yaml", "--out", ""]])
def test_wrong_arguments_are_one_line(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert ": error: " in captured.err


def test_a_missing_file_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = tmp_path / "none.csv"
    assert refused(capsys, "inspect", str(missing)) == f"workbench inspect: error: {missing}: file not found"


def test_an_error_of_the_system_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    _inspect_raises(monkeypatch, OSError(28, "No space left on device", "/tmp/x"))
    assert refused(capsys, "inspect", "x") == "workbench inspect: error: /tmp/x: No space left on device"


def test_a_defect_keeps_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    _inspect_raises(monkeypatch, ValueError("shapes do not match"))
    with pytest.raises(ValueError, match="shapes"):
        main(["inspect", "x"])


def test_an_interrupt_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    _inspect_raises(monkeypatch, KeyboardInterrupt())
    assert main(["inspect", "x"]) == 130
    assert capsys.readouterr().err.strip() == "workbench inspect: interrupted, nothing was written"


def test_sigterm_cleans_up(tmp_path: Path) -> None:
    code = ("import sys, time\nfrom pathlib import Path\nimport workbench.cli.inspect as verb\n"
            "from workbench.cli.output import output_directory\nfrom workbench.cli.main import main\n"
            "def run(args):\n"
            "    with output_directory(Path('out')):\n"
            "        print('at work', flush=True)\n        time.sleep(60)\n"
            "verb.run = run\nsys.exit(main(['inspect', 'x']))")
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=tmp_path)
    with child, child.stdout as out:  # type: ignore[union-attr]
        assert out.readline() == "at work\n"
        assert list(tmp_path.iterdir())
        child.send_signal(signal.SIGTERM)
        assert child.wait(timeout=20) == 128 + signal.SIGTERM
    assert not list(tmp_path.iterdir())


def test_a_reader_that_has_seen_enough_is_no_error(tmp_path: Path) -> None:
    motion = tmp_path / "nod.csv"
    motion.write_text("time,neck\n0,0\n0.5,10\n1,0\n")
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([sys.executable, "-m", "workbench.cli.main", "inspect", str(motion)], stdout=write,
                          stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, "")


def test_progress_is_plain_lines_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    from workbench.cli.progress import Progress

    with Progress("simulate", quiet=0) as progress:
        for k in range(1000):
            progress(f"walking, {k} steps", k / 1000)
        progress("drawing")
    lines = capsys.readouterr().err.splitlines()
    said = [line.partition(" (")[0] for line in lines]
    assert said == ["workbench simulate: walking, 0 steps 0 %", "workbench simulate: drawing"]


def test_progress_of_a_short_run_is_silent_and_of_a_long_one_comes_by_itself(capsys: pytest.CaptureFixture[str]) -> None:
    from workbench.cli.progress import Progress

    with Progress("simulate", quiet=0.05) as progress:
        progress("walking")
        assert capsys.readouterr().err == ""
        time.sleep(0.3)  # at one thing all the time
        assert capsys.readouterr().err == "workbench simulate: walking (0 s)\n"


def _inspect_raises(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def fail(_: object) -> int:
        raise error

    monkeypatch.setattr("workbench.cli.inspect.run", fail)
