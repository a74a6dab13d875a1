"""An emulated loader at the other end of a line, in virtual time: what a controller is after each thing that can go wrong.

Its texts are those of data/loaders, so it is a witness of the conversation's order and of every cut, not of the texts themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from workbench.device.controller.loader import LoaderProfile
from workbench.device.link import FrameType, frame

SETTLE = 0.5
"""Silence after which the loader takes what has come for the whole image [s]. The real one's rule is not known."""


POWERED_ON = frame(FrameType.STATE, bytes([0, 0, 0, 0, 2, 1, 255, 1, 0, 0, 111, 0]))
"""What our program says first after power-on."""


@dataclass
class Controller:
    """What stays in it: the program and whether the loader would run it."""

    program: bytes = b"factory"
    whole: bool = True

    @property
    def runs(self) -> str:
        """What it would start: "factory", "new", or "nothing"."""
        if not self.whole:
            return "nothing"
        return "factory" if self.program == b"factory" else "new"


class LineCutError(OSError):
    """The line is gone."""


class EmulatedLoader:
    """A line to a controller that is being switched on with the key held.

    cut_after: bytes over the line, both ways together, after which it is gone. says: replaces a text of the profile, by name.
    mute: never says anything. starts: what the program says when it is started (default: a STATE frame as ours).
    """

    def __init__(
        self, profile: LoaderProfile, controller: Controller, cut_after: int | None = None, says: dict[str, bytes] | None = None,
        mute: bool = False, starts: Callable[[bytes], bytes] | None = None,
    ) -> None:
        self._profile, self.controller = profile, controller
        self._cut_after, self._says, self._mute = cut_after, says or {}, mute
        self._starts = starts or (lambda program: POWERED_ON)
        self.crossed = 0
        self.time = 0.0
        self._out = b""
        self._command = b""
        self._mode = "key"
        self._image = b""
        self._last = 0.0

    def _text(self, name: str) -> bytes:
        if name in self._says:
            return self._says[name]
        profile = self._profile
        return {"banner": b"\r\n" + profile.identity[0] + b" loader\r\n" + profile.prompt[0], "prompt": profile.prompt[0],
                "ready": profile.ready[0], "success": profile.success[0]}[name]

    def write(self, data: bytes) -> None:
        """The PC sends."""
        for value in data:
            self._cross()
            self._take(bytes([value]))
        self.time += len(data) * 10 / self._profile.rate

    def read(self, seconds: float) -> bytes:
        """What comes within this time."""
        self.time += seconds
        self._settle()
        out, self._out = self._out, b""
        got = b""
        for value in out:
            self._cross()
            got += bytes([value])
        return got

    def _cross(self) -> None:
        if self._cut_after is not None and self.crossed >= self._cut_after:
            raise LineCutError(5, "Input/output error")
        self.crossed += 1

    def _say(self, text: bytes) -> None:
        if not self._mute:
            self._out += text

    def _take(self, value: bytes) -> None:
        self._last = self.time
        if self._mode == "key":
            if value == self._profile.key:
                self._mode = "command"
                self._say(self._text("banner"))
        elif self._mode == "image":
            self._image += value
        elif value == self._profile.line_end:
            self._obey(self._command.lstrip(self._profile.key))
            self._command = b""
        else:
            self._command += value
            self._say(value)  # echo

    def _obey(self, command: bytes) -> None:
        if command == self._profile.load:
            self._mode, self._image = "image", b""
            self.controller.whole = False  # erased
            self._say(b"\r\n" + self._text("ready") + b"..\r\n")
        elif command == self._profile.start and self.controller.whole:
            self._mode = "running"
            self._say(b"\r\n" + self._starts(self.controller.program))
        else:
            self._say(b"\r\n" + self._text("prompt"))

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
            self._say(b"\r\n" + self._text("success") + b"\r\n" + self._text("prompt"))
        else:
            self._say(b"\r\nFail\r\n" + self._text("prompt"))
