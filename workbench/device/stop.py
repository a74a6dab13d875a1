"""Being asked to stop: Ctrl-C, a closed terminal, `kill`."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

WORDS = {"SIGINT": "Ctrl-C", "SIGTERM": "terminated (SIGTERM)", "SIGHUP": "the terminal was closed (SIGHUP)"}
TWICE = ", twice"


@dataclass
class Stop:
    """reason: "" until one of the signals comes. A second signal changes it: whoever still moves a robot then lets go at once.
    interrupted: whether the first signal was Ctrl-C."""

    reason: str = ""
    signals: int = 0

    def __call__(self) -> bool:
        """Whether to stop."""
        return bool(self.reason)

    @property
    def interrupted(self) -> bool:
        """Whether the first signal was Ctrl-C."""
        return self.reason.startswith(WORDS["SIGINT"])

    def ask(self, word: str) -> None:
        """Counts a signal. KeyboardInterrupt from the third on, so that a program that looks at nothing ends, too."""
        self.signals += 1
        if self.signals == 1:
            self.reason = word
        elif self.signals == 2:
            self.reason += TWICE
        else:
            raise KeyboardInterrupt


@contextmanager
def stop_on_signals() -> Iterator[Stop]:
    """Within the block the first two signals end nothing by themselves: whoever runs a loop looks at the `Stop` and ends in good
    order at the first, at once at the second. A third one raises KeyboardInterrupt."""
    stop = Stop()

    def ask(number: int, frame: FrameType | None) -> None:
        stop.ask(WORDS[signal.Signals(number).name])

    before = {name: signal.signal(getattr(signal, name), ask) for name in WORDS if hasattr(signal, name)}
    try:
        yield stop
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)
