"""A piece of a motion, from neutral to neutral, and pieces joined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.types import Array


@dataclass(frozen=True, eq=False)
class Segment:
    """A piece of a motion: rows of angles (K, n) [rad] in the model's order of joints at times (K,) [s], from neutral to neutral.

    base: on which it is played. long: it needs its length, as its signal grows with time; such a segment is played alone.
    """

    name: str
    base: str
    times: Array
    angles: Array
    long: bool = False

    @property
    def duration(self) -> float:
        """Length of the segment [s]."""
        return float(self.times[-1])


def join(segments: Sequence[Segment]) -> Segment:
    """Segments one after the other."""
    times, angles, at = [segments[0].times], [segments[0].angles], segments[0].duration
    for s in segments[1:]:
        times.append(s.times[1:] + at)
        angles.append(s.angles[1:])
        at += s.duration
    whole = np.asarray(np.round(np.concatenate(times), 3), dtype=float)
    return replace(segments[0], name="; ".join(s.name for s in segments), times=whole, angles=np.vstack(angles))
