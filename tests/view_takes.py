"""A small robot and takes of it, made from kinematics alone, for the tests of what is drawn."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.motion.commands import Commands
from workbench.recording.take import Take
from workbench.robot import RobotModel

INERTIAL = "<inertial><mass>{m}</mass><inertia><ixx>1e-3</ixx><iyy>1e-3</iyy><izz>1e-3</izz></inertia></inertial>"
LINK = """
<link name="{name}"><pose>{place} 0 0 0</pose>{inertial}
<visual name="v"><geometry><box><size>{size}</size></box></geometry></visual>{more}</link>"""
JOINT = """
<joint name="{name}" type="revolute"><parent>{parent}</parent><child>{name}_link</child><axis><xyz>0 1 0</xyz>
<limit><lower>-2</lower><upper>2</upper><effort>1.5</effort></limit></axis></joint>"""
FOOT = """
<collision name="foot"><pose>0 0 -0.045 0 0 0</pose><geometry><sphere><radius>0.005</radius></sphere></geometry></collision>"""


def _leg(side: str, y: float) -> str:
    def link(part: str, z: float, more: str = "") -> str:
        return LINK.format(name=f"{side}{part}_link", place=f"0 {y} {z}", inertial=INERTIAL.format(m=0.1), size="0.02 0.02 0.05",
                           more=more)

    return (link("m", 0.1) + JOINT.format(name=f"{side}m", parent="body_link")
            + link("b", 0.05, FOOT) + JOINT.format(name=f"{side}b", parent=f"{side}m_link"))


def small_robot(folder: Path) -> RobotModel:
    """A body on two legs of two joints each: flm, flb, frm, frb."""
    path = folder / "small.sdf"
    body = LINK.format(name="body_link", place="0 0 0.1", inertial=INERTIAL.format(m=0.5), size="0.1 0.08 0.03", more="")
    legs = _leg("fl", 0.05) + _leg("fr", -0.05)
    path.write_text(f'<?xml version="1.0"?>\n<sdf version="1.9"><model name="small">{body}{legs}\n</model></sdf>\n')
    return RobotModel(description=str(path))


def swing(model: RobotModel, duration: float = 1.2, delay: float = 0.0) -> Take:
    """A simulation: legs swing in opposite phase from time 0 on, the body goes 0.1 m/s forward and turns to the left."""
    t = np.arange(-0.3, duration, 2e-3)
    s = np.clip(t - delay, 0, None)
    phase = {"l": 0.0, "r": np.pi}
    q = np.column_stack([0.3 * (np.sin(8 * s + phase[j[1]]) - np.sin(phase[j[1]])) for j in model.joints])
    yaw = 0.2 * np.clip(t, 0, None)
    p = np.column_stack([0.1 * np.clip(t, 0, None), 0.01 * yaw, np.full_like(t, 0.1)])
    left = np.where(np.sin(8 * t) >= 0, 7.0, 0.0)
    force = {f: np.column_stack([0 * t, 0 * t, n]) for f, n in (("flb", left), ("frb", 7.0 - left))}
    times = np.arange(0, duration, 0.1)
    goals = np.column_stack([0.3 * np.sin(8 * times)] * len(model.joints))
    commands = Commands(times, model.joints, goals, np.full_like(goals, 3.0), np.ones_like(goals, dtype=bool), duration,
                        np.zeros(len(times), dtype=int))
    quat = Rotation.from_rotvec(np.outer(yaw, [0, 0, 1])).as_quat(scalar_first=True)
    return Take("swing", "simulation", t, model.joints, q, starts_at=0.0, p_WB=p, quat_WB=quat, contact=force,
                commands=commands, v=np.gradient(q, t, axis=0), torque=0.2 * q)


def capture(take: Take, joints: tuple[str, ...] | None = None, noise: float = 1e-3, gap: slice = slice(60, 80)) -> Take:
    """The take as a capture saw it: 120 Hz, on its own clock, zeroed, with noise and a gap, some joints only."""
    seen = take.zeroed_at_rest().resampled(np.arange(-0.25, take.time[-1], 1 / 120))
    joints = joints or take.joints
    q = seen.q[:, [take.column(j) for j in joints]] + np.random.default_rng(3).normal(0, noise, (len(seen), len(joints)))
    assert seen.p_WB is not None
    assert seen.quat_WB is not None
    p, quat = seen.p_WB.copy(), seen.quat_WB.copy()
    q[gap] = p[gap] = quat[gap] = np.nan
    return replace(seen, source="capture.csv", time=seen.time + 0.4, starts_at=0.4, joints=joints, q=q, p_WB=p, quat_WB=quat,
                   v=None, torque=None, contact={}, commands=None)
