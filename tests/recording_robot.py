"""A small robot of our own and its captured motion, for tests of the recording room: two torso parts, four two-joint legs, link
frames that are turned in the zero pose, a joint about the forward axis."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.recording import BodyTrack, Recording
from workbench.recording.mocap.tracks import capture_axes, turn_quaternion, turn_vectors
from workbench.robot import RobotModel

_LEGS = {"fl": ("body", 0.06, 0.05), "fr": ("body", 0.06, -0.05), "bl": ("tail", -0.06, 0.05), "br": ("tail", -0.06, -0.05)}


def _link(name: str, pose: str, com: str) -> str:
    return (f'<link name="{name}"><pose>{pose}</pose><inertial><pose>{com} 0 0 0</pose><mass>0.1</mass><inertia><ixx>1e-4</ixx>'
            f"<iyy>1e-4</iyy><izz>1e-4</izz></inertia></inertial></link>")


def _joint(name: str, parent: str, child: str, axis: str) -> str:
    return (f'<joint name="{name}" type="revolute"><parent>{parent}</parent><child>{child}</child><axis>'
            f'<xyz expressed_in="__model__">{axis}</xyz><limit><lower>-2.6</lower><upper>2.6</upper><effort>1.5</effort></limit>'
            "</axis></joint>")


def write_robot(folder: Path) -> RobotModel:
    """Joints in order: blt blm brt brm flt flm frt frm tail, and a neck that is not tracked."""
    parts = [_link("body_link", "0 0 0.2 0 0 0", "0.03 0 0.01"), _link("tail_link", "-0.02 0 0.2 0.3 -0.2 0.5", "-0.03 0 0"),
             _joint("tail", "body_link", "tail_link", "0 -1 0"), _link("neck_link", "0.09 0 0.23 0 0 0", "0.01 0 0.02"),
             _joint("neck", "body_link", "neck_link", "0 -1 0")]
    for leg, (parent, x, y) in _LEGS.items():
        parts += [_link(f"{leg}t_link", f"{x} {y} 0.19 0.4 0.1 -0.7", "0 0 -0.01"),
                  _link(f"{leg}m_link", f"{x} {y * 1.2} 0.17 -0.2 0.3 0.2", "0 0 -0.04"),
                  _joint(f"{leg}t", f"{parent}_link", f"{leg}t_link", "-1 0 0"),
                  _joint(f"{leg}m", f"{leg}t_link", f"{leg}m_link", "0 1 0" if y > 0 else "0 -1 0")]
    path = folder / "robot.sdf"
    path.write_text(f'<?xml version="1.0"?><sdf version="1.9"><model name="small">{"".join(parts)}</model></sdf>')
    bodies = {"body": "body_link", "tail": "tail_link"} | {f"{leg.upper()}{p}": f"{leg}{p[0]}_link"
                                                           for leg in _LEGS for p in ("top", "mid")}
    return RobotModel(description=str(path), rigid_bodies=bodies)


@dataclass
class Captured:
    """What was put into a synthetic recording."""

    recording: Recording
    time: np.ndarray
    joints: tuple[str, ...]
    q: np.ndarray
    p_WB: np.ndarray
    yaw: float
    pivots: dict[str, np.ndarray]
    start: float


def motion(t: np.ndarray, n: int) -> np.ndarray:
    """Angles (N, n) [rad] from rest at t = 0 on: each joint swings at its own rate and size."""
    rate, size = 5 + 1.7 * np.arange(n), np.deg2rad(20 + 3 * np.arange(n))
    ease = 1 - np.exp(-np.maximum(t, 0)[:, None] / 0.05)
    return np.where(t[:, None] > 0, ease * size * np.sin(rate * np.maximum(t, 0)[:, None]), 0.0)


def capture(model: RobotModel, yaw: float = 0.7, start: float = 0.4137, seconds: float = 3.0, rate: float = 120.0,
            noise: float = 0.0, seed: int = 0, q: np.ndarray | None = None) -> Captured:
    """A walk-like path of the base and swinging joints, seen by cameras whose axes are turned by `yaw`."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate)) / rate
    joints = model.joints
    q = motion(time - start, len(joints)) if q is None else q
    moved = np.maximum(time - start, 0)
    p_WB = np.column_stack([0.05 * moved, 0.01 * np.sin(3 * moved), 0.2 + 0.005 * (1 - np.cos(7 * moved))])
    R_WB = Rotation.from_euler("ZYX", np.column_stack([0.1 * moved, 0.05 * np.sin(4 * moved), 0.04 * np.sin(5 * moved)]))
    poses = model.kinematics.forward(q, joints)
    offset = np.array([0.3, -0.2, 0.0])
    bodies, pivots = {}, {}
    for asset, link in model.rigid_bodies.items():
        pivots[asset] = model.kinematics.centers[link] + rng.normal(0, 0.01, 3)
        p, R = poses[link]
        p_W = p_WB + R_WB.apply(p + R @ pivots[asset])
        R_WL = R_WB * Rotation.from_matrix(R)
        since = R_WL * R_WL[0].inv()
        if noise:
            since = Rotation.from_rotvec(rng.normal(0, noise, (len(time), 3))) * since
            p_W = p_W + rng.normal(0, 1e-4, p_W.shape)
        quat = turn_quaternion(since.as_quat(scalar_first=True), yaw)
        bodies[asset] = BodyTrack(capture_axes(turn_vectors(p_W, yaw) + offset),
                                  np.column_stack([quat[:, 0], capture_axes(quat[:, 1:])]), np.full(len(time), 1e-4))
    recording = Recording(source="synthetic.csv", kind="motive", version="1.23", time=time, frames=np.arange(len(time)),
                          rate=rate, units="Meters", rigid_bodies=bodies, sensing="mocap")
    return Captured(recording, time, joints, q, p_WB, yaw, pivots, start)
