"""Loading a program into the controller: a conversation with its loader, in which only texts count that a data file holds."""

from __future__ import annotations

import struct
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from workbench.device.link import FrameReader, StateMessage, message
from workbench.files import InputError
from workbench.files.yaml_file import read_yaml
from workbench.robot import data_file

FACTORY = ("This replaces ROBOTIS's own program in the controller. To get that back: RoboPlus Manager, 'Controller Firmware "
           "Management' (R+ Manager on newer systems), with the controller on USB; the loader itself cannot be overwritten.")
RAM, RAM_END = 0x20000000, 0x20010000
PROMPT_WAIT, ANSWER_WAIT, START_WAIT = 20.0, 5.0, 2.0
"""How long the user has to switch on, the loader to answer, and the program to speak [s]."""
CHUNK = 256


class Line(Protocol):
    """A serial line; OSError where it is gone."""

    def write(self, data: bytes) -> None:
        """Sends."""
        ...

    def read(self, seconds: float) -> bytes:
        """What comes within this time; b"" for silence."""
        ...


@dataclass(frozen=True)
class LoaderProfile:
    """What data/loaders says of a loader; texts as bytes, `confirmed` where a real one was heard to say them."""

    name: str
    confirmed: bool
    rate: int
    key: bytes
    key_every: float
    line_end: bytes
    byte_sum: bool
    prompt: tuple[bytes, ...]
    identity: tuple[bytes, ...]
    load: bytes
    start: bytes
    ready: tuple[bytes, ...]
    success: tuple[bytes, ...]
    failure: tuple[bytes, ...]
    application: int
    flash_end: int
    source: str = field(default="", compare=False)


def load_loader_profile(path: str | Path | None = None) -> LoaderProfile:
    """Reads a loader's texts (default: the CM-530's); InputError names file and key."""
    path = Path(path) if path else data_file("loaders/cm530.yaml")
    content = read_yaml(path)
    if not isinstance(content, dict):
        raise InputError(path, "expected a mapping")
    kinds: dict[str, type | tuple[type, ...]] = {
        "format": int, "name": str, "confirmed": (bool, str), "rate": int, "key": str, "key_every": float, "line_end": str,
        "byte_sum": bool, "prompt": list, "identity": list, "commands": dict, "ready": list, "success": list,
        "failure": list, "application": (int, str), "flash_end": (int, str),
    }
    for key, kind in kinds.items():
        if not isinstance(content.get(key), kind):
            raise InputError(path, f"key '{key}' is missing or of another kind")
    for key in content:
        if key not in kinds:
            raise InputError(path, f"unknown key '{key}'; expected one of {', '.join(sorted(kinds))}")

    def texts(key: str) -> tuple[bytes, ...]:
        found = tuple(str(t).encode() for t in content[key])
        if not found or b"" in found:
            raise InputError(path, f"key '{key}': expected at least one text, none of them empty")
        return found

    def address(key: str) -> int:
        try:
            return int(str(content[key]), 0)
        except ValueError:
            raise InputError(path, f"key '{key}': expected an address such as 0x08003000") from None

    commands = content["commands"]
    if set(commands) != {"load", "start"}:
        raise InputError(path, "key 'commands': expected load and start")
    return LoaderProfile(
        content["name"], bool(content["confirmed"]), content["rate"], content["key"].encode(), content["key_every"],
        content["line_end"].encode(), content["byte_sum"], texts("prompt"), texts("identity"), commands["load"].encode(),
        commands["start"].encode(), texts("ready"), texts("success"), texts("failure"), address("application"),
        address("flash_end"), str(path))


def check_image(image: bytes, profile: LoaderProfile, source: str) -> None:
    """InputError unless this can be a program for that place: stack in RAM, reset vector inside, not longer than the flash."""
    room = profile.flash_end - profile.application
    if not 256 <= len(image) <= room:
        raise InputError(source, f"{len(image)} bytes; a program for the {profile.name} has 256 to {room}")
    stack, start = struct.unpack_from("<II", image)
    inside = profile.application <= start - 1 < profile.application + len(image)
    if not (RAM < stack <= RAM_END and stack % 4 == 0 and start & 1 and inside):
        raise InputError(source, f"its first words, {stack:#x} and {start:#x}, are no stack and start of a program at "
                                 f"{profile.application:#x}")


class LoadError(RuntimeError):
    """Loading ended early. `what` happened; `state` of the controller now; `remedy`: what to do."""

    def __init__(self, what: str, state: str, remedy: str) -> None:
        self.what, self.state, self.remedy = what, state, remedy
        super().__init__(f"{what}; {state}; {remedy}")


UNTOUCHED = "the controller holds the program that it held before"
HALF = "the old program may be erased and the new one is not whole, so it may run nothing; its loader is whole"
UNKNOWN = "the image was sent whole, but the loader did not confirm it; the new program may or may not run"
LOADED = "the new program is loaded but was not seen to start"
AGAIN = "switch it off, and run this again"
RESTART = "switch the controller off and on; if it stays dark, run this again"


