"""A robot's description as a MuJoCo model (MJCF)."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import mujoco
import numpy as np

from studies.other_engine.description import ContactShape, Description, LinkPart, Surroundings
from studies.other_engine.servo import ServoBank
from workbench.robot import Ground
from workbench.types import Array

HELD_AT = 1.0
"""Height of the root link's origin on the stand [m]."""
IMPEDANCE = 0.5
"""MuJoCo's d of contacts. The virtual mass is d / (1 - d) of the foot's own: MuJoCo's default of 0.9 makes it nine times
as heavy while it touches, which shows where feet slip: 26 cm of a slipping walk where 0.05 to 0.5 give 21 to 23."""
PUNCH_WIDTH = 1e-4
"""Error over which the punch rises, where MuJoCo's actuators make the servo law [rad]."""
DEFAULT_STIFFNESS = 1e5
DEFAULT_FRICTION = 1.0


def to_mjcf(
    description: Description, servos: ServoBank, around: Surroundings, base: str, timestep: float, drives: bool = False
) -> str:
    """MJCF text: bodies are the links, with the links' frames; `servos` in the order of description.joints.

    Reflected inertia is `armature`; Coulomb friction is `frictionloss` (a constraint, so that it holds at rest);
    viscous friction and back-EMF are `damping`, which implicitfast integrates implicitly. The ground is a plane,
    friction cones are elliptic, condim 3. With `drives` the servo law is in it too, as actuators whose control is the
    reference [rad], three to a joint.
    """
    top = ET.Element("mujoco", model="other_engine")
    ET.SubElement(top, "compiler", angle="radian", autolimits="true", balanceinertia="false")
    # impratio: friction is that much stiffer than the normal force, so that a foot inside its cone does not creep.
    ET.SubElement(top, "option", timestep=_text(timestep), integrator="implicitfast", cone="elliptic", impratio="100",
                  gravity=_text(*around.gravity), tolerance="1e-10", iterations="100")
    world = ET.SubElement(top, "worldbody")
    ET.SubElement(world, "geom", name="ground", type="plane", size="0 0 1", condim="3")
    if around.step is not None:
        _raise_floor(world, *around.step)
    index = {j: i for i, j in enumerate(description.joints)}
    elements = {"": world}
    for link in description.links:
        element = ET.SubElement(elements[link.parent], "body", name=link.name)
        elements[link.name] = element
        if not link.joint:
            height = HELD_AT if base == "fixed" else -description.lowest()
            element.set("pos", _text(0, 0, height))
            if base != "fixed":
                ET.SubElement(element, "freejoint", name="floating_base")
        else:
            _hang(element, link, servos, index.get(link.joint), timestep)
        _fill(element, link, around.ground)
    springs = [link for link in description.links if link.spring]
    if springs:
        tendons = ET.SubElement(top, "tendon")
        for link in springs:
            _stretch(tendons, link)
    if drives:
        actuators = ET.SubElement(top, "actuator")
        for i, joint in enumerate(description.joints):
            _drive(actuators, joint, servos, i)
    return ET.tostring(top, encoding="unicode")


def compile_model(
    description: Description, servos: ServoBank, around: Ground | Surroundings, base: str, timestep: float,
    drives: bool = False,
) -> mujoco.MjModel:
    """MuJoCo's model, with contacts as stiff [N/m] and as dissipative [s/m] as foot and ground together.

    MuJoCo's contact is a linear spring and damper with a virtual mass. At impedance d, time constant t and damping ratio z
    its stiffness is 1 / ((1 - d) A t² z²), where A is the inverse mass that the foot shows (`body_invweight0`): solved for
    t. z is what Hunt and Crossley's damping, which grows with the force, comes to under a quarter of the weight, but at
    least 1, so that no foot rings, and at most 2, so that the contact is the same at all steps up to 1 ms: MuJoCo makes t
    two steps or more.
    """
    around = around if isinstance(around, Surroundings) else Surroundings(around)
    model = mujoco.MjModel.from_xml_string(to_mjcf(description, servos, around, base, timestep, drives))
    load = 9.81 * model.body_subtreemass[1] / 4
    for link in description.links:
        A = model.body_invweight0[model.body(link.name).id, 0]
        if A == 0:  # held on the stand: what touches it brings its own stiffness
            continue
        for k, shape in enumerate(link.shapes):
            stiffness, dissipation = _in_series(shape, around.ground)
            rate = math.sqrt(stiffness * (1 - IMPEDANCE) * A)
            damping = load * dissipation / (2 * math.sqrt(stiffness / A))
            damping = min(max(damping, 1.0), 2.0)
            model.geom(_geom_name(link, k)).solref[:] = max(1 / (damping * rate), 2 * timestep), damping
    return model


def _in_series(shape: ContactShape, ground: Ground) -> tuple[float, float]:
    """Stiffness and dissipation of the pair; the softer one deforms, and so dissipates, more."""
    k = DEFAULT_STIFFNESS if math.isnan(shape.stiffness) else shape.stiffness
    d = 0.0 if math.isnan(shape.dissipation) else shape.dissipation
    if not math.isnan(shape.pair_stiffness):
        return shape.pair_stiffness, d
    if ground.stiffness is None or math.isinf(ground.stiffness):
        return k, d
    total = k + ground.stiffness
    of_ground = d if ground.dissipation is None else ground.dissipation
    return k * ground.stiffness / total, (ground.stiffness * d + k * of_ground) / total


