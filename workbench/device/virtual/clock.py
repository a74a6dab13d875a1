"""One virtual clock for servos, controller, host and body: integer ticks, one queue of events, no thread and no sleep."""

from __future__ import annotations

import heapq
from collections.abc import Callable

SECOND = 72_000_000
"""Ticks in a second: cycles of the CM-530's processor, so that its times and those of 1 Mbit/s and 57,600 bit/s are whole."""
NEVER = 2**62
"""Later than anything [ticks]."""
MILLISECOND = SECOND // 1000
MICROSECOND = SECOND // 1_000_000


def seconds(ticks: int) -> float:
    """Ticks as seconds."""
    return ticks / SECOND


class Clock:
    """Virtual time [ticks], and what happens when. Events of one time happen in the order in which they were asked for."""

    def __init__(self) -> None:
        self.now = 0
        self.next_time = NEVER
        """Time of the next event [ticks], or NEVER."""
        self._events: list[tuple[int, int, Callable[[], None]]] = []
        self._count = 0

    def at(self, time: int, action: Callable[[], None]) -> None:
        """Has `action` called at a time [ticks]; a time gone by means at the next advance."""
        self._count += 1
        heapq.heappush(self._events, (max(time, self.now), self._count, action))
        self.next_time = self._events[0][0]

    def after(self, ticks: int, action: Callable[[], None]) -> None:
        """Has `action` called so many ticks from now."""
        self.at(self.now + ticks, action)

    def advance(self, until: int) -> None:
        """Lets everything happen that is due up to and at `until` [ticks], each at its own time."""
        events = self._events
        while events and events[0][0] <= until:
            time, _, action = heapq.heappop(events)
            self.next_time = events[0][0] if events else NEVER
            self.now = max(self.now, time)
            action()
        self.now = max(self.now, until)