@dataclass
class Transcript:
    """All that went over the line, with times [s since the beginning]; `text` is what is kept in a file."""

    lines: list[str] = field(default_factory=list)
    now: Callable[[], float] = clock.monotonic

    def __post_init__(self) -> None:
        self._began = self.now()

    def note(self, who: str, what: bytes | str) -> None:
        """Bytes as Python writes them, at most the first 200."""
        said = what if isinstance(what, str) else repr(what[:200])[1:] + (f" … {len(what)} bytes" if len(what) > 200 else "")
        self.lines.append(f"{self.now() - self._began:9.3f} {who}: {said}")

    @property
    def text(self) -> str:
        """One line for each piece."""
        return "\n".join(self.lines) + "\n"


class Loading:
    """One conversation: `run` has the image loaded and started, or raises LoadError. Progress hears (what, done)."""

    def __init__(self, line: Line, profile: LoaderProfile, transcript: Transcript,
                 progress: Callable[[str, float | None], None] = lambda what, done: None) -> None:
        self._line, self._profile, self._transcript, self._progress = line, profile, transcript, progress
        self._state = UNTOUCHED

    def run(self, image: bytes) -> StateMessage:
        """Returns what the new program says of itself."""
        try:
            self._find_prompt()
            self._command(self._profile.load)
            self._expect(self._profile.ready, ANSWER_WAIT, "after LOAD")
            self._send(image)
            self._state = UNKNOWN
            self._expect(self._profile.success, ANSWER_WAIT, "after the image")
            self._state = LOADED
            return self._start()
        except OSError as e:
            reason = e.strerror or str(e) or type(e).__name__
            raise LoadError(f"the line was cut ({reason})", self._state, RESTART if self._state == LOADED else AGAIN) from None

    def _find_prompt(self) -> None:
        """The key, again and again, until the loader of the right controller waits for a command."""
        profile = self._profile
        heard = b""
        waited = 0.0
        self._progress("1 of 4: waiting for the loader (switch the controller off and on)", None)
        while not self._at_prompt(heard):
            if waited > PROMPT_WAIT:
                self._nothing_known(heard, "while it was switched on")
            self._write(profile.key)
            new = self._read(profile.key_every)
            waited = 0.0 if new and not heard else waited + profile.key_every
            heard = (heard + new)[-4096:]
        if not any(name in heard for name in profile.identity):
            heard = self._ask_again()
            if not any(name in heard for name in profile.identity):
                raise LoadError(f"the loader says {_shown(heard)}, which is no {profile.name} ({profile.source} knows "
                                f"{_listed(profile.identity)})", self._state, "check which controller this is")

    def _ask_again(self) -> bytes:
        """An empty command makes it say its prompt again."""
        self._write(self._profile.line_end)
        return self._collect(1.0)

    def _at_prompt(self, heard: bytes) -> bool:
        said = heard.replace(self._profile.key, b"").rstrip()  # echoes of our key may be mixed in
        return any(said.endswith(prompt) for prompt in self._profile.prompt)

    def _command(self, command: bytes) -> None:
        self._progress("2 of 4: asking it to load a program", None)
        self._drain()
        self._state = HALF  # from LOAD on the old program may be erased
        self._write(command + self._profile.line_end)

    def _send(self, image: bytes) -> None:
        data = image + (bytes([sum(image) & 0xFF]) if self._profile.byte_sum else b"")
        self._transcript.note("we send", f"the image, {len(data)} bytes")
        for at in range(0, len(data), CHUNK):
            self._progress("3 of 4: sending the program", at / len(data))
            self._line.write(data[at:at + CHUNK])

    def _expect(self, texts: tuple[bytes, ...], seconds: float, when: str) -> None:
        heard, waited = b"", 0.0
        while not any(text in heard for text in texts):
            failed = [text for text in self._profile.failure if text in heard]
            if failed:
                raise LoadError(f"the loader said {_shown(heard)} {when}", self._state, AGAIN)
            if waited >= seconds:
                self._nothing_known(heard, when)
            new = self._read(0.1)
            waited += 0.1
            heard += new

    def _nothing_known(self, heard: bytes, when: str) -> None:
        if not heard:
            raise LoadError(f"the loader was silent {when}", self._state, f"check cable, port and power; {AGAIN}")
        raise LoadError(f"the loader said {_shown(heard)} {when}, which {self._profile.source} does not hold", self._state,
                        f"if that is right, add it there; {AGAIN}")

    def _start(self) -> StateMessage:
        self._progress("4 of 4: starting it", None)
        self._collect(0.2)
        self._write(self._profile.start + self._profile.line_end)
        reader, waited = FrameReader(), 0.0
        while waited < START_WAIT:
            for frame in reader.feed(self._read(0.1)):
                said = message(frame)
                if isinstance(said, StateMessage):
                    return said
            waited += 0.1
        raise LoadError("the new program did not speak", self._state, RESTART)

    def _drain(self) -> None:
        self._collect(0.1)

    def _collect(self, seconds: float) -> bytes:
        heard, waited = b"", 0.0
        while waited < seconds:
            heard += self._read(0.05)
            waited += 0.05
        return heard

    def _write(self, data: bytes) -> None:
        self._transcript.note("we send", data)
        self._line.write(data)

    def _read(self, seconds: float) -> bytes:
        data = self._line.read(seconds)
        if data:
            self._transcript.note("it says", data)
        return data


def _shown(heard: bytes) -> str:
    text = heard[-60:].decode("ascii", "replace").strip()
    return repr(text)


def _listed(texts: tuple[bytes, ...]) -> str:
    return ", ".join(repr(t.decode()) for t in texts)
