"""Loading a program: against an emulated loader, with the line cut everywhere, wrong devices, wrong images, silence."""

from __future__ import annotations

import hashlib
import io
import random
import struct
from pathlib import Path

import pytest

from tests.firmware.emulated_loader import POWERED_ON, Controller, EmulatedLoader
from tests.firmware.image import Robot, image, needs_compiler
from workbench.device.controller.loader import (
    ASKED,
    HALF,
    LOADED,
    UNKNOWN,
    UNTOUCHED,
    LoadError,
    Loading,
    Transcript,
)
from workbench.device.controller.loader_profile import check_image, load_loader_profile
from workbench.device.link import ControllerState
from workbench.files import InputError

PROFILE = load_loader_profile()
IMAGE = struct.pack("<II", 0x20010000, 0x08003101) + random.Random(0).randbytes(3000)


def load(line: EmulatedLoader, data: bytes = IMAGE) -> Transcript:
    transcript = Transcript(now=lambda: line.time)
    Loading(line, PROFILE, transcript).run(data)
    return transcript


def test_a_program_is_loaded_and_started_and_the_transcript_tells_all() -> None:
    line = EmulatedLoader(PROFILE, Controller())
    transcript = load(line)
    assert (line.controller.runs, line.controller.program, line.stays) == ("new", IMAGE, True)
    text = transcript.text
    for said in ("we send: '#'", "CM530 Boot loader", "we send: 'LOAD\\r'", "'APP\\r'", "Ready", "the image, 3009 bytes",
                 "Success", "'GO\\r'"):
        assert said in text


def test_the_line_cut_at_each_of_200_places_says_the_truth_and_a_second_run_succeeds() -> None:
    whole = EmulatedLoader(PROFILE, Controller())
    load(whole)
    places = sorted({round(k * (whole.crossed - 1) / 199) for k in range(200)})
    assert len(places) == 200
    truth = {UNTOUCHED: {"factory"}, ASKED: {"factory", "nothing"}, HALF: {"nothing"}, UNKNOWN: {"new", "nothing"},
             LOADED: {"new"}}
    seen = set()
    for place in places:
        controller = Controller()
        with pytest.raises(LoadError) as caught:
            load(EmulatedLoader(PROFILE, controller, cut_after=place))
        assert "the line was cut" in caught.value.what
        runs = controller.runs
        assert runs in truth[caught.value.state], place
        seen.add(caught.value.state)
        load(EmulatedLoader(PROFILE, controller))
        assert (controller.runs, controller.program) == ("new", IMAGE)
    assert seen >= {UNTOUCHED, ASKED, HALF, LOADED}


def test_silence_another_device_and_unknown_texts_stop_before_anything_is_replaced() -> None:
    for options, said in (
        ({"mute": True}, "silent while it was switched on"),
        ({"says": {"banner": b"CM-510 Boot loader\r\n-"}}, "which is no CM-530"),
        ({"says": {"banner": b"\r\nCM-530 v2\r\n$ "}}, "does not hold"),
    ):
        line = EmulatedLoader(PROFILE, Controller(), **options)
        with pytest.raises(LoadError, match=said) as caught:
            load(line)
        assert caught.value.state == UNTOUCHED
        assert line.controller.runs == "factory"


def test_a_loader_that_answers_load_or_the_image_in_unknown_words_is_not_believed() -> None:
    line = EmulatedLoader(PROFILE, Controller(), says={"ready": b"Bereit"})
    with pytest.raises(LoadError, match="Bereit"):
        load(line)
    line = EmulatedLoader(PROFILE, Controller(), says={"success": b"done"})
    with pytest.raises(LoadError, match="does not hold") as caught:
        load(line)
    assert caught.value.state == UNKNOWN


def test_a_program_that_does_not_speak_is_said_to_be_loaded_but_not_seen() -> None:
    line = EmulatedLoader(PROFILE, Controller(), starts=lambda program: b"")
    with pytest.raises(LoadError, match="did not speak") as caught:
        load(line)
    assert caught.value.state == LOADED
    assert line.controller.runs == "new"


@pytest.mark.parametrize("late", [0.0, 0.016, 0.03, 0.15])
@pytest.mark.parametrize("deaf", [False, True])
def test_a_console_that_keeps_what_is_typed_behind_a_slow_adapter_is_no_obstacle(late: float, deaf: bool) -> None:
    line = EmulatedLoader(PROFILE, Controller(), late=late, deaf=deaf)
    transcript = load(line)
    assert (line.controller.runs, line.controller.program, line.stays) == ("new", IMAGE, True)
    assert line.reopened == deaf
    assert ("Bad Command" in transcript.text) == (late > 0.02)


def test_a_refused_load_is_sent_again_and_then_nothing_is_said_to_be_erased() -> None:
    line = EmulatedLoader(PROFILE, Controller(), drops=1)
    load(line)
    assert line.controller.runs == "new"
    line = EmulatedLoader(PROFILE, Controller(), drops=2)
    with pytest.raises(LoadError, match="Bad Command") as caught:
        load(line)
    assert (caught.value.state, line.controller.runs) == (UNTOUCHED, "factory")


