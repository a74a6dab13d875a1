"""Arguments that no sane user gives: one line, exit code 2, nothing left behind."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from tests.command import refused
from workbench.cli.main import main
from workbench.cli.output import memory_folder

ARM = Path(__file__).parents[2] / "data" / "tutorial_arm"
POSES = "time,flm,frm\n0,0,0\n0.5,10,10\n1,0,0\n"


@pytest.mark.parametrize(("arguments", "said"), [
    (("servos", "--port", "virtual", "--rate", "0"), "from 1200 to 10500000 bit/s, got 0"),
    (("servos", "--port", "virtual", "--rate", "-5"), "bit/s, got -5"),
    (("servos", "--port", "virtual", "--rate", "1000000000000"), "bit/s, got 1000000000000"),
    (("servos", "--port", "virtual", "--rate", "1e6"), "bit/s, got 1e6"),
    (("record", "localhost", "--port", "99999999"), "expected a port from 1 to 65535, got 99999999"),
    (("record", "localhost", "--port", "-1"), "expected a port from 1 to 65535, got -1"),
    (("view", "puppy", "--port", "65536"), "expected a port from 1 to 65535, got 65536"),
    (("record", "localhost", "--name", "../up"), "expected a name that a file can have"),
    (("record", "localhost", "--name", ""), "expected a name that a file can have"),
    (("record", "localhost", "--name", "a,b"), "expected a name that a file can have"),
    (("record", "localhost", "--name", "a\nb"), "expected a name that a file can have"),
    (("diagnose", "session.yaml", "--out", "out", "--memory", ""), "--memory: expected a folder")])
def test_an_argument_out_of_range_is_one_line(capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], said: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    lines = capsys.readouterr().err.splitlines()
    assert ended.value.code == 2
    assert len(lines) == 1
    assert said in lines[0]


@pytest.mark.parametrize(("image", "said"), [
    (b"", "0 bytes; expected 8 to"), (b"garbage", "7 bytes"), (b"\xff" * 600_000, "600000 bytes"),
    (b"\xff" * 60_000, "its first words are stack 0xffffffff and start 0xffffffff"),
    (struct.pack("<II", 0x20010000, 0x08003009) + b"\xff" * 4000, "the processor locked up")])
def test_bytes_that_are_no_program_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], image: bytes,
                                               said: str) -> None:
    pytest.importorskip("unicorn")
    (tmp_path / "poses.csv").write_text(POSES)
    (tmp_path / "image.bin").write_bytes(image)
    line = refused(capsys, "run", str(tmp_path / "poses.csv"), "--port", "virtual", "--upload", "--image",
                   str(tmp_path / "image.bin"), "--out", str(tmp_path / "out"))
    assert said in line
    assert "image.bin: not a program that the CM-530 runs: " in line
    assert not (tmp_path / "out").exists()


def test_a_request_that_nothing_meets_leaves_no_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (("--rms", "60"), ("--slope", "59")):
        refused(capsys, "optimize", *arguments, "--out", str(tmp_path / "out"))
        assert not (tmp_path / "out").exists()


def test_the_memory_of_a_run_stays_where_it_is(tmp_path: Path) -> None:
    with memory_folder(tmp_path / "out"):
        (tmp_path / "out" / "memory").write_text("x")
    assert (tmp_path / "out" / "memory").is_file()


@pytest.mark.parametrize(("host", "said"), [("", "expected a name or an address, got nothing"), ("a" * 300, "not a known host"),
                                            ("a..b", "not a known host")])
def test_a_name_that_no_host_has_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], host: str, said: str) -> None:
    assert said in refused(capsys, "record", host, "--out", str(tmp_path / "out"))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("text", "said"), [
    (f"# cycles: 2\n{POSES}# cycles: 3\n", "line 6: '# cycles: 3' after '# cycles: 2'; expected one number of cycles"),
    ("time,flm,speed.flm\n0,0,0\n1,1,-5\n2,0,1\n", "row 2, joint flm: expected a moving speed of 0 or more deg/s, got -5"),
    ("time,flm\n0,0\n1000,10\n2000,0\n", "(a table has seconds); add --yes if this is intended")])
def test_a_table_that_contradicts_itself_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, said: str
                                                     ) -> None:
    (tmp_path / "poses.csv").write_text(text)
    assert said in refused(capsys, "simulate", str(tmp_path / "poses.csv"), "--out", str(tmp_path / "out"))


def test_what_two_files_need_has_no_effect_on_a_session(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(ARM), "--cycles", "3", "--base", "fixed", "--out", str(tmp_path / "out"), "--jobs", "1"]) == 0
    said = capsys.readouterr().err
    for name in ("base", "cycles"):
        assert f"warning: --{name} has no effect: each take of {ARM / 'session.yaml'} has its own" in said
