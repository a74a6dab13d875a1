"""A repeatable torque that nobody has named: smooth functions of angle, duty or speed, with one normal prior for each group.

The torque is the sum of weighted radial functions, so the weights are linear parameters of a joint's torque. A group's weights
have one standard deviation, the strength of such a law; `EvidenceOptions.law` lists those that are tried.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from workbench.identify.evidence.options import LawOptions
from workbench.identify.rollouts.servo_logs import frames
from workbench.robot.torque_table import DependsOn, TorqueTable
from workbench.servo import Instant, ServoLaw
from workbench.servo.tabled import Tabled
from workbench.types import Array, Mask

if TYPE_CHECKING:
    from workbench.identify.problem import TakeEvidence
    from workbench.robot import RobotModel


@dataclass(frozen=True)
class Functions:
    """Radial functions of one quantity. group: whose prior they share; at (K,): knots, in the units of servo.yaml; values (K, m):
    of each function there."""

    group: str
    depends_on: DependsOn
    at: Array = field(repr=False)
    values: Array = field(repr=False)


@dataclass(frozen=True)
class TorqueLaw:
    """An unnamed torque at one joint. weights (M,) [N m]: one for each function, 0 in absent groups; scales [N m]:
    standard deviation of the weights of each group present; tried: number of scales tried for
    each; full_torque [N m]: of the servo at full duty."""

    joint: str
    functions: tuple[Functions, ...]
    weights: Array = field(repr=False)
    scales: Mapping[str, float] = field(default_factory=dict)
    tried: int = 1
    full_torque: float = 1.0

    @cached_property
    def group_of(self) -> tuple[str, ...]:
        """Group of each weight."""
        return tuple(f.group for f in self.functions for _ in range(f.values.shape[1]))

    @property
    def groups(self) -> tuple[str, ...]:
        """All possible groups, in order."""
        return tuple(dict.fromkeys(f.group for f in self.functions))

    @property
    def active(self) -> Mask:
        """Which weights are of groups that are there (M,)."""
        return np.array([g in self.scales for g in self.group_of])

    @property
    def precision(self) -> Array:
        """Precision of the prior of each active weight [1/(N m)^2]."""
        return np.array([self.scales[g] ** -2 for g in self.group_of if g in self.scales])

    @property
    def log_prior(self) -> float:
        """Log density of the active weights, less what choosing each group's scale among several costs [nats]."""
        precision = self.precision
        density = 0.5 * np.sum(np.log(precision / (2 * np.pi)) - np.square(self.weights[self.active]) * precision)
        return float(density - len(self.scales) * np.log(self.tried))

    def at(self, weights: Array, scales: Mapping[str, float] | None = None) -> TorqueLaw:
        """The law with other weights (M,), and other groups."""
        scales = self.scales if scales is None else scales
        there = np.array([g in scales for g in self.group_of])
        return replace(self, weights=np.where(there, weights, 0.0), scales=dict(scales))

    def moved(self, k: int, by: float) -> TorqueLaw:
        """The law with one weight changed by so much [N m], whether or not its group is active."""
        return replace(self, weights=self.weights + by * np.eye(len(self.weights))[k])

    def tables(self) -> tuple[TorqueTable, ...]:
        """The law as a servo's tables: one for each quantity that the torque depends on."""
        return tuple(TorqueTable(f.depends_on, tuple(f.at.tolist()), tuple((f.values @ self.weights[own]).tolist()))
                     for f, own in self._present())

    def spread(self, covariance: Array) -> tuple[tuple[float, ...], ...]:
        """Standard deviations of each table's torques [N m], from the covariance of the active weights."""
        active = self.active
        whole = np.zeros((len(active), len(active)))
        whole[np.ix_(active, active)] = covariance
        variances = (np.einsum("ki,ij,kj->k", f.values, whole[own, own], f.values) for f, own in self._present())
        return tuple(tuple(np.sqrt(np.maximum(v, 0.0)).tolist()) for v in variances)

    def _present(self) -> list[tuple[Functions, slice]]:
        """The functions of which there is a table, each with the place of its weights."""
        ends = np.cumsum([0, *(f.values.shape[1] for f in self.functions)]).tolist()
        each = zip(self.functions, (slice(a, b) for a, b in pairwise(ends)))
        return [(f, own) for f, own in each if self.weights[own].any()]

    def rms(self, evidence: Sequence[TakeEvidence], model: RobotModel) -> float:
        """RMS over the joint's motion in some takes [N m]."""
        angle, speed, duty = _course(self.joint, evidence, model)
        if not len(angle):
            return 0.0
        none = np.zeros(1)
        term = Tabled([(0, table) for table in self.tables()], 1)
        torque = [term.more_torque(Instant(0.0, np.array([v]), np.array([u]), none, none, none, np.array([q])))[0]
                  for q, v, u in zip(angle, speed, duty)]
        return float(np.sqrt(np.mean(np.square(torque))))

    def added_to(self, model: RobotModel) -> RobotModel:
        """The robot with this torque at its joint."""
        servo = model.servo(self.joint)
        servo = replace(servo, torque_tables=(*servo.torque_tables, *self.tables()))
        return model.with_physics({**{j: model.servo(j) for j in model.joints}, self.joint: servo}, model.effects)


