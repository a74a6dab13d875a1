"""A take: one run of the robot, recorded or simulated, in one form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from workbench.motion.commands import Commands
from workbench.recording.body_track import BodyTrack
from workbench.types import Array, Mask


@dataclass(frozen=True)
class Take:
    """One run of the robot, recorded or simulated. SI and radians; world W: x forward (the robot's first heading), y left, z up.
    A field is None, or empty, where it was not measured or computed.

    source: "recording", "simulation" or "playback". time: (N,) [s], from the first frame (a recording), or from the first command
    (a simulation, negative while it rests). starts_at: time of the first command [s]; NaN where unknown. base: "free", "fixed" or
    "path". commands: commands sent to the servos, time zero at the first one. problems: repaired, marked or omitted
    parts, a line each. mended: (N,) frames whose gaps were filled.

    joints: names of the n joints that were seen. q: (N, n) [rad]; NaN where unseen. zeroed: q is zero at the rest before the
    first command, as motion capture sees it; else q is the angle itself. q_sigma: (N, n) standard deviation of q [rad]. v: (N, n)
    [rad/s]. torque: (N, n) [N m] on the joints. off_axis: (N, n, 3) [rad], each joint's rotation about other axes than its
    servo's, as a rotation vector in the base's axes in the neutral pose (forward, left, up).

    p_WB (N, 3) [m], quat_WB (N, 4) wxyz: pose of the base link's frame B in W. bodies: path of each rigid body that cameras
    track, by the name of its Motive asset (`RobotModel.rigid_bodies` gives its link), in W. contact: force of the
    ground on each foot (N, 3) [N] in W, by foot, which has the name of the last joint that moves it (the knee;
    `RobotModel.foot_links`).

    Only of a simulated robot that is not built as its model (effects of the structure): servo_q (N, n) [rad], the servo's own
    angle as its sensor measures it, where q is the link's; links, by name the path of each link's frame in W.
    """

    name: str
    source: str
    time: Array
    joints: tuple[str, ...]
    q: Array
    starts_at: float = float("nan")
    zeroed: bool = False
    base: str = "free"
    q_sigma: Array | None = None
    v: Array | None = None
    p_WB: Array | None = None
    quat_WB: Array | None = None
    bodies: Mapping[str, BodyTrack] = field(default_factory=dict)
    torque: Array | None = None
    contact: Mapping[str, Array] = field(default_factory=dict)
    commands: Commands | None = None
    problems: tuple[str, ...] = ()
    mended: Mask | None = None
    off_axis: Array | None = None
    servo_q: Array | None = None
    links: Mapping[str, BodyTrack] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time)

    def column(self, joint: str) -> int:
        """Index of a joint's column in q, v and torque."""
        return self.joints.index(joint)

    def as_logged(self) -> Take:
        """The take as the servos' own sensors see it: q on their side of play and springs."""
        return self if self.servo_q is None else replace(self, q=self.servo_q)

    @property
    def since_start(self) -> Array:
        """Time since the first command (N,) [s]."""
        return self.time - self.starts_at

    @property
    def resting(self) -> Mask:
        """Frames before the first command."""
        return np.asarray(self.time < self.starts_at - 1e-9)

    def zeroed_at_rest(self) -> Take:
        """The same take with q zero at its own rest before the first command, as motion capture would see it."""
        if self.zeroed or not self.resting.any():
            return self
        return replace(self, q=self.q - np.nanmean(self.q[self.resting], axis=0), zeroed=True)

    def first(self, frames: int) -> Take:
        """The take's first frames."""
        def cut(column: Array | None) -> Array | None:
            return None if column is None else column[:frames]

        return replace(
            self, time=self.time[:frames], q=self.q[:frames], q_sigma=cut(self.q_sigma), v=cut(self.v), p_WB=cut(self.p_WB),
            quat_WB=cut(self.quat_WB), torque=cut(self.torque), off_axis=cut(self.off_axis), servo_q=cut(self.servo_q),
            mended=None if self.mended is None else self.mended[:frames],
            contact={foot: force[:frames] for foot, force in self.contact.items()},
            bodies={name: track.first(frames) for name, track in self.bodies.items()},
            links={name: track.first(frames) for name, track in self.links.items()})

    def resampled(self, time: Array) -> Take:
        """The take at other times (M,) [s] on its own clock, linear between samples, NaN outside and in gaps."""
        from workbench.recording import quaternions as quat

        time = np.asarray(time, dtype=float)

        def hold(row: Array) -> Array:
            inside = (time >= self.time[0]) & (time <= self.time[-1])
            return np.broadcast_to(row, (len(time), len(row))) if inside.all() else np.where(inside[:, None], row, np.nan)

        def linear(y: Array | None) -> Array | None:
            if y is None:
                return None
            if _is_repeated(y):
                return hold(y[0])
            return np.column_stack([np.interp(time, self.time, c, left=np.nan, right=np.nan) for c in y.T])

        def resample_tracks(tracks: Mapping[str, BodyTrack]) -> dict[str, BodyTrack]:
            return {k: BodyTrack(p=linear(b.p), quat=slerp(b.quat)) for k, b in tracks.items()}  # type: ignore[arg-type]

        def slerp(q: Array | None) -> Array | None:
            if q is None:
                return None
            if _is_repeated(q):
                return hold(q[0])
            out = np.full((len(time), 4), np.nan)
            good = np.isfinite(q).all(axis=1)
            if good.sum() < 2:
                return out
            inside = (time >= self.time[good][0]) & (time <= self.time[good][-1])
            if (q[good] == q[good][0]).all():  # a base that is held
                out[inside] = q[good][0]
            else:
                out[inside] = quat.interpolate(self.time[good], q[good], time[inside])
            out[inside & ~np.isfinite(np.interp(time, self.time, q[:, 0]))] = np.nan
            return out

        off = self.off_axis
        return replace(
            self, time=time, q=linear(self.q),  # type: ignore[arg-type]
            off_axis=None if off is None else linear(off.reshape(len(off), -1)).reshape(len(time), *off.shape[1:]),  # type: ignore[union-attr]
            q_sigma=linear(self.q_sigma), v=linear(self.v), p_WB=linear(self.p_WB),
            quat_WB=slerp(self.quat_WB), torque=linear(self.torque), mended=None, servo_q=linear(self.servo_q),
            bodies=resample_tracks(self.bodies), links=resample_tracks(self.links),
            contact={k: linear(f) for k, f in self.contact.items()},  # type: ignore[misc]
        )


def _is_repeated(y: Array) -> bool:
    """Whether it is one row, seen and stored once, as the pose of a base that is held."""
    return len(y) > 1 and y.strides[0] == 0 and bool(np.isfinite(y[0]).all())
