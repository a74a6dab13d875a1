"""What a long run is busy with, on stderr."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterable
from typing import TextIO

_WAITING: list[str] = []
"""Warnings that were not shown yet."""
QUIET = 1.5
"""Runs shorter than this say nothing [s], so that their errors stand alone."""


def warn(verb: str, lines: Iterable[str]) -> None:
    """Lines for stderr, shown once the run turns out to be long, or when it has ended well: where it is refused, the error stands
    alone."""
    _WAITING.extend(f"workbench {verb}: warning: {line}" for line in lines)


def show_warnings(stream: TextIO | None = None) -> None:
    """Shows what waits."""
    for line in _WAITING:
        print(line, file=stream or sys.stderr)
    _WAITING.clear()


def forget_warnings() -> None:
    """Of a run that was refused, or has not begun."""
    _WAITING.clear()


class Progress:
    """Call it as `progress(what)` or `progress(what, done)` with done in 0..1, inside its `with` block.

    On a terminal one line that is rewritten at most ten times a second and cleared at the end; elsewhere a plain line for each
    new `what`, and one every five seconds within it.
    """

    def __init__(self, verb: str, stream: TextIO | None = None, quiet: float | None = None) -> None:
        quiet = QUIET if quiet is None else quiet
        self._verb = verb
        self._stream = sys.stderr if stream is None else stream
        self._tty = self._stream.isatty()
        self._started = time.monotonic()
        self._last = -float("inf")
        self._now: tuple[str, float | None] = "", None
        self._shown = ""
        self._speaks = quiet <= 0
        self._lock = threading.Lock()
        self._timer = threading.Timer(quiet, self._speak)
        self._timer.daemon = True

    def __enter__(self) -> Progress:
        self._timer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()
        with self._lock:
            self._speaks = False
            if self._tty and self._shown:
                self._stream.write("\r\x1b[2K")
                self._stream.flush()

    def __call__(self, what: str, done: float | None = None) -> None:
        with self._lock:
            self._now = what, done
            if self._speaks:
                self._show()

    def _speak(self) -> None:
        """Once the run has turned out to be long: says what it is at, even if that takes a while yet."""
        with self._lock:
            self._speaks = True
            show_warnings(self._stream)
            if self._now[0]:
                self._show()

    def _show(self) -> None:
        what, done = self._now
        now = time.monotonic()
        if what == self._shown and now - self._last < (0.1 if self._tty else 5.0):
            return
        self._shown, self._last = what, now
        share = "" if done is None else f" {100 * min(max(done, 0.0), 1.0):.0f} %"
        line = f"workbench {self._verb}: {what}{share} ({now - self._started:.0f} s)"
        self._stream.write(f"\r\x1b[2K{line[:110]}" if self._tty else f"{line}\n")
        self._stream.flush()
