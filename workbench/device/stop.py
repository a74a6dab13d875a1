"""Being asked to stop: Ctrl-C, a closed terminal, `kill`."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

WORDS = {"SIGINT": "Ctrl-C", "SIGTERM": "terminated (SIGTERM)", "SIGHUP": "the terminal was closed (SIGHUP)"}


@dataclass
class Stop:
    """reason: "" until one of the signals comes."""

    reason: str = ""

    def __call__(self) -> bool:
        """Whether to stop."""
        return bool(self.reason)


@contextmanager
def stop_on_signals() -> Iterator[Stop]:
    """Within the block the signals end nothing by themselves: whoever runs a loop looks at the `Stop` and ends in good order."""
    stop = Stop()

    def ask(number: int, frame: FrameType | None) -> None:
        stop.reason = stop.reason or WORDS[signal.Signals(number).name]

    before = {name: signal.signal(getattr(signal, name), ask) for name in WORDS if hasattr(signal, name)}
    try:
        yield stop
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)
