"""Small robots with which tests ask another engine for closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from studies.other_engine import Rollout
from workbench.motion.commands import Commands
from workbench.recording import Take
from workbench.robot import EffectSpec, Ground, RobotModel, ServoConstants

FRICTIONLESS = ServoConstants(
    coulomb_friction=0.0, viscous_friction=0.0, reflected_inertia=1e-4, compliance_margin=0, punch=0)


def model_of(path: Path, sdf: str, servo: ServoConstants = FRICTIONLESS, effects: tuple[EffectSpec, ...] = ()) -> RobotModel:
    """A robot from SDF text, written to `path`."""
    path.write_text(f'<?xml version="1.0"?><sdf version="1.9"><model name="robot">{sdf}</model></sdf>', encoding="utf-8")
    model = RobotModel(description=str(path), base="base", ground=Ground(friction=0.6, stiffness=1e5), effects=effects)
    return RobotModel(description=str(path), base="base", ground=model.ground, effects=effects,
                      servos=dict.fromkeys(model.joints, servo))


def link(name: str, pose: str, mass: float, com: str, inertia: str = "1e-4 2e-4 3e-4 1e-5 -2e-5 3e-5", inside: str = "") -> str:
    """A link; inertia: ixx iyy izz ixy ixz iyz about the centre of mass."""
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    tensor = "".join(f"<{k}>{v}</{k}>" for k, v in zip(keys, inertia.split()))
    return (f'<link name="{name}"><pose>{pose}</pose><inertial><pose>{com}</pose><mass>{mass}</mass>'
            f"<inertia>{tensor}</inertia></inertial>{inside}</link>")


def joint(name: str, parent: str, child: str, axis: str, pose: str = "0 0 0 0 0 0") -> str:
    """A revolute joint with 2.6 rad of range to each side; pose in the child."""
    return (f'<joint name="{name}" type="revolute"><pose>{pose}</pose><parent>{parent}</parent><child>{child}</child>'
            f"<axis><xyz>{axis}</xyz><limit><lower>-2.6</lower><upper>2.6</upper><effort>1.5</effort></limit></axis></joint>")


def sphere(x: float, y: float, z: float, radius: float = 0.005) -> str:
    """A contact sphere, as stiff as a foot of the practice robot."""
    return (f'<collision name="s{x}{y}"><pose>{x} {y} {z} 0 0 0</pose><geometry><sphere><radius>{radius}</radius></sphere>'
            '</geometry><drake:proximity_properties xmlns:drake="http://drake.mit.edu">'
            "<drake:point_contact_stiffness>100000</drake:point_contact_stiffness><drake:mu_static>0.6</drake:mu_static>"
            "<drake:mu_dynamic>0.6</drake:mu_dynamic></drake:proximity_properties></collision>")


CROOKED = "".join([
    link("base", "0 0 0.2 0.1 -0.2 0.3", 0.4, "0.03 0.01 0.014 0.2 0 0.1"),
    link("upper", "0.06 0.05 0.18 0.4 0.3 -0.2", 0.12, "0.002 0.01 -0.04 0 0.3 0"),
    link("lower", "0.06 0.07 0.09 -0.3 0.2 0.5", 0.05, "0.01 0 -0.036 0 0 0"),
    link("arm", "-0.05 0 0.25 0 0 1", 0.08, "0 0.02 0.02 0 0 0"),
    joint("hip", "base", "upper", "0.3 0.9 0.1", "0.01 -0.02 0.03 0.2 0.1 0"),
    joint("knee", "upper", "lower", "0 1 0.2", "0 0.005 0.01 0 0 0.4"),
    joint("shoulder", "base", "arm", "0 0 1"),
])
"""Three joints, with every frame and every inertia askew."""


def pendulum(mass: float, length: float, axis: str = "0 1 0") -> str:
    """A point-like mass on a rod that hangs from the base: turning about `axis`."""
    tiny = "1e-7 1e-7 1e-7 0 0 0"
    return (link("base", "0 0 0 0 0 0", 1.0, "0 0 0 0 0 0") + link("bob", "0 0 0 0 0 0", mass, f"0 0 {-length} 0 0 0", tiny)
            + joint("swing", "base", "bob", axis))


def commands(
    times: list[float], goals: list[float], end: float, enabled: list[bool] | None = None, speed: float = 0.0
) -> Commands:
    """Commands of the pendulum's one joint: goals [rad] at times [s]."""
    n = len(times)
    on = np.ones((n, 1), dtype=bool) if enabled is None else np.array(enabled, dtype=bool)[:, None]
    return Commands(np.array(times), ("swing",), np.array(goals, dtype=float)[:, None], np.full((n, 1), speed), on, end,
                    np.full(n, -1))


def as_take(run: Rollout, base: str = "body_link") -> Take:
    """The other engine's run as a simulated take of the workbench."""
    p, R = run.poses(run.time, (base,))[base]
    quat = Rotation.from_matrix(R).as_quat(scalar_first=True)
    return Take("other engine", "simulation", run.time, run.joints, run.q, starts_at=0.0, p_WB=p, quat_WB=quat)
