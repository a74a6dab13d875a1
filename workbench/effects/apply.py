"""Applies a model's effects, to the description of the robot and to its commands."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from workbench.cache import Cache
from workbench.effects.base import Effect, check_places, si_values
from workbench.effects.registry import effect_named
from workbench.effects.schedules import delay_commands, delay_each
from workbench.effects.sdf import SdfRobot
from workbench.motion.commands import Commands
from workbench.recording.recording import Measurement
from workbench.robot import GRAVITY, EffectSpec, Ground, RobotModel
from workbench.servo import ServoLaw, ServoTerm, nominal_terms
from workbench.types import Array

KEPT_BUILDS = 64
"""Number of changed descriptions in the cache: more than a fit compares at once."""


@dataclass(frozen=True)
class Physics:
    """Nominal physics and effects together. build: the changed SDF, None where it is the model's file. foot_friction: pair
    coefficient by foot, where it differs from the ground's. zero: (n,) [rad] link angle minus servo angle.
    tether: (3,) [N]. stages: by servo joint, the joints that were put between servo and link. moved: link lengths changed. ends:
    hard ends were added, which continuous plants ignore. terms: of the servos, by effects. retimed: whether a servo's delay or
    an effect changes the commands or their times."""

    build: SdfRobot | None
    law: ServoLaw
    ground: Ground
    foot_friction: Mapping[str, float]
    foot_stiffness: float | None
    gravity: Array
    tether: Array
    zero: Array
    stages: Mapping[str, tuple[str, ...]]
    moved: bool
    ends: bool
    terms: tuple[ServoTerm, ...] = ()
    retimed: bool = True

    @cached_property
    def description(self) -> str | None:
        """SDF text, None where it is the model's file."""
        return None if self.build is None else self.build.text()

    @property
    def servo_terms(self) -> tuple[ServoTerm, ...]:
        """All behaviour of the servos beyond constants, from the nominal law and from effects."""
        return (*nominal_terms(self.law), *self.terms)


def resolve(model: RobotModel) -> Iterator[tuple[Effect, EffectSpec, dict[str, float]]]:
    """Each effect of a model with its spec and its values in SI, checked; InputError names the problem."""
    for k, spec in enumerate(model.effects):
        effect = effect_named(spec.effect)
        check_places(effect, spec, model)
        lowest = effect.lowest(model.with_effects(model.effects[:k]), spec.where) if _takes_away(effect, spec) else ()
        yield effect, spec, si_values(effect, spec, lowest)


def add_possible(model: RobotModel, specs: Sequence[EffectSpec]) -> RobotModel:
    """The model with more effects, none of which takes away more of a constant than is there: a search changes both at once."""
    effects = list(model.effects)
    for spec in specs:
        effect = effect_named(spec.effect)
        if _takes_away(effect, spec):
            lowest = effect.lowest(model.with_effects(effects), spec.where)
            least = {p.name: low for p, low in zip(effect.parameters, lowest)}
            spec = replace(spec, parameters={
                name: v if isinstance(v, tuple) else max(v, least[name]) for name, v in spec.parameters.items()})
        effects.append(spec)
    return model.with_effects(effects)


def _takes_away(effect: Effect, spec: EffectSpec) -> bool:
    """Whether a value is below its parameter's range, so that it has to take away from a constant."""
    return any(isinstance(v := spec.parameters.get(p.name), (int, float)) and v < p.low for p in effect.parameters)


def law_of(model: RobotModel) -> ServoLaw:
    """The servos' law alone, effects applied in their order: in a fraction of the time of `physics_of`."""
    law = ServoLaw.of([model.servo(j) for j in model.joints])
    for effect, spec, values in resolve(model):
        law = effect.law(law, _columns(model, spec), values)
    return law


