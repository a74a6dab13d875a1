"""Formats of other packages: an error in one is reported in a line that names file, package and entry point."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.plug_in import install_plug_in
from workbench.files import InputError
from workbench.recording.formats.read import read_recording
from workbench.recording.formats.registry import ENTRY_POINT_GROUP, known_formats

READER = """
import numpy as np
from workbench.recording import Recording
from workbench.recording.formats.registry import RecordingFormat
def read(path):
    time = np.arange(50) * 0.01
    {line}
FORMAT = RecordingFormat("hex", "a hex log", lambda head: head.startswith(b"hex,log"), read)
"""
SOUND = 'return Recording(str(path), "hex", "", time, np.arange(50), 100.0, channels={"NAME": time[:COUNT]})'
Install = Callable[[str], Path]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    def write(line: str) -> Path:
        text = READER.replace("{line}", line)
        install_plug_in(tmp_path, monkeypatch, "hex_log", text, ENTRY_POINT_GROUP, "hex = hex_log:FORMAT")
        known_formats.cache_clear()
        log = tmp_path / "log.txt"
        log.write_text(f"hex;log;1;2\n# {line}\n")
        return log

    yield write
    monkeypatch.undo()
    known_formats.cache_clear()


def _sound(name: str, count: int = 50) -> str:
    return SOUND.replace("NAME", name).replace("COUNT", str(count))


@pytest.mark.parametrize(("line", "expected"), [
    ('return {}["time"]', r"read: KeyError: 'time'"),
    ("return time", "read: expected a Recording, got ndarray"),
    (_sound("position.knee", 49), r"channel 'position.knee' has shape \(49,\); expected \(50,\)"),
])
def test_an_error_names_file_package_and_entry_point(install: Install, line: str, expected: str) -> None:
    log = install(line)
    with pytest.raises(InputError, match=rf"log\.txt: package hex-log, entry point hex of {ENTRY_POINT_GROUP}: .*{expected}"):
        read_recording(log)


def test_an_unknown_channel_is_a_problem_of_the_recording(install: Install) -> None:
    read = read_recording(install(_sound("pos.knee")))
    assert any("channel 'pos.knee' is unknown; expected voltage, or goal" in problem for problem in read.problems)


def test_a_known_channel_is_none(install: Install) -> None:
    assert not any("is unknown" in problem for problem in read_recording(install(_sound("position.knee"))).problems)
