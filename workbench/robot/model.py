"""The robot as plain data: description, servos, ground, and the physics added to them."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any, Literal

import yaml

from workbench.files import InputError
from workbench.files.nearest import did_you_mean
from workbench.files.resources import resolve_model
from workbench.physical import GROUND, check_ranges, doubts
from workbench.robot.feet import feet_of
from workbench.robot.kinematics import Kinematics
from workbench.robot.model_source import ModelSource, model_problems, prepare
from workbench.robot.mounting import Mounting
from workbench.robot.names import BUS_IDS, RIGID_BODIES
from workbench.robot.servo_constants import ServoConstants

PUPPY = "package://puppy/puppy.sdf"
GRAVITY = 9.81
"""Gravity [m/s^2], as in Drake's plants."""
FAST_YAML = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
"""Writes the same text either way."""
_AX_12A = ServoConstants()


@dataclass(frozen=True)
class Ground:
    """The floor. friction: coefficient of foot on ground, both static and dynamic; None: the SDF's own. stiffness [N/m] of a
    contact point; None or infinite: rigid. dissipation: Hunt and Crossley's [s/m]; None: 0. InputError for an impossible
    number (workbench/physical.py)."""

    friction: float | None = None
    stiffness: float | None = None
    dissipation: float | None = None

    def __post_init__(self) -> None:
        check_ranges(GROUND, asdict(self))

    @property
    def doubts(self) -> tuple[str, ...]:
        """Values that no floor has, though they are not impossible."""
        return tuple(f"ground.{text}" for text in doubts(GROUND, asdict(self)))


