"""The path of one rigid body."""

from __future__ import annotations

from dataclasses import dataclass

from workbench.types import Array


@dataclass(frozen=True)
class BodyTrack:
    """Path of a frame in the world of its take (x forward, y left, z up), or, as a Motive file holds it, in the capture's axes.

    p: (N, 3) [m], of the frame's origin: of a tracked rigid body its pivot. quat: (N, 4) wxyz, continuous in sign. Both NaN where
    unseen. error: (N,) [m], mean marker error of each frame, where the recording has it.
    """

    p: Array
    quat: Array
    error: Array | None = None

    def first(self, frames: int) -> BodyTrack:
        """The track's first frames."""
        return BodyTrack(self.p[:frames], self.quat[:frames], None if self.error is None else self.error[:frames])
