"""The raw content of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from workbench.motion.commands import Commands
from workbench.recording.body_track import BodyTrack
from workbench.types import Array

Sensing = Literal["mocap", "encoders"]
"""The sensors: cameras, which see bodies, or the servos' own encoders, which measure angles."""


@dataclass(frozen=True)
class Recording:
    """Raw content of a recording, in SI and radians but otherwise as in the file.

    kind: name of its format. sensing: the sensors. version: of the format, as in the file. rate: [Hz], NaN if irregular.
    frames: (N,) frame numbers. time: (N,) [s] from the first frame. rigid_bodies: asset -> path in the capture's axes
    (Motive: x forward up to a yaw, y up, z right). markers: name -> (N, 3) [m]. channels: joint channel
    ("goal.J", "speed.J" of moving, "position.J", "velocity.J", "duty.J", "current.J", "voltage", "temperature.J",
    "enabled.J") -> (N,). metadata: of the header. problems: one line each. notes: how it was logged, as found in
    it, one line each. nameless: the file does not name its one joint.
    aliases: names that the model may have for the joints, by those of the file.
    """

    source: str
    kind: str
    version: str
    time: Array
    frames: NDArray[np.int64]
    rate: float
    units: str = ""
    rigid_bodies: Mapping[str, BodyTrack] = field(default_factory=dict)
    markers: Mapping[str, Array] = field(default_factory=dict)
    channels: Mapping[str, Array] = field(default_factory=dict)
    commands: Commands | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    sensing: Sensing = "encoders"
    nameless: bool = False
    aliases: Mapping[str, str] = field(default_factory=dict)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that have channels, in the file's order."""
        return tuple(dict.fromkeys(c.partition(".")[2] for c in self.channels if "." in c))


@dataclass(frozen=True)
class Measurement:
    """How a robot was observed; simulated takes are observed in the same way.

    starts_at: time of the first command on the recording's clock [s]. yaw: of the model's first heading in the capture's axes,
    about up, positive to the left [rad]. origin: the base link's origin at rest in the capture's axes turned into the model's (z
    up) [m]. pivots: asset -> p_LP_L (3,) [m], the asset's pivot in its link's frame. rest: asset -> (p, quat wxyz) in the
    capture's axes at rest. noise: joint -> standard deviation [rad] at rest. position_noise [m]. rest_pose: joint -> servo angle
    [rad] at which the robot is taken to have stood (droop), rest_rotation (4,) wxyz: the base's tilt there; a recorded zero is
    this pose. joint_starts: start estimated from each joint alone [s]. frames: asset -> rotation vector (3,) [rad], in its own
    frame (the capture's axes, at rest), of the error of its stated orientation; about its pivot, which is unchanged. The rest are
    standard deviations.
    """

    starts_at: float
    yaw: float = 0.0
    origin: Array = field(default_factory=lambda: np.zeros(3))
    pivots: Mapping[str, Array] = field(default_factory=dict)
    rest: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    position_noise: float = float("nan")
    rest_pose: Mapping[str, float] = field(default_factory=dict)
    rest_rotation: Array = field(default_factory=lambda: np.array([1.0, 0, 0, 0]))
    joint_starts: Mapping[str, float] = field(default_factory=dict)
    starts_at_sigma: float = float("nan")
    yaw_sigma: float = float("nan")
    pivot_sigma: Mapping[str, Array] = field(default_factory=dict)
    frames: Mapping[str, Array] = field(default_factory=dict)
