"""An emulated loader at the other end of a line, in virtual time: the state of a controller after each possible fault.

Its texts are those of data/loaders, so it tests the conversation's order and every interruption, not the texts themselves.
Like a console it keeps every character that is typed, echoes it, and refuses unknown commands.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from workbench.device.controller.loader_profile import LoaderProfile
from workbench.device.link import FrameType, encode_frame

SETTLE = 0.5
"""Silence after which the loader takes the received bytes for the whole image [s]. The real one's rule is not known."""


POWERED_ON = encode_frame(FrameType.STATE, bytes([0, 0, 0, 0, 2, 1, 255, 1, 0, 0, 111, 0]))
"""What our program says first after power-on."""


@dataclass
class Controller:
    """What stays in it: the program and whether the loader would run it."""

    program: bytes = b"factory"
    whole: bool = True

    @property
    def runs(self) -> str:
        """The program that would start: "factory", "new", or "nothing"."""
        if not self.whole:
            return "nothing"
        return "factory" if self.program == b"factory" else "new"


class LineCutError(OSError):
    """The line is gone."""


class EmulatedLoader:
    """A line to a controller that is being switched on with the key held.

    cut_after: bytes over the line, both ways together, after which it is gone. says: replaces a text of the profile, by name.
    mute: never sends anything. starts: the program's message when it is started (default: our STATE frame). late: delay of each
    text [s], as over a USB adapter. deaf: hears nothing until the port has been closed and reopened. drops: how
    often the first character of LOAD is lost.
    """

    def __init__(
        self, profile: LoaderProfile, controller: Controller, cut_after: int | None = None, says: dict[str, bytes] | None = None,
        mute: bool = False, starts: Callable[[bytes], bytes] | None = None, late: float = 0.0, deaf: bool = False, drops: int = 0,
    ) -> None:
        self._late, self._deaf, self._drops = late, deaf, drops
        self.reopened = 0
        self.stays = False
        """Whether a reset would start the program: APP was sent."""
        self._profile, self.controller = profile, controller
        self._cut_after, self._says, self._mute = cut_after, says or {}, mute
        self._starts = starts or (lambda program: POWERED_ON)
        self.crossed = 0
        self.time = 0.0
        self._out: list[tuple[float, bytes]] = []
        self._command = b""
        self._mode = "key"
        self._image = b""
        self._last = 0.0

    def _text(self, name: str) -> bytes:
        if name in self._says:
            return self._says[name]
        profile = self._profile
        who = profile.identity[0]
        banner = b"\r\nSYSTEM O.K. (" + who + b" Boot loader V1.04)\r\nRead Protection: OFF\r\n" + profile.prompt[0]
        return {"banner": banner, "prompt": profile.prompt[0], "ready": profile.ready[0], "success": profile.success[0],
                "refused": profile.refused[0], "started": profile.started[0] + b"3845"}[name]

    def reopen(self) -> None:
        """The port is closed and opened again: it hears."""
        self.reopened += 1
        self._deaf = False

    def write(self, data: bytes) -> None:
        """The PC sends."""
        for value in data:
            self._cross()
            if not self._deaf:
                self._take(bytes([value]))
        self.time += len(data) * 10 / self._profile.rate

    def read(self, seconds: float) -> bytes:
        """Bytes received within this time."""
        self.time += seconds
        self._settle()
        out = b"".join(text for due, text in self._out if due <= self.time)
        self._out = [(due, text) for due, text in self._out if due > self.time]
        got = b""
        for value in out:
            self._cross()
            got += bytes([value])
        return got

    def _cross(self) -> None:
        if self._cut_after is not None and self.crossed >= self._cut_after:
            raise LineCutError(5, "Input/output error")
        self.crossed += 1

    def say(self, text: bytes) -> None:
        """Something that comes over the line, `late` from now."""
        if not self._mute:
            self._out.append((self.time + self._late, text))

    def _take(self, value: bytes) -> None:
        self._last = self.time
        if self._mode == "key":
            if value == self._profile.key:
                self._mode = "command"
                self.say(self._text("banner"))
        elif self._mode == "image":
            self._image += value
        elif value == self._profile.line_end:
            command, self._command = self._command, b""
            self._obey(command)
        elif self._drops and not self._command and value in self._profile.load[:1]:
            self._drops -= 1
        else:
            self._command += value
            self.say(value)  # echo

    def _obey(self, command: bytes) -> None:
        if command == self._profile.load:
            self._mode, self._image = "image", b""
            self.controller.whole = False  # erased
            self.say(b"\r\n" + self._text("ready") + b"..\r\n")
        elif command == self._profile.start and self.controller.whole:
            self._mode = "running"
            self.say(b"\r\n" + self._text("started") + b"\r\n" + self._starts(self.controller.program))
        elif command in (b"", self._profile.keep):
            self.stays = self.stays or command == self._profile.keep
            self.say(b"\r\n" + self._text("prompt"))
        else:
            self.say(b"\r\n" + self._text("refused") + b"\r\n" + self._text("prompt"))

    def _settle(self) -> None:
        """The image is over when nothing more comes; its sum decides."""
        if self._mode != "image" or not self._image or self.time - self._last < SETTLE:
            return
        body, total = self._image[:-1], self._image[-1]
        if not self._profile.byte_sum:
            body, total = self._image, sum(self._image) & 0xFF
        self._mode = "command"
        if sum(body) & 0xFF == total:
            self.controller.program, self.controller.whole = body, True
            self.say(b"\r\n" + self._text("success") + b"\r\n" + self._text("prompt"))
        else:
            self.say(b"\r\nFail\r\n" + self._text("prompt"))
