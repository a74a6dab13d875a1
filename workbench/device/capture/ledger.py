"""Exact counts of the frames that were lost, late, doubled or broken."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

FAR = 5000
"""Frames from the last one at which a number is no longer believed to be of the same stream (20 s at 240 Hz)."""


@dataclass(frozen=True)
class Counts:
    """first, last: frame numbers. received: different frames that came whole. late: of these, after a later one. doubled: packets
    of a frame that was there. broken: packets not to be read. lost: frames between first and last of which nothing came."""

    first: int
    last: int
    received: int
    late: int
    doubled: int
    broken: int
    lost: int


@dataclass
class Ledger:
    """Takes note of each packet as it comes."""

    _seen: set[int] = field(default_factory=set)
    _broken: set[int] = field(default_factory=set)
    _unnamed: int = 0
    _late: int = 0
    _doubled: int = 0
    _total_broken: int = 0
    _first: int = -1
    _last: int = -1

    def frame(self, number: int) -> Literal["new", "late", "doubled", "far"]:
        """A whole frame; `far`, and not counted, where its number is of another stream: Motive was restarted or plays back."""
        if self._seen and not self.near(number):
            return "far"
        if number in self._seen:
            self._doubled += 1
            return "doubled"
        late = bool(self._seen) and number < self._last
        self._late += late
        self._first = min(self._first, number) if self._seen else number
        self._last = max(self._last, number)
        self._seen.add(number)
        return "late" if late else "new"

    def broken(self, number: int | None) -> None:
        """A packet that could not be read; its frame's number, if that could."""
        self._total_broken += 1
        if number is None or (self._seen and not self.near(number)):
            self._unnamed += 1
        else:
            self._broken.add(number)

    def near(self, number: int) -> bool:
        """Whether a number can be of this stream."""
        return abs(number - self._last) <= FAR

    @property
    def last(self) -> int:
        """Highest number so far, -1 before the first."""
        return self._last

    def counts(self) -> Counts:
        """As they stand now."""
        span = self._last - self._first + 1 if self._seen else 0
        never_whole = {n for n in self._broken - self._seen if self._first < n < self._last}
        lost = span - len(self._seen) - len(never_whole) - self._unnamed
        return Counts(self._first, self._last, len(self._seen), self._late, self._doubled, self._total_broken, max(lost, 0))