def torque_law(joint: str, evidence: Sequence[TakeEvidence], model: RobotModel, options: LawOptions) -> TorqueLaw | None:
    """A law of weight 0 whose functions cover a joint's motion in some takes; None if it did not move."""
    angle, speed, duty = _course(joint, evidence, model)
    if not len(angle) or np.ptp(np.quantile(angle, options.covered)) < options.least_travel:
        return None
    degrees = np.degrees(angle)
    slow = np.degrees(options.slow)
    functions = (
        _radial("angle", "angle", degrees, options.of_angle, options),
        _radial("angle and direction", "angle and direction", degrees, options.of_angle, options),
        _radial("duty and direction", "duty", np.concatenate([duty, -duty]), options.of_duty, options),
        _radial("duty and direction", "duty and direction", np.abs(duty), options.of_duty, options),
        _stretch(_radial("speed", "speed", np.arcsinh(np.degrees(speed) / slow), options.of_speed, options), slow))
    return TorqueLaw(joint, functions, np.zeros(sum(f.values.shape[1] for f in functions)), tried=len(options.shares),
                     full_torque=model.servo(joint).torque_at_full_duty)


def _stretch(f: Functions, slow: float) -> Functions:
    """Functions of arcsinh(speed / slow) as functions of speed: finer about rest."""
    return replace(f, at=slow * np.sinh(f.at))


def _radial(group: str, depends_on: DependsOn, x: Array, n: int, options: LawOptions) -> Functions:
    """n normal curves side by side over what x covers, each as wide as they are apart."""
    low, high = np.quantile(x, options.covered)
    width = max(float(high - low), 1e-3) / (n - 1)
    middles = low + width * np.arange(n)
    at = np.linspace(low - 2 * width, middles[-1] + 2 * width, (n + 3) * options.knots + 1)
    return Functions(group, depends_on, at, np.exp(-0.5 * np.square((at[:, None] - middles) / width)))


def course(joint: str, evidence: Sequence[TakeEvidence], model: RobotModel) -> Iterator[tuple[Array, Array, Array]]:
    """A joint's motion in each take that shows it, in the rows that are used: time [s], angle [rad], and duty of the nominal law
    without its ramp."""
    for e in evidence:
        if joint not in e.channels:
            continue
        rows = (e.uses["fit"] | e.uses["choose"]) & frames(e)
        q = e.recorded[:, e.channels.index(joint)]
        rows &= np.isfinite(q)
        if rows.sum() < 3:
            continue
        q, since = q[rows], e.since[rows]
        duty = np.zeros(len(q))
        commands = e.take.commands
        if commands is not None and joint in commands.joints and len(commands.times):
            k = np.clip(np.searchsorted(commands.times, since, side="right") - 1, 0, None)
            servo = e.take.spec.robot(model).servo(joint)
            error = commands.goals[k, commands.joints.index(joint)] - q
            duty = ServoLaw.of([servo]).duty(error[:, None])[:, 0]
        yield since, q, duty


def _course(joint: str, evidence: Sequence[TakeEvidence], model: RobotModel) -> tuple[Array, Array, Array]:
    """The same of all takes together: angle [rad], speed [rad/s] and duty."""
    out = [(q, np.gradient(q, since), duty) for since, q, duty in course(joint, evidence, model)]
    angle, speed, duty = (np.concatenate([np.empty(0), *column]) for column in zip(*out)) if out else (np.empty(0),) * 3
    return angle, speed, duty