def physics_of(model: RobotModel) -> Physics:
    """The model's physics, effects applied in their order."""
    law = ServoLaw.of([model.servo(j) for j in model.joints])
    ground, gravity, tether = model.ground, np.array([0.0, 0.0, -GRAVITY]), np.zeros(3)
    zero = np.zeros(len(model.joints))
    friction: dict[str, float] = {}
    stiffness: float | None = None
    terms: list[ServoTerm] = []
    changes: list[tuple[Effect, EffectSpec]] = []
    retimed = any(model.servo(j).goal_delay > 0 for j in model.joints)
    for effect, spec, values in resolve(model):
        columns = _columns(model, spec)
        law = effect.law(law, columns, values)
        if type(effect).servo_term is not Effect.servo_term:
            term = effect.servo_term(np.isin(model.joints, spec.where), values)
            terms += [] if term is None else [term]
        ground = effect.ground(ground, values)
        gravity = effect.gravity(gravity, values)
        zero[columns] += effect.zero(values)
        pull, slip, soft = effect.tether(values), effect.foot_friction(values), effect.foot_stiffness(values)
        tether = tether if pull is None else tether + pull
        stiffness = stiffness if soft is None else soft
        if slip is not None:
            friction |= dict.fromkeys(spec.where, slip)
        retimed |= type(effect).commands is not Effect.commands
        if type(effect).description is not Effect.description:
            changes.append((effect, spec))
    sdf = _apply_to_sdf(model, changes) if changes else None
    return Physics(sdf, law, ground, friction, stiffness, gravity, tether, zero,
                   sdf.stages if sdf else {}, sdf is not None and sdf.moved, sdf is not None and sdf.ends,
                   tuple(terms), retimed)


_builds: Cache[SdfRobot] = Cache(KEPT_BUILDS)


def _apply_to_sdf(model: RobotModel, changes: Sequence[tuple[Effect, EffectSpec]]) -> SdfRobot:
    """The model's SDF with these effects applied to its description; the same object for the same effects, as most robots of a
    search differ only in their servos. An effect of another package may depend on the whole model, so its SDF is not shared."""
    own = all(type(effect).__module__.startswith(f"{__package__}.") for effect, _ in changes)

    def build() -> SdfRobot:
        sdf = SdfRobot(model.path)
        for effect, spec in changes:
            effect.description(sdf, spec, model)
        return sdf

    if not own:
        return build()
    key = tuple((s.effect, s.where, tuple(s.parameters.items())) for _, s in changes)
    return _builds.get((model.path, model.path.stat().st_mtime_ns, key), build)


def _columns(model: RobotModel, spec: EffectSpec) -> NDArray[np.int64]:
    return np.array([model.joints.index(j) for j in spec.where if j in model.joints], dtype=np.int64)


@dataclass(frozen=True)
class Hearing:
    """How a robot's servos hear commands: late (n,) [s]: their goals, by the nominal law, in the model's order; changes: by
    effects, with the places and values of each."""

    model: RobotModel
    late: Array
    changes: tuple[tuple[Effect, tuple[str, ...], dict[str, float]], ...]

    @classmethod
    def of(cls, model: RobotModel) -> Hearing:
        """A model's."""
        late = np.array([model.servo(j).goal_delay for j in model.joints])
        changes = ((effect, spec.where, values) for effect, spec, values in resolve(model))
        return cls(model, late, tuple(c for c in changes if type(c[0]).commands is not Effect.commands))

    def heard(self, commands: Commands, until: float = math.inf) -> Commands:
        """The commands on which the servos act: those that were sent, with goals delayed according to the nominal law, and
        changed by effects. Torque off is not delayed: the duty register of an STS3215 is zero in the row that switches it off.
        until [s]: later commands are not needed, and are omitted where no effect may bring them forward."""
        until = math.inf if self.changes else until
        joints = self.model.joints
        late = self.late if commands.joints == joints else self.late[[joints.index(j) for j in commands.joints]]
        delays = set(late[late > 0].tolist())
        if len(delays) == 1:
            (delay,) = delays
            commands = delay_commands(commands.until(until), np.flatnonzero(late == delay).tolist(), delay, switched=False)
        elif delays:
            commands = delay_each(commands, late, until)
        for effect, where, values in self.changes:
            commands = effect.commands(commands, where, values, self.model)
        return commands


def apply_to_commands(commands: Commands, model: RobotModel) -> Commands:
    """The commands on which a model's servos act (`Hearing`)."""
    return Hearing.of(model).heard(commands)


def apply_to_measurement(measurement: Measurement, model: RobotModel) -> Measurement:
    """The measurement of a robot with these effects."""
    for effect, spec, _ in resolve(model):
        measurement = effect.measurement(measurement, spec)
    return measurement
