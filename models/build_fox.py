"""Builds models/sdf/fox, a robot with other names than the puppy's: `python -m models.build_fox [FOLDER]`.

The fox is drawn, not built: twelve XL-430 servos, a box for a body, names as ANYmal and Solo use them (LF_HAA, LF_HFE, LF_KFE), a
foot that is a link of its own welded to each shank, no tail and no head. It is here so that nothing in the workbench leans on the
puppy's names, its fifteen joints or its servos. Its masses follow from the servos' (57.2 g each, ROBOTIS e-manual) and a density
of printed parts, as said beside each number.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from workbench.files.reading import write_together

ROOT = Path(__file__).resolve().parents[1]
SERVO = 0.0572
"""Mass of an XL430-W250-T [kg] (ROBOTIS e-manual)."""
THIGH, SHANK, HIP = 0.080, 0.085, 0.032
"""Hip to knee, knee to the foot's centre, and how far the leg's plane lies outside the first joint [m]."""
HALF_LENGTH, HALF_WIDTH = 0.085, 0.045
"""Where the first joints lie from the trunk's middle [m]."""
FOOT_RADIUS = 0.008
STIFFNESS, DISSIPATION, FRICTION = 2e4, 5.0, 0.6
"""Of a rubber ball of that radius [N/m, s/m]: an order of size, not measured."""
NO_LOAD_SPEED, STALL = 6.4, 1.5
"""XL430-W250-T at 12 V [rad/s, N m] (ROBOTIS e-manual)."""
LEGS = (("LF", 1, 1), ("LH", -1, 1), ("RF", 1, -1), ("RH", -1, -1))
PACKAGE = """<?xml version="1.0"?>
<package format="2">
  <name>fox</name>
  <version>0.1.0</version>
  <description>A drawn quadruped with twelve XL430-W250-T servos and names of its own</description>
  <maintainer email="workbench@example.invalid">drake-workbench</maintainer>
  <license>BSD-3-Clause</license>
</package>
"""


@dataclass(frozen=True)
class Solid:
    """A box of uniform density: mass [kg], middle and size (3,) [m] in its link's frame."""

    mass: float
    middle: tuple[float, float, float]
    size: tuple[float, float, float]


def build(folder: Path) -> Path:
    """Writes fox.sdf and package.xml into `folder`; returns the SDF's path."""
    return write_together(folder, {"fox.sdf": sdf(), "package.xml": PACKAGE})[0]


def sdf() -> str:
    """The whole file. Zero of every joint is the neutral pose: legs straight down."""
    height = THIGH + SHANK + FOOT_RADIUS
    # battery 0.12 kg, computer 0.045 kg, shell 0.09 kg, and the four servos of the first joints
    lines = ['<?xml version="1.0"?>',
             "<!-- Made by models/build_fox.py; do not edit. Zero of every joint: legs straight down. -->",
             '<sdf version="1.9" xmlns:drake="http://drake.mit.edu">', '<model name="fox">',
             f"<pose>0 0 {_text(height)} 0 0 0</pose>",
             _link("trunk", (0, 0, 0), Solid(0.255 + 4 * SERVO, (0.005, 0, 0.012), (0.2, 0.09, 0.05)), "0.93 0.45 0.16",
                   _touching("shell", "0.005 0 0.012", "<box><size>0.2 0.09 0.05</size></box>"))]
    for leg, x, y in LEGS:
        at = (x * HALF_LENGTH, y * HALF_WIDTH, 0.0)
        hip = (at[0], at[1] + y * HIP, 0.0)
        knee = (hip[0], hip[1], -THIGH)
        foot = (hip[0], hip[1], -THIGH - SHANK)
        lines += [
            _link(f"{leg}_HIP", at, Solid(SERVO + 0.012, (0, y * 0.5 * HIP, 0), (0.047, 0.036, 0.036)), "0.25 0.25 0.27"),
            _link(f"{leg}_THIGH", hip, Solid(SERVO + 0.02, (0, 0, -0.6 * THIGH), (0.03, 0.036, THIGH + 0.02)), "0.93 0.45 0.16",
                  _touching("bone", f"0 0 {_text(-THIGH / 2)}", f"<box><size>0.028 0.034 {_text(THIGH)}</size></box>")),
            _link(f"{leg}_SHANK", knee, Solid(0.016, (0, 0, -0.45 * SHANK), (0.014, 0.014, SHANK)), "0.25 0.25 0.27"),
            _link(f"{leg}_FOOT", foot, Solid(0.004, (0, 0, 0), (0.013, 0.013, 0.013)), "0.1 0.1 0.1",
                  _touching("ball", "0 0 0", f"<sphere><radius>{_text(FOOT_RADIUS)}</radius></sphere>")),
            _joint(f"{leg}_HAA", "trunk", f"{leg}_HIP", "1 0 0", 0.8),
            _joint(f"{leg}_HFE", f"{leg}_HIP", f"{leg}_THIGH", "0 1 0", 1.6),
            _joint(f"{leg}_KFE", f"{leg}_THIGH", f"{leg}_SHANK", "0 1 0", 2.4),
            f'<joint name="{leg}_ANKLE" type="fixed"><parent>{leg}_SHANK</parent><child>{leg}_FOOT</child></joint>',
        ]
    return "\n".join([*lines, "</model>", "</sdf>", ""])


def _text(value: float) -> str:
    """Shortest to 9 significant digits, so that the file is the same on every machine."""
    return f"{value + 0.0:.9g}"


def _texts(values: Iterable[float]) -> str:
    return " ".join(map(_text, values))


def _link(name: str, at: tuple[float, float, float], solid: Solid, colour: str, inside: str = "") -> str:
    x, y, z = (s * s for s in solid.size)
    moments = {"ixx": y + z, "iyy": x + z, "izz": x + y}
    tensor = "".join(f"<{k}>{_text(solid.mass * v / 12)}</{k}>" for k, v in moments.items())
    where = f"<pose>{_texts(solid.middle)} 0 0 0</pose>"
    seen = (f'<visual name="solid">{where}<geometry><box><size>{_texts(solid.size)}</size></box></geometry>'
            f"<material><diffuse>{colour} 1</diffuse></material></visual>")
    return (f'<link name="{name}"><pose>{_texts(at)} 0 0 0</pose><inertial>{where}<mass>{_text(solid.mass)}</mass>'
            f"<inertia>{tensor}</inertia></inertial>{seen}{inside}</link>")


def _touching(name: str, where: str, shape: str) -> str:
    material = (f"<drake:point_contact_stiffness>{_text(STIFFNESS)}</drake:point_contact_stiffness>"
                f"<drake:hunt_crossley_dissipation>{_text(DISSIPATION)}</drake:hunt_crossley_dissipation>"
                f"<drake:mu_static>{_text(FRICTION)}</drake:mu_static><drake:mu_dynamic>{_text(FRICTION)}</drake:mu_dynamic>")
    return (f'<collision name="{name}"><pose>{where} 0 0 0</pose><geometry>{shape}</geometry>'
            f"<drake:proximity_properties>{material}</drake:proximity_properties></collision>")


def _joint(name: str, parent: str, child: str, axis: str, reach: float) -> str:
    return (f'<joint name="{name}" type="revolute"><parent>{parent}</parent><child>{child}</child><axis><xyz>{axis}</xyz><limit>'
            f"<lower>{_text(-reach)}</lower><upper>{_text(reach)}</upper><effort>{_text(STALL)}</effort>"
            f"<velocity>{_text(NO_LOAD_SPEED)}</velocity></limit></axis></joint>")


if __name__ == "__main__":
    print(build(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "models/sdf/fox"))
