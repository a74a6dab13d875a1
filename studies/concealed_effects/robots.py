"""Robots of the trial: quadrupeds, arms and rigs of our own, each a little different; and the puppy."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from workbench.robot import BUS_IDS, RIGID_BODIES, Ground, RobotModel, ServoConstants, puppy_model

Rng = np.random.Generator
FOOT_STIFFNESS, FOOT_DISSIPATION = 1e5, 20.0


@dataclass(frozen=True)
class Robot:
    """kind: "quadruped", "puppy", "arm" or "rig". sdf: its file's text, empty for the puppy, which ships. servo: of all joints.
    rigid_bodies: asset -> link; empty where joints are logged and nothing is filmed."""

    kind: str
    sdf: str
    servo: ServoConstants
    ground: Ground
    base: str
    rigid_bodies: dict[str, str] = field(default_factory=dict)
    bus_ids: dict[str, int] = field(default_factory=dict)

    def model(self, path: Path) -> RobotModel:
        """The robot as plain data; `path`: where its SDF is, or is to be written."""
        if self.sdf and not path.exists():
            path.write_text(self.sdf, encoding="utf-8")
        model = RobotModel(description=str(path), base=self.base) if self.sdf else puppy_model()
        return RobotModel(description=model.description, base=model.base, servos=dict.fromkeys(model.joints, self.servo),
                          ground=self.ground, rigid_bodies=self.rigid_bodies, bus_ids=self.bus_ids)


def puppy(rng: Rng) -> Robot:
    """The puppy that ships, on a floor of its own."""
    ground = Ground(friction=round(float(rng.uniform(0.45, 0.7)), 2), stiffness=1e5, dissipation=20.0)
    return Robot("puppy", "", _servo(rng), ground, "body_link", dict(RIGID_BODIES), dict(BUS_IDS))


def quadruped(rng: Rng) -> Robot:
    """Fifteen joints with the puppy's names, other masses and lengths for each seed; front knees back, hind knees forward."""
    thigh, shank, top = rng.uniform(0.070, 0.088), rng.uniform(0.076, 0.092), rng.uniform(0.013, 0.02)
    half_length, half_width, drop = rng.uniform(0.056, 0.07), rng.uniform(0.046, 0.058), rng.uniform(0.008, 0.016)
    height = drop + top + thigh + shank
    masses = dict(zip(("body", "tail", "t", "m", "b", "neck", "head"),
                      rng.uniform([0.34, 0.17, 0.02, 0.09, 0.03, 0.045, 0.06], [0.5, 0.27, 0.05, 0.14, 0.045, 0.07, 0.1])))
    links = [_link("body_link", (0, 0, height), masses["body"], (0.03, 0, 0.015), (0.11, 0.08, 0.05)),
             _link("tail_link", (-0.015, 0, height), masses["tail"], (-0.035, 0, 0.005), (0.07, 0.07, 0.045))]
    joints = [_joint("tail", "body_link", "tail_link", "0 -1 0")]
    for leg, x, y, sign in (("fl", 1, 1, 1), ("fr", 1, -1, -1), ("bl", -1, 1, -1), ("br", -1, -1, 1)):
        trunk = "body_link" if x > 0 else "tail_link"
        at = np.array([x * half_length, y * half_width, height - drop])
        hip = at + np.array([0, y * 0.006, -top])
        knee = hip + np.array([0, 0, -thigh])
        links += [
            _link(f"{leg}t_link", at, masses["t"], (0, 0, -0.007), (0.038, 0.034, 0.045)),
            _link(f"{leg}m_link", hip, masses["m"], (0.003, 0, -thigh / 2), (0.036, 0.044, thigh + 0.02)),
            _link(f"{leg}b_link", knee, masses["b"], (0, 0, -0.42 * shank), (0.024, 0.03, shank - 0.008), _foot(shank)),
        ]
        joints += [_joint(f"{leg}t", trunk, f"{leg}t_link", "-1 0 0"),
                   _joint(f"{leg}m", f"{leg}t_link", f"{leg}m_link", f"0 {sign} 0"),
                   _joint(f"{leg}b", f"{leg}m_link", f"{leg}b_link", f"0 {-sign} 0")]
    links += [_link("neck_link", (0.085, 0, height + 0.03), masses["neck"], (0.008, 0, 0.022), (0.032, 0.032, 0.055)),
              _link("head_link", (0.105, 0, height + 0.075), masses["head"], (0.024, 0, 0.004), (0.06, 0.045, 0.04))]
    joints += [_joint("neck", "body_link", "neck_link", "0 -1 0"), _joint("head", "neck_link", "head_link", "0 -1 0")]
    ground = Ground(friction=round(float(rng.uniform(0.5, 0.75)), 2), stiffness=1e5, dissipation=20.0)
    sdf = _sdf("quadruped", links + joints)
    return Robot("quadruped", sdf, _servo(rng), ground, "body_link", dict(RIGID_BODIES), dict(BUS_IDS))