@dataclass(frozen=True)
class EffectSpec:
    """One piece of physics beyond the nominal model. effect: its name. where: joints, links or feet at which it acts; empty: the
    whole robot. parameters: its numbers, in the units of docs/formats.md, section 7 (degrees, not radians)."""

    effect: str
    where: tuple[str, ...] = ()
    parameters: Mapping[str, float | tuple[float, float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if isinstance(self.where, str):
            raise InputError(None, f"effect '{self.effect}': where: expected a tuple of names, as ('{self.where}',), got "
                                   f"'{self.where}'")


@dataclass(frozen=True)
class RobotModel:
    """The nominal robot and the effects added to it; plain data that knows no simulator code.

    description: SDF or URDF path, or package:// URL. base: link that floats; default: the tree's root. servos: constants by joint
    (default: AX-12A). ground: the floor. rigid_bodies: Motive asset -> link. bus_ids: Dynamixel ID by joint. mountings: how
    servos sit on their joints, where the two angles differ. feet: links that stand on the ground; None: the last link with a
    collision shape on each branch (robot/feet.py). packages: folder of each ROS package that the description's meshes name. held:
    its base was held in all its takes, and is held in simulations by default. InputError if the base's default is needed and the
    description cannot be read.
    """

    description: str
    base: str = ""
    servos: Mapping[str, ServoConstants] = field(default_factory=dict)
    ground: Ground = field(default_factory=Ground)
    rigid_bodies: Mapping[str, str] = field(default_factory=dict)
    bus_ids: Mapping[str, int] = field(default_factory=dict)
    effects: tuple[EffectSpec, ...] = ()
    feet: tuple[str, ...] | None = None
    packages: Mapping[str, str] = field(default_factory=dict)
    held: bool = False
    mountings: Mapping[str, Mounting] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.base:
            object.__setattr__(self, "base", self.kinematics.root)

    @cached_property
    def source(self) -> ModelSource:
        """The file of the description, and what Drake reads of it."""
        return prepare(resolve_model(self.description), self.packages)

    @property
    def path(self) -> Path:
        """The SDF file that Drake reads."""
        return self.source.path

    @cached_property
    def problems(self) -> tuple[str, ...]:
        """Problems of the description, one line each; InputError where Drake cannot build it."""
        return (*self.source.problems, *model_problems(self.path, self.source.source, slides=self.ground.friction is None))

    @cached_property
    def held_problems(self) -> tuple[str, ...]:
        """The same as `problems`, for a robot whose base is always held: the base's mass, and its feet, do not matter."""
        about = tuple(text for text in self.source.problems if not text.startswith(f"link '{self.base}' has no <inertial>"))
        return about + model_problems(self.path, self.source.source, self.base)

    @cached_property
    def kinematics(self) -> Kinematics:
        """Tree of links and joints, with vectorised forward kinematics."""
        return Kinematics.from_file(self.path)

    @property
    def usual_base(self) -> Literal["free", "fixed"]:
        """The default for its base: fixed for a robot that was always held, or that its file mounts on the world; else free."""
        return "fixed" if self.held or self.kinematics.fixed_to_world else "free"

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the actuated joints, alphabetical (the thesis's order)."""
        return self.kinematics.joints

    @cached_property
    def foot_links(self) -> Mapping[str, str]:
        """Foot -> its link. A foot has the name of the last joint that moves it (the knee's)."""
        return feet_of(self.kinematics, self.feet)

    def servo(self, joint: str) -> ServoConstants:
        """Constants of one joint's servo (default AX-12A where none are given)."""
        return self.servos.get(joint, _AX_12A)

    def with_effect(self, effect: EffectSpec) -> RobotModel:
        """The same robot with one more effect. InputError if it names a part that the robot does not have; whether the effect is
        known and its numbers are possible is checked when a station is made of it, or the model is saved."""
        k = self.kinematics
        parts = {*self.joints, *k.links, *self.foot_links, *self.rigid_bodies}
        strange = [name for name in effect.where if name not in parts]
        if strange:
            raise InputError(None, f"effect '{effect.effect}': where: the robot has no '{strange[0]}'"
                                   f"{did_you_mean(strange[0], parts)}")
        return self.with_effects((*self.effects, effect))

    def with_effects(self, effects: Sequence[EffectSpec]) -> RobotModel:
        """The same robot with these effects instead of its own; its description is not read again."""
        return self.with_physics(self.servos, effects)

    def with_physics(self, servos: Mapping[str, ServoConstants], effects: Sequence[EffectSpec]) -> RobotModel:
        """The same robot with these effects and these servos instead of its own; its description is not read again."""
        return self._sharing(replace(self, servos=servos, effects=tuple(effects)))

    def with_held(self, held: bool) -> RobotModel:
        """The same robot with its base usually held, or not."""
        return self if held == self.held else self._sharing(replace(self, held=held))

    def _sharing(self, other: RobotModel) -> RobotModel:
        vars(other).update({k: v for k, v in vars(self).items() if k in ("source", "kinematics", "foot_links")})
        return other

    def with_masses(self, path: Path, masses: Mapping[str, float]) -> RobotModel:
        """The same robot with an SDF file derived from its own, in which links have these masses [kg] and everything else is
        unchanged, so that its tree and feet are not read again."""
        other = replace(self, description=str(path))
        k = replace(self.kinematics, path=path, masses=dict(masses))
        vars(other).update(source=ModelSource(path, path), kinematics=k, foot_links=self.foot_links)
        return other

    def with_servos(self, changes: Mapping[str, Any]) -> RobotModel:
        """The same robot with constants replaced in every servo (a take's `servos`)."""
        if not changes:
            return self
        return self.with_physics({j: self.servo(j).updated(dict(changes)) for j in self.joints}, self.effects)

    @cached_property
    def sha256(self) -> str:
        """Hash of the description's content and of everything said about it."""
        digest = hashlib.sha256(self.source.source.read_bytes())
        content = self.as_dict() | {"description": self.source.source.name}
        digest.update(yaml.dump(content, Dumper=FAST_YAML, sort_keys=True).encode())
        return digest.hexdigest()

    def as_dict(self) -> dict[str, Any]:
        """Plain types, for YAML and JSON."""
        return {
            "description": self.description,
            "base": self.base,
            "servos": {j: s.constants() for j, s in self.servos.items()},
            "ground": asdict(self.ground),
            "rigid_bodies": dict(self.rigid_bodies),
            "bus_ids": dict(self.bus_ids),
            **({"mountings": {j: asdict(m) for j, m in self.mountings.items()}} if self.mountings else {}),
            "feet": None if self.feet is None else list(self.feet),
            "effects": [
                {"effect": e.effect, "where": list(e.where),
                 "parameters": {k: list(v) if isinstance(v, tuple) else v for k, v in e.parameters.items()}}
                for e in self.effects
            ],
        }

    def _repr_html_(self) -> str:
        """For a notebook: the tree in a sentence, and a row for each joint's servo and range."""
        k = self.kinematics
        rows = "".join(
            f"<tr><td>{escape(j)}</td><td>{escape(k.frames[j].child)}</td><td>{escape(s.model)}</td><td>{s.torque_at_full_duty:.2f}</td>"
            f"<td>{math.degrees(k.frames[j].lower):.0f} to {math.degrees(k.frames[j].upper):.0f}</td></tr>"
            for j, s in ((j, self.servo(j)) for j in self.joints))
        effects = ", ".join(escape(" ".join([e.effect, *e.where])) for e in self.effects) or "none"
        heads = "".join(f"<th>{head}</th>" for head in ("joint", "link", "servo", "stall torque [N m]", "range [deg]"))
        return (f"<p>{escape(Path(self.description).name)}: base {escape(self.base)}, {k.mass:.3f} kg, "
                f"{len(self.joints)} joints; effects: {effects}</p><table><tr>{heads}</tr>{rows}</table>")

    def check_build(self, other: RobotModel, what: str) -> None:
        """InputError unless the other robot, which `what` describes, has the same links and joints."""
        if self.joints != other.joints or self.kinematics.links != other.kinematics.links:
            raise InputError(self.description, f"expected the links and joints of {what}")

    def check_base(self, floating: bool) -> None:
        """InputError unless the base is a link of the model, and the root of its tree where it has to float."""
        k = self.kinematics
        if self.base not in k.links:
            raise InputError(self.description, f"base: no link '{self.base}'; links: {', '.join(k.links)}")
        if floating and k.parent_joint.get(self.base) is not None:
            raise InputError(
                self.description,
                f"base: '{self.base}' hangs on joint '{k.parent_joint[self.base]}' and cannot float; the root link is '{k.root}'",
            )
        if floating and k.fixed_to_world:
            raise InputError(self.description, f"base: '{self.base}' is fixed to the world in the SDF and cannot float")


def puppy_model(**changes: Any) -> RobotModel:
    """The puppy that ships with the workbench, AX-12A at the nominal constants, the thesis's names."""
    ground = Ground(friction=0.5, stiffness=math.inf)
    model = RobotModel(PUPPY, rigid_bodies=dict(RIGID_BODIES), bus_ids=dict(BUS_IDS), ground=ground)
    model = replace(model, servos={j: ServoConstants() for j in model.joints})
    return replace(model, **changes) if changes else model
