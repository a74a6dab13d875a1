"""What a long run is busy with, on stderr."""

from __future__ import annotations

import sys
import time
from typing import TextIO


class Progress:
    """Call it as `progress(what)` or `progress(what, done)` with done in 0..1.

    On a terminal one line that is rewritten at most ten times a second; elsewhere a plain line for each new `what`, and
    one every five seconds within it. Use it as a context manager: the line is cleared at the end.
    """

    def __init__(self, verb: str, stream: TextIO | None = None) -> None:
        self._verb = verb
        self._stream = sys.stderr if stream is None else stream
        self._tty = self._stream.isatty()
        self._started = time.monotonic()
        self._last = -float("inf")
        self._what = ""

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._tty and self._what:
            self._stream.write("\r\x1b[2K")
            self._stream.flush()

    def __call__(self, what: str, done: float | None = None) -> None:
        now = time.monotonic()
        if what == self._what and now - self._last < (0.1 if self._tty else 5.0):
            return
        self._what, self._last = what, now
        share = "" if done is None else f" {100 * min(max(done, 0.0), 1.0):.0f} %"
        line = f"workbench {self._verb}: {what}{share} ({now - self._started:.0f} s)"
        self._stream.write(f"\r\x1b[2K{line[:110]}" if self._tty else f"{line}\n")
        self._stream.flush()
