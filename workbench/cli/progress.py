"""Progress of a long run, on stderr."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterable, Sequence
from typing import TextIO

from workbench.cli.log import LOGGER

_WAITING: list[str] = []
"""Warnings that were not shown yet."""
QUIET = 1.5
"""Runs shorter than this print nothing [s], so that an error message appears alone."""
BEAT = 10.0
"""Longest silence [s]."""

_MODE = {"silent": False}


def progress_mode(quiet: bool, verbose: bool) -> None:
    """Whether runs show no progress: with --quiet, and with --verbose, where the log speaks instead."""
    _MODE["silent"] = quiet or verbose


def warn(verb: str, lines: Iterable[str]) -> None:
    """Adds warnings for stderr. They are shown once the run turns out to be long, or when it succeeds: if it is refused, only the
    error is shown."""
    warnings = [f"workbench {verb}: warning: {line}" for line in lines]
    for line in warnings:
        LOGGER.warning("%s", line)
    _WAITING.extend(warnings)


def show_warnings(stream: TextIO | None = None) -> None:
    """Shows the waiting warnings."""
    for line in _WAITING:
        print(line, file=stream or sys.stderr)
    _WAITING.clear()


def forget_warnings() -> None:
    """Drops the waiting warnings of a run that was refused, or has not begun."""
    _WAITING.clear()


class Progress:
    """Call it as `progress(what)` or `progress(what, done)` with done in 0..1, inside its `with` block.

    On a terminal one line that is rewritten at most ten times a second and cleared at the end; elsewhere a plain line for each
    new `what`, one every five seconds within it, and one every `BEAT` seconds without news. stages: the stages of the run in
    order, by how each `what` begins, so that a line can number them; where `done` is given, it also estimates the time that
    remains for the stage.
    """

    def __init__(self, verb: str, stream: TextIO | None = None, quiet: float | None = None, stages: Sequence[str] = ()) -> None:
        quiet = QUIET if quiet is None else quiet
        self._verb = verb
        self._stages, self._stage, self._entered = tuple(stages), 0, time.monotonic()
        self._ended = threading.Event()
        self._stream = sys.stderr if stream is None else stream
        self._tty = self._stream.isatty()
        self._started = time.monotonic()
        self._last = -float("inf")
        self._now: tuple[str, float | None] = "", None
        self._shown = ""
        self._speaks = quiet <= 0 and not _MODE["silent"]
        self._lock = threading.Lock()
        self._timer = threading.Timer(quiet, self._speak)
        self._timer.daemon = True

    def __enter__(self) -> Progress:
        self._timer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()
        self._ended.set()
        with self._lock:
            self._speaks = False
            if self._tty and self._shown:
                self._stream.write("\r\x1b[2K")
                self._stream.flush()

    def __call__(self, what: str, done: float | None = None) -> None:
        """Reports the current work and the share of it that is done."""
        with self._lock:
            if what.partition(" ")[0] != self._now[0].partition(" ")[0]:
                self._entered = time.monotonic()
            if what != self._now[0]:
                LOGGER.debug("%s", what)
            self._now = what, done
            for k, begins in enumerate(self._stages):
                if what.startswith(begins):
                    self._stage = max(self._stage, k + 1)
            if self._speaks:
                self._show()

    def _speak(self) -> None:
        """Once the run has turned out to be long: reports its current work, even if that takes much longer."""
        with self._lock:
            self._speaks = not _MODE["silent"]
            show_warnings(self._stream)
            if self._speaks and self._now[0]:
                self._show()
        threading.Thread(target=self._beats, daemon=True).start()

    def _beats(self) -> None:
        """Repeats the current stage from time to time."""
        while not self._ended.wait(BEAT):
            with self._lock:
                if self._speaks and self._now[0] and time.monotonic() - self._last >= BEAT:
                    self._show(again=True)

    def _show(self, again: bool = False) -> None:
        """Writes the line: at once if the stage (the text up to its first comma) has changed, else not too often. `again`: in any
        case."""
        what, done = self._now
        now = time.monotonic()
        same = what.partition(",")[0] == self._shown.partition(",")[0]
        if not again and same and now - self._last < (0.1 if self._tty else 5.0):
            return
        self._shown, self._last = what, now
        share = "" if done is None else f" {100 * min(max(done, 0.0), 1.0):.0f} %"
        stage = f"{self._stage} of {len(self._stages)}, " if self._stage else ""
        spent = now - self._entered
        shows_remaining = done is not None and 0.05 < done < 1 and spent > 5
        left = f", about {spent * (1 / done - 1):.0f} s left of this" if done is not None and shows_remaining else ""
        line = f"workbench {self._verb}: {stage}{what}{share} ({now - self._started:.0f} s{left})"
        self._stream.write(f"\r\x1b[2K{line[:110]}" if self._tty else f"{line}\n")
        self._stream.flush()