def test_a_program_that_is_first_heard_after_the_port_was_opened_again_has_started() -> None:
    line = EmulatedLoader(PROFILE, Controller(), starts=lambda program: b"")
    heard = line.reopen

    def reopen() -> None:
        heard()
        line.say(POWERED_ON)

    line.reopen = reopen  # type: ignore[method-assign]
    assert Loading(line, PROFILE, Transcript(now=lambda: line.time)).run(IMAGE).state == ControllerState.CHECK


@pytest.mark.parametrize(("data", "said"), [
    (b"", "0 bytes"), (b"\0" * 600_000, "600000 bytes"), (b"#!/bin/sh\n" + b"x" * 400, "no stack and start"),
    (struct.pack("<II", 0x20010000, 0x08000101) + b"\0" * 400, "no stack and start"),
])
def test_a_wrong_image_is_refused(data: bytes, said: str) -> None:
    with pytest.raises(InputError, match=said):
        check_image(data, PROFILE, "x.bin")


def test_a_loader_file_with_a_fault_is_named(tmp_path: Path) -> None:
    good = Path(PROFILE.source).read_text()
    for change, said in (("rate: 57600", "'rate' is missing"), ('ready: ["Ready", "ready"]', "'ready' is missing")):
        path = tmp_path / "loader.yaml"
        path.write_text(good.replace(change, ""))
        with pytest.raises(InputError, match=said):
            load_loader_profile(path)


@needs_compiler
def test_the_image_itself_is_loaded_started_and_speaks() -> None:
    check_image(image(), PROFILE, "cm530.bin")

    def start(program: bytes) -> bytes:
        robot = Robot(data=program)
        robot.run(60)
        return bytes(robot.board.pc.received)

    line = EmulatedLoader(PROFILE, Controller(), starts=start)
    said = Loading(line, PROFILE, Transcript(now=lambda: line.time)).run(image())
    assert said.state == ControllerState.CHECK
    assert said.woke_from == "power on"


class Babbler(EmulatedLoader):
    """A loader that now and then says something else."""

    def __init__(self, seed: int, controller: Controller) -> None:
        super().__init__(PROFILE, controller)
        self._rng = random.Random(seed)

    def read(self, seconds: float) -> bytes:
        said = super().read(seconds)
        chance = self._rng.random()
        if chance < 0.05:
            return said + self._rng.randbytes(self._rng.randrange(40))
        if chance < 0.1:
            return said[: self._rng.randrange(len(said) + 1)]
        if chance < 0.12:
            return said + self._rng.choice([b"-", b"Ready", b"Success", b"Fail", b"CM-510", b"\xa5\x5a\x80\x00\x0c"])
        return said


def test_whatever_a_loader_says_it_ends_and_a_claim_of_success_needs_the_program_itself() -> None:
    truth = {UNTOUCHED: {"factory"}, ASKED: {"factory", "nothing"}, HALF: {"factory", "nothing"},
             UNKNOWN: {"new", "nothing", "factory"},
             LOADED: {"new", "nothing", "factory"}, "started": {"new"}}
    ends = set()
    for seed in range(300):
        controller = Controller()
        try:
            load(Babbler(seed, controller))
            state = "started"
        except LoadError as e:
            state = e.state
        assert controller.runs in truth[state]
        ends.add(state)
    assert len(ends) >= 4


@needs_compiler
def test_flash_builds_and_says_what_it_would_do_and_needs_a_yes(tmp_path: Path, monkeypatch, capsys) -> None:
    from workbench.cli.main import main
    from workbench.robot import data_file

    walk = str(data_file("robotis_walk.csv"))
    monkeypatch.setattr("sys.stdin", io.StringIO())
    assert main(["flash", walk, "--dry-run", "--cycles", "5", "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "RoboPlus Manager" in out
    assert "The robot will move" in out
    assert "ends after 5 cycles" in out
    assert "no port was opened" in out
    assert f"SHA-256: {hashlib.sha256((tmp_path / 'cm530.bin').read_bytes()).hexdigest()}" in out
    assert main(["flash", walk, "--out", str(tmp_path / "refused")]) == 2
    assert "say yes" in capsys.readouterr().err
    assert not (tmp_path / "refused").exists()
    assert main(["flash", walk, "--yes", "--port", "/dev/no-such-port", "--out", str(tmp_path / "refused")]) == 2
    assert "no such port" in capsys.readouterr().err
    assert not (tmp_path / "refused").exists()
    (tmp_path / "bad.table").write_bytes(b"WBTB")
    assert main(["flash", str(tmp_path / "bad.table"), "--dry-run", "--out", str(tmp_path)]) == 2
    assert "too short" in capsys.readouterr().err