def _hang(element: ET.Element, link: LinkPart, servos: ServoBank, i: int | None, timestep: float) -> None:
    element.set("pos", _text(*link.p))
    element.set("quat", _quaternion(link.R))
    if i is not None:
        _turn(element, link, servos, i, timestep)
    for joint in link.series:
        # Hard ends, as of gear teeth: half a newton metre bends them by less than a hundredth of a degree.
        ET.SubElement(
            element, "joint", name=joint.name, type="hinge", pos=_text(*link.anchor), axis=_text(*joint.axis),
            stiffness=_text(joint.stiffness), damping=_text(joint.damping),
            limited="true" if math.isfinite(joint.half) else "false",
            range=_text(-joint.half, joint.half) if math.isfinite(joint.half) else "0 0",
            solreflimit=_text(2 * timestep, 1), solimplimit="0.95 0.95 0.001")


def _turn(element: ET.Element, link: LinkPart, servos: ServoBank, i: int, timestep: float) -> None:
    ET.SubElement(
        element, "joint", name=link.joint, type="hinge", pos=_text(*link.anchor), axis=_text(*link.axis),
        armature=_text(servos.inertia[i]), frictionloss=_text(servos.coulomb[i]),
        damping=_text(servos.viscous[i] + servos.back_emf[i]), range=_text(link.lower, link.upper),
        limited="true" if math.isfinite(link.lower) and math.isfinite(link.upper) else "false",
        solreflimit=_text(2 * timestep, 1), solimplimit="0.95 0.95 0.001",
        # A stiff friction constraint: below the Coulomb torque the joint creeps at thousandths of a degree per second.
        solreffriction=_text(2 * timestep, 1), solimpfriction="0.99 0.99 0.001")


def _stretch(tendons: ET.Element, link: LinkPart) -> None:
    """A spring over all that turns about the servo's axis, at rest at zero."""
    spring = ET.SubElement(tendons, "fixed", name=f"{link.joint}/spring", stiffness=_text(link.spring), springlength="0 0")
    for name in (link.joint, *(s.name for s in link.series if np.allclose(s.axis, link.axis))):
        ET.SubElement(spring, "joint", joint=name, coef="1")


def _raise_floor(world: ET.Element, x: float, height: float) -> None:
    half = 1.0
    ET.SubElement(world, "geom", name="step", type="box", condim="3", size=_text(half, half, 0.05),
                  pos=_text(x + half, 0, height - 0.05))


def _drive(actuators: ET.Element, joint: str, servos: ServoBank, i: int) -> None:
    """The law from error to torque as a sum of springs that saturate: it is piecewise linear, but for the punch at the
    margin, which here rises over PUNCH_WIDTH."""
    corners = np.cumsum([servos.margin[i], PUNCH_WIDTH, servos.slope[i] - PUNCH_WIDTH])
    duty = np.array([0.0, servos.punch[i] + (1 - servos.punch[i]) * PUNCH_WIDTH / servos.slope[i], 1.0])
    steepness = np.diff(duty, prepend=0.0) / np.diff(corners, prepend=0.0).clip(min=1e-12) * servos.full_torque[i]
    # A spring that saturates at a corner is missing beyond it, so the steepness before a corner is the sum of those that
    # saturate there or later.
    for stiffness, corner in zip(steepness - np.append(steepness[1:], 0.0), corners):
        if corner > 0 and abs(stiffness) > 1e-9:
            most = abs(stiffness) * corner
            ET.SubElement(actuators, "general", joint=joint, gaintype="fixed", biastype="affine", ctrllimited="false",
                          gainprm=_text(stiffness), biasprm=_text(0, -stiffness, 0), forcerange=_text(-most, most))


def _fill(element: ET.Element, link: LinkPart, ground: Ground) -> None:
    M = link.inertia
    ET.SubElement(element, "inertial", pos=_text(*link.com), mass=_text(link.mass),
                  fullinertia=_text(M[0, 0], M[1, 1], M[2, 2], M[0, 1], M[0, 2], M[1, 2]))
    for k, shape in enumerate(link.shapes):
        friction = shape.friction if ground.friction is None else ground.friction
        friction = friction if math.isnan(shape.pair_friction) else shape.pair_friction
        ET.SubElement(
            element, "geom", name=_geom_name(link, k), type=shape.kind, pos=_text(*shape.p), quat=_quaternion(shape.R),
            size=_text(*shape.half), condim="3", priority="1", solimp=_text(IMPEDANCE, IMPEDANCE, 0.001),
            friction=_text(DEFAULT_FRICTION if math.isnan(friction) else friction, 0, 0))


def _geom_name(link: LinkPart, k: int) -> str:
    return f"{link.name}/{k}"


def _quaternion(R: Array) -> str:
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(R).ravel())
    return _text(*quat)


def _text(*values: float) -> str:
    return " ".join(repr(float(v)) for v in values)
