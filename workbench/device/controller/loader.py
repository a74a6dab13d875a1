"""Loading a program into the controller: a conversation with its loader, in which only texts count that a data file holds."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from workbench.device.controller.loader_profile import LoaderProfile
from workbench.device.link import FrameReader, FrameType, StateMessage, decode_message, encode_frame
from workbench.types import Progress, no_progress

FACTORY = ("This replaces ROBOTIS's own program in the controller. To get that back: RoboPlus Manager, 'Controller Firmware "
           "Management' (R+ Manager on newer systems), with the controller on USB; the loader itself cannot be overwritten.")
PROMPT_WAIT, ANSWER_WAIT, START_WAIT = 20.0, 5.0, 2.0
"""How long the user has to switch on, the loader to answer, and the program to speak [s]."""
DEAF, QUIET, PROMPT_AGAIN = 3.0, 0.2, 2.0
"""Silence after which the port is reopened while the key is held; silence after which the loader has finished; its time to
answer an empty line [s]. A USB adapter may hold bytes for 16 ms."""
CHUNK = 256


class Line(Protocol):
    """A serial line; OSError where it is gone."""

    def reopen(self) -> None:
        """Closes and opens it again: after a reset of the controller its PC link may hear nothing until then."""
        ...

    def write(self, data: bytes) -> None:
        """Sends."""
        ...

    def read(self, seconds: float) -> bytes:
        """Bytes received within this time; b"" for silence."""
        ...


class LoadError(RuntimeError):
    """Loading ended early. `what` happened; `state` of the controller now; `remedy`: what to do."""

    def __init__(self, what: str, state: str, remedy: str) -> None:
        self.what, self.state, self.remedy = what, state, remedy
        super().__init__(f"{what}; {state}; {remedy}")


UNTOUCHED = "the controller holds the program that it held before"
ASKED = "LOAD was sent and not answered, so the old program may or may not be erased; the loader is whole"
HALF = "the old program may be erased and the new one is not whole, so it may run nothing; its loader is whole"
MOVES = ("The robot will move: once started, the program checks all servos, switches their torque on and moves them "
         "slowly to neutral. Put it on a stand, with a hand on its switch.")
UNKNOWN = "the image was sent whole, but the loader did not confirm it; the new program may or may not run"
LOADED = "the new program is loaded but was not seen to start"
AGAIN = "switch it off, and run this again"
RESTART = "switch the controller off and on; if it stays dark, run this again"


@dataclass
class Transcript:
    """The whole conversation, with times [s since the beginning]; `text` is the version for a file."""

    lines: list[str] = field(default_factory=list)
    now: Callable[[], float] = clock.monotonic

    def __post_init__(self) -> None:
        self._began = self.now()

    def note(self, who: str, what: bytes | str) -> None:
        """Bytes as Python writes them, at most the first 200."""
        text = what if isinstance(what, str) else repr(what[:200])[1:] + (f" … {len(what)} bytes" if len(what) > 200 else "")
        self.lines.append(f"{self.now() - self._began:9.3f} {who}: {text}")

    @property
    def text(self) -> str:
        """One line for each piece."""
        return "\n".join(self.lines) + "\n"


class Loading:
    """One conversation: `run` has the image loaded and started, or raises LoadError. Progress hears (what, done)."""

    def __init__(self, line: Line, profile: LoaderProfile, transcript: Transcript,
                 progress: Progress = no_progress) -> None:
        self._line, self._profile, self._transcript, self._progress = line, profile, transcript, progress
        self._state = UNTOUCHED

    def run(self, image: bytes) -> StateMessage:
        """Returns the new program's first message."""
        try:
            self._find_prompt()
            self._load()
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
        waited, silent = 0.0, 0.0
        self._progress("1 of 4: waiting for the loader (switch the controller off and on)", None)
        while not self._at_prompt(heard):
            if waited > PROMPT_WAIT:
                self._nothing_known(heard, "while it was switched on")
            self._write(profile.key)
            new = self._read(profile.key_every)
            waited = 0.0 if new and not heard else waited + profile.key_every
            silent = 0.0 if new else silent + profile.key_every
            if silent >= DEAF:
                self._reopen()
                silent = 0.0
            heard = (heard + new)[-4096:]
        heard += self._fresh_prompt()
        if not any(name in heard for name in profile.identity):
            raise LoadError(f"the loader says {_excerpt(heard)}, which is no {profile.name} ({profile.source} knows "
                            f"{_join(profile.identity)})", self._state, "check which controller this is")

    def _fresh_prompt(self) -> bytes:
        """Clears its input line of keys typed after it began to listen: lines are ended until one is answered only by a prompt.
        Returns its whole output."""
        heard = self._until_quiet()
        for _ in range(5):
            self._write(self._profile.line_end)
            new = self._until_prompt(PROMPT_AGAIN)
            heard += new
            if self._at_prompt(new) and not any(text in new for text in self._profile.refused):
                return heard
        self._nothing_known(new, "at an empty line")
        return heard

    def _at_prompt(self, heard: bytes) -> bool:
        """Whether the last line received is a prompt and nothing else; echoes of our key may be mixed in."""
        last_line = heard.replace(self._profile.key, b"").replace(b"\r", b"\n").rsplit(b"\n", 1)[-1].strip()
        return last_line in self._profile.prompt

    def _load(self) -> None:
        """LOAD, once more where it was refused: the line may have garbled it. Refused, it erases nothing."""
        self._progress("2 of 4: asking it to load a program", None)
        profile = self._profile
        for last in (False, True):
            self._state = ASKED
            self._write(profile.load + profile.line_end)
            heard = self._expect(profile.ready, ANSWER_WAIT, "after LOAD", refused=profile.refused)
            if not any(text in heard for text in profile.refused):
                self._state = HALF  # from here on the old program is erased
                return
            self._state = UNTOUCHED
            if last:
                raise LoadError(f"the loader said {_excerpt(heard)} after LOAD", self._state, AGAIN)
            self._fresh_prompt()

    def _send(self, image: bytes) -> None:
        data = image + (bytes([sum(image) & 0xFF]) if self._profile.byte_sum else b"")
        self._transcript.note("we send", f"the image, {len(data)} bytes")
        for at in range(0, len(data), CHUNK):
            self._progress("3 of 4: sending the program", at / len(data))
            self._line.write(data[at:at + CHUNK])

    def _expect(self, texts: tuple[bytes, ...], seconds: float, when: str, refused: tuple[bytes, ...] = ()) -> bytes:
        """What the loader sends up to one of these texts, or one of `refused`; LoadError at a failure, or if none of them
        comes."""
        heard, waited = b"", 0.0
        while not any(text in heard for text in (*texts, *refused)):
            failed = [text for text in self._profile.failure if text in heard]
            if failed and not any(text.startswith(f) for f in failed for text in refused):
                raise LoadError(f"the loader said {_excerpt(heard)} {when}", self._state, AGAIN)
            if waited >= seconds:
                self._nothing_known(heard, when)
            new = self._read(0.1)
            waited += 0.1
            heard += new
        return heard

    def _nothing_known(self, heard: bytes, when: str) -> None:
        if not heard:
            raise LoadError(f"the loader was silent {when}", self._state, f"check cable, port and power; {AGAIN}")
        raise LoadError(f"the loader said {_excerpt(heard)} {when}, which {self._profile.source} does not hold", self._state,
                        f"if that is right, add it there; {AGAIN}")

    def _start(self) -> StateMessage:
        """Makes the program start after every reset; then starts it, and waits for its own message."""
        profile = self._profile
        self._progress("4 of 4: starting it", None)
        self._until_quiet()
        self._write(profile.keep + profile.line_end)
        answer = self._until_prompt(PROMPT_AGAIN)
        if any(text in answer for text in profile.refused):
            self._transcript.note("we note", f"{profile.keep.decode()} is unknown to it: it may wait for commands after a reset")
        self._fresh_prompt()
        self._write(profile.start + profile.line_end)
        for again in (False, True):
            found = self._first_word(b"" if not again else encode_frame(FrameType.ASK))
            if found is not None:
                return found
            self._reopen()
        raise LoadError("the new program did not speak", self._state, RESTART)

    def _first_word(self, ask: bytes) -> StateMessage | None:
        reader, waited = FrameReader(), 0.0
        while waited < START_WAIT:
            if ask:
                self._write(ask)
            for got in reader.feed(self._read(0.1)):
                content = decode_message(got)
                if isinstance(content, StateMessage):
                    return content
            waited += 0.1
        return None

    def _reopen(self) -> None:
        self._transcript.note("we note", "the port is closed and opened again")
        self._line.reopen()

    def _until_quiet(self) -> bytes:
        """What the loader sends until it has been silent for a while."""
        heard = new = self._collect(QUIET)
        while new:
            new = self._collect(QUIET)
            heard += new
            if len(heard) > 65536:
                break
        return heard

    def _until_prompt(self, seconds: float) -> bytes:
        heard, waited = b"", 0.0
        while waited < seconds and not self._at_prompt(heard):
            heard += self._read(0.05)
            waited += 0.05
        return heard + self._collect(QUIET)

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


def _excerpt(heard: bytes) -> str:
    text = heard[-60:].decode("ascii", "replace").strip()
    return repr(text)


def _join(texts: tuple[bytes, ...]) -> str:
    return ", ".join(repr(t.decode()) for t in texts)