def arm(rng: Rng) -> Robot:
    """A base and three joints, shoulder, elbow and wrist, that log themselves."""
    upper, fore = rng.uniform(0.09, 0.12), rng.uniform(0.08, 0.11)
    masses = rng.uniform([0.1, 0.08, 0.04], [0.16, 0.12, 0.08])
    links = [_link("base", (0, 0, 0.1), 0.5, (0, 0, -0.03), (0.08, 0.08, 0.06)),
             _link("upper", (0, 0, 0.13), masses[0], (upper / 2, 0, 0.004), (upper, 0.03, 0.03)),
             _link("fore", (upper, 0, 0.13), masses[1], (fore / 2, 0.003, 0), (fore, 0.03, 0.03)),
             _link("hand", (upper + fore, 0, 0.13), masses[2], (0.03, 0, 0.008), (0.06, 0.04, 0.02))]
    joints = [_joint("shoulder", "base", "upper", "0 1 0"), _joint("elbow", "upper", "fore", "0 1 0"),
              _joint("wrist", "fore", "hand", "0 1 0")]
    return Robot("arm", _sdf("arm", links + joints), _bus_servo(rng), Ground(), "base",
                 bus_ids={"elbow": 2, "shoulder": 1, "wrist": 3})


def rig(rng: Rng) -> Robot:
    """One servo that swings a weight on a rod, and logs itself."""
    length, mass = rng.uniform(0.08, 0.13), rng.uniform(0.15, 0.35)
    links = [_link("base", (0, 0, 0.3), 0.5, (0, 0, 0), (0.05, 0.05, 0.05)),
             _link("rod", (0, 0, 0.3), mass, (0, 0, -length), (0.03, 0.03, 0.04))]
    return Robot("rig", _sdf("rig", [*links, _joint("swing", "base", "rod", "0 1 0")]), _bus_servo(rng), Ground(), "base",
                 bus_ids={"swing": 1})


def _servo(rng: Rng) -> ServoConstants:
    return ServoConstants(supply_voltage=round(float(rng.uniform(10.8, 11.8)), 2))


def _bus_servo(rng: Rng) -> ServoConstants:
    """A small bus servo with a proportional law."""
    return ServoConstants(
        model="bus servo", stall_torque=1.0, no_load_speed=7.0, rated_voltage=6.0, torque_tolerance=0.1, back_emf_tolerance=0.1,
        supply_voltage=round(float(rng.uniform(5.6, 6.2)), 2), coulomb_friction=0.03, viscous_friction=0.01,
        reflected_inertia=0.004, compliance_slope=None, compliance_margin=None,
        punch=None, proportional_gain=round(float(rng.uniform(2.5, 5.0)), 2))


def _sdf(name: str, parts: list[str]) -> str:
    inside = "\n".join(parts)
    return f'<?xml version="1.0"?>\n<sdf version="1.9"><model name="{name}">\n{inside}\n</model></sdf>\n'


def _link(name: str, at: object, mass: float, com: object, size: tuple[float, float, float], inside: str = "") -> str:
    """A link whose mass is a box of this size about its centre of mass."""
    x, y, z = np.square(size)
    inertia = {"ixx": y + z, "iyy": x + z, "izz": x + y}
    tensor = "".join(f"<{k}>{mass * v / 12:.6e}</{k}>" for k, v in inertia.items()) + "<ixy>0</ixy><ixz>0</ixz><iyz>0</iyz>"
    where = f"<pose>{_three(com)} 0 0 0</pose>"
    shape = f'<visual name="shape">{where}<geometry><box><size>{_three(size)}</size></box></geometry></visual>'
    return (f'<link name="{name}"><pose>{_three(at)} 0 0 0</pose><inertial>{where}<mass>{mass:.5f}</mass>'
            f"<inertia>{tensor}</inertia></inertial>{shape}{inside}</link>")


def _foot(shank: float) -> str:
    """Four small spheres at the end of a shank."""
    material = (f"<drake:point_contact_stiffness>{FOOT_STIFFNESS:g}</drake:point_contact_stiffness>"
                f"<drake:hunt_crossley_dissipation>{FOOT_DISSIPATION:g}</drake:hunt_crossley_dissipation>"
                "<drake:mu_static>0.6</drake:mu_static><drake:mu_dynamic>0.6</drake:mu_dynamic>")
    return "".join(
        f'<collision name="foot{k}"><pose>{x} {y} {-shank + 0.006:.5f} 0 0 0</pose>'
        f'<geometry><sphere><radius>0.006</radius></sphere>'
        f'</geometry><drake:proximity_properties xmlns:drake="http://drake.mit.edu">{material}</drake:proximity_properties>'
        "</collision>"
        for k, (x, y) in enumerate(((-0.011, -0.009), (-0.011, 0.009), (0.011, -0.009), (0.011, 0.009))))


def _joint(name: str, parent: str, child: str, axis: str) -> str:
    return (f'<joint name="{name}" type="revolute"><parent>{parent}</parent><child>{child}</child><axis><xyz>{axis}</xyz><limit>'
            "<lower>-2.6</lower><upper>2.6</upper><effort>1.5</effort><velocity>6.18</velocity></limit></axis></joint>")


def _three(v: object) -> str:
    return " ".join(f"{x:.6g}" for x in np.asarray(v, dtype=float))
