"""Kinematic calibration without simulation: link lengths that differ from the model's, and horns that sit turned.

Both show only in where feet meet the ground, and there in much the same way: floating-base takes alone hardly say which link it
is. Where a link lies between two joints that turn, cameras see both axes, and so how far they are apart and, on a fixed base,
which way.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from workbench.compare.channels import joint_of
from workbench.effects.registry import effect_named, estimated_by
from workbench.effects.sdf import SdfRobot
from workbench.identify.options import CONCLUSIONS, READ_OFF
from workbench.identify.parameters import Candidate, Key
from workbench.identify.problem import TakeEvidence, channel_gaps
from workbench.identify.results.findings import Change, Estimate, Finding
from workbench.recording import quaternions as quat
from workbench.recording.mocap.joint_centers import PARALLEL, Span, across, spans
from workbench.recording.mocap.mending import repaired
from workbench.recording.mocap.tracks import seen_joints, turn_vectors
from workbench.robot import EffectSpec, RobotModel
from workbench.robot.kinematics import Kinematics
from workbench.types import Array

SEEN = " Measured from the axes of the joints at both its ends, as seen by the cameras, without any simulation."


@dataclass(frozen=True)
class UncertainValue:
    """A number and its standard deviation, in SI."""

    value: float
    sigma: float

    def differs(self, least: float) -> bool:
        """Whether it is neither nothing nor too little to show."""
        return abs(self.value) > max(READ_OFF.geometry_sure * self.sigma, least)

    def is_nothing(self, least: float) -> bool:
        """Whether it is too little to show, surely."""
        return abs(self.value) + 2 * self.sigma < least


@dataclass(frozen=True)
class Measured:
    """A direct estimate: a link that is not as long as drawn, a rotated horn, or a servo's register; value and standard deviation
    in the unit of docs/formats.md. where: joint or link, empty for the whole robot. seen: how that is known, for a person."""

    effect: str
    where: str
    mean: float
    sigma: float
    seen: str = SEEN

    @property
    def variance(self) -> float:
        """Of the mean, in the square of its unit."""
        return self.sigma**2

    @property
    def places(self) -> tuple[str, ...]:
        """Where it acts, as an effect has it."""
        return (self.where,) if self.where else ()

    @property
    def spec(self) -> EffectSpec:
        """The effect, for a model."""
        return EffectSpec(self.effect, self.places, {effect_named(self.effect).parameters[0].name: self.mean})

    def finding(self, fit: Change, validation: Change) -> Finding:
        """With the 90 % interval of the measurement."""
        p = effect_named(self.effect).parameters[0]
        half = CONCLUSIONS.z90 * self.sigma
        number = Estimate(self.mean, self.mean - half, self.mean + half, p.unit)
        return Finding(self.effect, self.places, CONCLUSIONS.surest, {p.name: number}, fit, validation,
                       evidence=effect_named(self.effect).sentence(self.spec) + self.seen)


@dataclass(frozen=True)
class Geometry:
    """Geometry estimated from the bodies. measured: deviations from the drawing; near: initial value by effect and place, where
    droop may differ from the model's; as_drawn: candidates that need not be tried."""

    measured: tuple[Measured, ...] = ()
    near: Mapping[Key, float] = field(default_factory=dict)
    as_drawn: frozenset[Key] = frozenset()

    def added_to(self, model: RobotModel) -> RobotModel:
        """The model with the measured deviations."""
        return model.with_effects((*model.effects, *(m.spec for m in self.measured)))

    def select_untried(self, pool: Sequence[Candidate]) -> list[Candidate]:
        """The candidates of a pool that must still be tried."""
        known = self.as_drawn | {(m.effect, m.places) for m in self.measured}
        return [replace(c, typical=(self.near[c.key],)) if c.key in self.near else c for c in pool if c.key not in known]


