"""Where every link of the robot was, frame by frame, in a take that may have gaps and unmeasured joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.recording.take import Take
from workbench.robot.feet import foot_points
from workbench.robot.model import RobotModel
from workbench.types import Array

STAND_CLEARANCE = 0.05
"""Height of the lowest point above the floor at which a robot on a stand is shown [m]; its real height does not matter."""


@dataclass(frozen=True)
class Playback:
    """Poses of all links in the world W at F frames.

    time: (F,) [s] since the first command. q: (F, n) [rad] in the model's order of joints. base_p (F, 3) [m] and base_R
    (F, 3, 3): pose of the base link in W. links: {link: (p (F, 3), R (F, 3, 3))} in the base link's frame.
    """

    time: Array
    q: Array
    base_p: Array
    base_R: Array
    links: Mapping[str, tuple[Array, Array]]

    def in_world(self, link: str) -> tuple[Array, Array]:
        """Pose of a link in W: p (F, 3) [m], R (F, 3, 3)."""
        p, R = self.links[link]
        return self.base_p + np.einsum("fij,fj->fi", self.base_R, p), self.base_R @ R


def since_start(take: Take) -> Array:
    """Time since the first command (N,) [s]; since the first frame if the time of the first command is unknown."""
    return take.since_start if np.isfinite(take.starts_at) else np.asarray(take.time - take.time[0])


def names_of(simulated: Take, recorded: Take | None) -> tuple[str, str]:
    """Names of the two takes in a legend: simulated and measured, or, for two simulations, their own names."""
    if recorded is None or recorded.source != "simulation":
        unseen = recorded is not None and recorded.base == "free" and recorded.p_WB is None
        return "simulated", "measured joints, body not recorded" if unseen else "measured"
    a, b = simulated.name, recorded.name
    return (a, b) if a != b else (f"{a} (1)", f"{b} (2)")


def common_span(takes: list[Take], lead: float = 0.3) -> tuple[float, float]:
    """First and last time [s] since the first command that all takes cover, at most `lead` before the first command.
    Takes that share no time give the first one's span."""
    spans = [(max(t[0], -lead), t[-1]) for t in map(since_start, takes)]
    first, last = max(s[0] for s in spans), min(s[1] for s in spans)
    return (first, last) if last > first else spans[0]


def play(take: Take, model: RobotModel, time: Array, like: tuple[Take, Playback] | None = None) -> Playback:
    """The take at `time` (F,) [s] since the first command.

    Gaps hold the last pose that was seen. `like`: another take of the same motion, and its playback at the same times. Joints
    that this take lacks follow it, and this take is aligned with it at rest, if it rested before the first command.
    """
    clock = since_start(take)
    q = _joints(take, model, time, clock, like)
    links = model.kinematics.forward(q, model.joints)
    if model.base != model.kinematics.root:
        links = _seen_from(links, model.base)
    p, R = _base(take, time, clock)
    if p is None or R is None:
        p, R = _unrecorded_base(time, like[1] if like else None, take.base == "fixed")
    elif like is not None:
        p, R = _laid_over(p, R, like[1], take.zeroed)
    played = Playback(time, q, p, R, links)
    return _on_a_stand(played, model) if like is None and (take.base == "fixed" or take.p_WB is None) else played


def _joints(take: Take, model: RobotModel, time: Array, clock: Array, like: tuple[Take, Playback] | None) -> Array:
    q = np.zeros((len(time), len(model.joints))) if like is None else like[1].q.copy()
    rest = np.zeros(len(model.joints))
    if like is not None and take.zeroed and not like[0].zeroed:  # zero is the pose in which it stood
        other = since_start(like[0]) < 0
        if other.any():
            for i, joint in enumerate(model.joints):
                if joint in like[0].joints:
                    rest[i] = float(np.nanmean(like[0].q[other, like[0].column(joint)]))
    for i, joint in enumerate(model.joints):
        if joint in take.joints:
            measured = take.q[:, take.column(joint)]
            if np.isfinite(measured).any():
                q[:, i] = _interpolate(time, clock, measured[:, None])[:, 0] + rest[i]
    return q


def _base(take: Take, time: Array, clock: Array) -> tuple[Array | None, Array | None]:
    if take.p_WB is None or take.quat_WB is None:
        return None, None
    if not (np.isfinite(take.p_WB).all(axis=1).any() and np.isfinite(take.quat_WB).all(axis=1).any()):
        return None, None
    quat = _interpolate(time, clock, take.quat_WB)
    return _interpolate(time, clock, take.p_WB), Rotation.from_quat(quat, scalar_first=True).as_matrix()


def _interpolate(time: Array, clock: Array, values: Array) -> Array:
    """Columns of `values` (N, k) at `time`: linear between neighbours, the last one seen in gaps, the nearest outside."""
    good = np.isfinite(values).all(axis=1)
    seen = np.flatnonzero(good)
    after = np.searchsorted(clock, time, side="right").clip(1, len(clock) - 1)
    before = after - 1
    span = clock[after] - clock[before]
    share = np.clip((time - clock[before]) / np.where(span > 0, span, 1), 0, 1)
    # the last good sample at or before each end of the interval; ahead of the first good one, that one
    last = seen[(np.searchsorted(seen, np.stack([before, after]), side="right") - 1).clip(0)]
    a, b = values[last[0]], values[last[1]]
    return np.asarray(a + (b - a) * share[:, None], dtype=float)


def _unrecorded_base(time: Array, other: Playback | None, held: bool) -> tuple[Array, Array]:
    """The pose for a base that was not recorded: the other take's, or its first one if the base was held; else level."""
    if other is not None:
        still = np.zeros(len(time), dtype=int) if held else np.arange(len(time))
        return other.base_p[still], other.base_R[still]
    return np.zeros((len(time), 3)), np.tile(np.eye(3), (len(time), 1, 1))


def _on_a_stand(played: Playback, model: RobotModel) -> Playback:
    """Just clear of the floor."""
    heights = [played.in_world(link)[0][:, 2].min() for link in played.links]
    for foot, (points, radii) in foot_points(model).items():
        p, R = played.in_world(model.foot_links[foot])
        heights.append((p[:, None, 2] + R[:, 2] @ points.T - radii).min())
    up = np.array([0.0, 0.0, STAND_CLEARANCE - min(heights)])
    return replace(played, base_p=played.base_p + up)


def _laid_over(p: Array, R: Array, other: Playback, zeroed: bool) -> tuple[Array, Array]:
    """The base rotated about the vertical and moved so that both takes coincide at rest. The attitude of a zeroed take is
    relative to its rest pose, so it is given the other's tilt at rest."""
    resting = other.time < 0 if (other.time < 0).any() else np.arange(len(other.time)) == 0
    R_rest, R_other = (Rotation.from_matrix(X[resting]).mean().as_matrix() for X in (R, other.base_R))
    turn = R_other @ R_rest.T
    yaw = np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
    Z = Rotation.from_rotvec([0, 0, yaw]).as_matrix()
    if zeroed:
        R = R @ (R_rest.T @ Z.T @ R_other)
    return other.base_p[resting].mean(axis=0) + (p - p[resting].mean(axis=0)) @ Z.T, Z @ R


def _seen_from(links: Mapping[str, tuple[Array, Array]], base: str) -> dict[str, tuple[Array, Array]]:
    p_B, R_B = links[base]
    R_BR = np.swapaxes(R_B, 1, 2)
    return {name: (np.einsum("fij,fj->fi", R_BR, p - p_B), R_BR @ R) for name, (p, R) in links.items()}
