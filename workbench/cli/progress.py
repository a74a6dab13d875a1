"""What a long run is busy with, on stderr."""

from __future__ import annotations

import sys
import threading
import time
from typing import TextIO

from workbench.cli.log import LOGGER

QUIET = 1.5
"""Runs shorter than this say nothing [s], so that their errors stand alone."""
LEFT_AFTER = 5.0
"""A step has to have run that long [s] before the time that it still needs is told from its share done."""
_mode = {"silent": False}


def progress_mode(quiet: bool, verbose: bool) -> None:
    """Whether runs stay silent: with --quiet, and with --verbose, where the log speaks instead."""
    _mode["silent"] = quiet or verbose


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
        self._stage = "", self._started
        self._speaks = quiet <= 0 and not _mode["silent"]
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
            if what != self._stage[0]:
                self._stage = what, time.monotonic()
                LOGGER.debug("%s", what)
            self._now = what, done
            if self._speaks:
                self._show()

    def _speak(self) -> None:
        """Once the run has turned out to be long: says what it is at, even if that takes a while yet."""
        with self._lock:
            self._speaks = not _mode["silent"]
            if self._speaks and self._now[0]:
                self._show()

    def _show(self) -> None:
        what, done = self._now
        now = time.monotonic()
        if what == self._shown and now - self._last < (0.1 if self._tty else 5.0):
            return
        self._shown, self._last = what, now
        share = "" if done is None else f" {100 * min(max(done, 0.0), 1.0):.0f} %"
        line = f"workbench {self._verb}: {what}{share} ({now - self._started:.0f} s{self._left(done, now)})"
        self._stream.write(f"\r\x1b[2K{line[:110]}" if self._tty else f"{line}\n")
        self._stream.flush()

    def _left(self, done: float | None, now: float) -> str:
        """How long this step still takes, if it goes on as it did."""
        spent = now - self._stage[1]
        if done is None or not 0 < done < 1 or spent < LEFT_AFTER:
            return ""
        return f", {spent * (1 - done) / done:.0f} s left of this step"