def geometry_of(model: RobotModel, evidence: Sequence[TakeEvidence], residuals: Mapping[int, Array]) -> Geometry:
    """Estimates the geometry of a robot whose model has no lengths or zeros of its own. residuals: of the model, by take."""
    lengths, turns = estimated_by("length between axes"), estimated_by("turn about an axis")
    if not lengths or not turns or {e.effect for e in model.effects} & {e.name for e in (*lengths, *turns)}:
        return Geometry()
    between = {i: _spans(e, model) for i, e in enumerate(evidence) if e.take.recording.rigid_bodies}
    fixed = [(evidence[i], there) for i, there in between.items() if evidence[i].take.spec.base == "fixed"]
    ill = {joint_of(c) for i, e in enumerate(evidence) if e.take.spec.base == "fixed" for c in channel_gaps(e, residuals[i])}
    k, measured, near, as_drawn = model.kinematics, list[Measured](), dict[Key, float](), set[Key]()
    for (effect, *_), least, estimates in (
            (lengths, READ_OFF.least_change, _changes(model, [s for there in between.values() for s in there])),
            (turns, READ_OFF.least_turned, _turns(model, fixed))):
        name, unit = effect.name, effect.parameters[0].si
        for where, number in estimates.items():
            if number.is_nothing(least):
                as_drawn.add((name, (where,)))
            elif number.differs(least) and effect.hidden_by_zeroing and ill & set(k.chain(k.frames[where].child)):
                near[name, (where,)] = number.value / unit
            elif number.differs(least):
                measured.append(Measured(name, where, number.value / unit, number.sigma / unit))
    return Geometry(tuple(measured), near, frozenset(as_drawn))


def _spans(e: TakeEvidence, model: RobotModel) -> list[Span]:
    tracks = repaired(e.take.recording, model)
    return spans(tracks, seen_joints(tracks.assets, model, e.take.spec.base)[0])


def _changes(model: RobotModel, between: Sequence[Span]) -> dict[str, UncertainValue]:
    """Amount by which links are longer than drawn, by link."""
    k, sdf = model.kinematics, SdfRobot(model.path)
    estimates: dict[str, list[UncertainValue]] = {}
    for s in between:
        link, drawn = k.frames[s.joint].child, _offset_across(k, s)
        way, distance = sdf.way(k, link), float(np.linalg.norm(drawn))
        along = float(drawn @ way) / (distance * float(np.linalg.norm(way))) if distance > 0 and way.any() else 0.0
        if along > READ_OFF.least_along:
            change, sigma = float(np.linalg.norm(s.way)) - distance, float(np.hypot(s.sigma, READ_OFF.length_error))
            estimates.setdefault(link, []).append(UncertainValue(change / along, sigma / along))
    return {link: _mean(each) for link, each in estimates.items()}


def _turns(model: RobotModel, fixed: Sequence[tuple[TakeEvidence, Sequence[Span]]]) -> dict[str, UncertainValue]:
    """Rotation of links about the axes that carry them, beyond droop, by joint."""
    k = model.kinematics
    estimates: dict[str, list[UncertainValue]] = {}
    for e, between in fixed:
        m = e.take.measurement
        rest = np.array([[m.rest_pose.get(j, 0.0) for j in k.joints]])
        poses, start = k.forward(rest), k.forward(np.zeros((1, len(k.joints))))
        tilt = quat.matrix(m.rest_rotation) @ poses[model.base][1][0].T
        for s in between:
            f = k.frames[s.joint]
            axis = start[model.base][1][0].T @ start[f.parent][1][0] @ f.axis_of_parent
            seen, drawn = turn_vectors(s.way, -m.yaw), tilt @ poses[f.child][1][0] @ _offset_across(k, s)
            if abs(k.frames[s.following].axis_of_parent @ f.axis_B) > PARALLEL:
                turn = float(np.arctan2(axis @ np.cross(drawn, seen), drawn @ seen))
                estimates.setdefault(s.joint, []).append(
                    UncertainValue(turn, float(np.hypot(s.sigma / np.linalg.norm(drawn), READ_OFF.direction_error)))
                )
    return {joint: _mean(each) for joint, each in estimates.items()}


def _offset_across(k: Kinematics, s: Span) -> Array:
    """What of the way between two joints lies across both axes (3,) [m], in the link's frame, as the model has it."""
    f, following = k.frames[s.joint], k.frames[s.following]
    return across(following.X_PF_p - f.p_BM, f.axis_B, following.axis_of_parent)


def _mean(estimates: Sequence[UncertainValue]) -> UncertainValue:
    weights = np.array([t.sigma**-2 for t in estimates])
    values = np.array([t.value for t in estimates])
    mean = float(weights @ values / weights.sum())
    scatter = float(np.sqrt(weights @ (values - mean) ** 2 / weights.sum()))
    return UncertainValue(mean, float(np.hypot(weights.sum() ** -0.5, scatter / np.sqrt(len(estimates)))))
