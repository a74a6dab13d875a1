"""A servo bank whose servos do more than the nominal law: a failing supply, torque that ends early, friction that varies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint
from pydrake.systems.framework import BasicVector, Context, DependencyTicket, DiscreteValues, ValueProducer

from workbench.servo.law import ServoLaw
from workbench.servo.system import BRISTLE_SHARPNESS, BRISTLE_SLIP, ServoBank
from workbench.servo.terms import Instant, ServoTerm, most_friction, wanted_friction
from workbench.types import Array

LOAD_SMOOTHING = 2e-3
"""Time constant [s] of the load that friction sees: following at once, friction and load would feed on each other from step to
step."""
MOVING = 5e-3
"""Speed [rad/s] from which a joint's direction is that of its velocity, far above creep at rest."""


@dataclass(frozen=True)
class _Parts:
    """(n,) [N m]. push: duty torque as the plant takes it, which subtracts back-EMF itself; motor: duty torque less back-EMF;
    friction: the dry friction wanted; relief: the reduction of the plant's friction by the bank, along the motion."""

    push: Array
    motor: Array
    friction: Array
    relief: Array


class TermBank(ServoBank):
    """A ServoBank with `terms`: duty torque is multiplied by their strengths, motor torque saturated and cut at their lowest
    ceiling, and friction raised.

    Further ports: input `net_actuation` (of the plant; needed where friction varies in a discrete plant), output
    `friction_relief` (n) N m.

    Back-EMF is damping of the plant, implicit in a discrete one, so that a motor torque that is saturated, cut, or off gets it
    back, at the velocity to expect at the end of the step.

    Torques of tables are added to the motor's torque, whether torque is enabled or not.

    Friction that varies, discrete plants: the plant's actuator brakes with at most the most friction there can be; the bank
    pushes along the motion, at rest along the motion that friction prevents, with that less the friction wanted. A held joint
    stays exactly held, as the actuator absorbs the torque of the bank. Direction and load are those of the last step; a joint
    that turns back rests for one step. Bristles yield at the friction wanted.

    The load is the torque that the servo transmits to its link: motor torque less viscous and dry friction and less the torque of
    the reflected inertia. It is exact in discrete plants, for the step before the last; in continuous ones it comes from
    differences over a period. Friction sees it through a first-order lag of LOAD_SMOOTHING.

    Discrete state besides the reference: velocity (n), the knowledge of the load (n), load (n), friction of the last step (n),
    and whether there was a last step (1).
    """

    def __init__(
        self, plant: MultibodyPlant, joints: Sequence[RevoluteJoint], law: ServoLaw, period: float, bristles: bool,
        terms: Sequence[ServoTerm],
    ) -> None:
        self.terms = tuple(terms)
        self._most = most_friction(terms, law)
        self._varies = bool((self._most > law.coulomb).any())
        self._ceiling = np.full(len(joints), np.inf)
        self._bend = np.zeros(len(joints))
        for term in terms:
            self._ceiling = np.minimum(self._ceiling, term.ceiling())
            self._bend = self._bend + 1.0 / np.asarray(term.saturation())
        self._cuts = bool(np.isfinite(self._ceiling).any() or self._bend.any())
        self._tabled = tuple(t for t in terms if type(t).more_torque is not ServoTerm.more_torque)
        self._discrete = plant.time_step() > 0
        self._smoothing = period / (period + LOAD_SMOOTHING)
        self._inertia_rate = law.inertia / period
        self._none = np.zeros(len(joints))
        self._actuators = _last_actuators(plant, joints)
        super().__init__(plant, joints, law, period, bristles)

    def _declare_terms(self, plant: MultibodyPlant) -> set[DependencyTicket]:
        n = len(self.joints)
        self._net_actuation = self.DeclareVectorInputPort("net_actuation", plant.num_actuators())
        self._memory = int(self.DeclareDiscreteState(4 * n + 1))
        self._first_command = int(self.DeclareNumericParameter(BasicVector([0.0])))
        more = {self.time_ticket(), self.pn_ticket()}
        state = more | {self._state.ticket(), self._enable.ticket(), self.xd_ticket()}
        self._parts = self.DeclareCacheEntry(
            "parts", ValueProducer(allocate=lambda: AbstractValue.Make(_Parts(*np.zeros((4, n)))),
                                   calc=lambda context, value: value.set_value(self._calc_parts(context))), state)
        self.DeclareVectorOutputPort("friction_relief", n, self._calc_relief, state)
        return more

    def SetFirstCommand(self, context: Context, time: float) -> None:
        """When the first command comes [s]; without this, at time 0. Infinity: not yet."""
        context.get_mutable_numeric_parameter(self._first_command).SetFromVector([time])

    def SetReference(self, context: Context, reference: Array) -> None:
        """The same as in ServoBank; joints may have been moved, so that the last step cannot predict the next."""
        super().SetReference(context, reference)
        context.SetDiscreteState(self._memory, np.zeros(4 * len(self.joints) + 1))

    def _recall(self, context: Context) -> tuple[Array, bool]:
        """Rows (4, n) of the discrete state, and whether there was a last step."""
        memory = context.get_discrete_state(self._memory).value()
        return memory[:-1].reshape(4, -1), bool(memory[-1])

    def _calc_parts(self, context: Context) -> _Parts:
        x, on, law = self._state.Eval(context), self._command(context)[3], self.law
        v = x[self._x_v]
        duty = law.duty(context.get_discrete_state(0).value() - x[self._q], v)
        duty = duty if on is None else duty * on
        (last_v, _, load, held), stepped = self._recall(context)
        begin = context.get_numeric_parameter(self._first_command).value()[0]
        now = Instant(max(context.get_time() - begin, 0.0), v, duty, load, self._none, self._none, x[self._q])
        torque = duty * law.full_torque
        for term in self.terms:
            torque = torque * term.strength(law, now)
        ahead = 2.0 * v - last_v if stepped and self._discrete else v
        push, motor = torque, torque - law.back_emf * v
        if self._cuts:
            push = push - self._lost(torque - law.back_emf * ahead)
            motor = motor - self._lost(motor)
        if on is not None:  # no back-EMF either: undo the joint's share of damping
            push, motor = np.where(on, push, law.back_emf * ahead), np.where(on, motor, 0.0)
        for term in self._tabled:
            push = push + term.more_torque(now)
        if not self._varies:
            return _Parts(push, motor, law.coulomb, self._none)
        now = replace(now, motor=motor, direction=_clip(v / MOVING))
        friction = np.minimum(wanted_friction(self.terms, law, now), self._most)
        yielding = np.maximum(friction / 2, 1e-6)  # well below what brakes a joint that slides, so that this counts as sliding
        now = replace(now, direction=_clip(v / MOVING - held / yielding))
        friction = np.minimum(wanted_friction(self.terms, law, now), self._most)
        if self._bristles:
            return _Parts(push, motor, friction, self._none)
        return _Parts(push, motor, friction, (self._most - friction) * now.direction)

    def _lost(self, torque: Array) -> Array:
        """The part of the motor's torque that does not act, with its sign."""
        bent = torque / (1.0 + np.abs(torque) * self._bend)
        return np.asarray(torque - np.minimum(np.maximum(bent, -self._ceiling), self._ceiling))

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        parts: _Parts = self._parts.Eval(context)
        torque = parts.push + parts.relief
        if self._bristles:
            torque = torque - self._bristle_force(context, self._state.Eval(context)[self._x_v])
        self._force[self._v] = torque
        output.SetFromVector(self._force)

    def _calc_motor_torque(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._parts.Eval(context).motor)

    def _calc_relief(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._parts.Eval(context).relief)

    def _advance(self, context: Context, values: DiscreteValues) -> None:
        super()._advance(context, values)
        v = self._state.Eval(context)[self._x_v]
        if not self._varies:  # nobody asks for the load
            values.set_value(self._memory, np.concatenate([v, self._none, self._none, self._none, [1.0]]))
            return
        (_, known, load, _), stepped = self._recall(context)
        parts: _Parts = self._parts.Eval(context)
        if stepped:  # implicit damping and the reflected inertia's change of speed, now that the step's end is known
            handed = known - (self.law.damping + self._inertia_rate) * v
            load = load + self._smoothing * (handed - load)
        friction = self._friction(context, parts, v)
        known = parts.push + friction + self._inertia_rate * v
        values.set_value(self._memory, np.concatenate([v, known, load, friction, [1.0]]))

    def _friction(self, context: Context, parts: _Parts, v: Array) -> Array:
        """Dry friction on the joints (n,) [N m] over the step that begins."""
        if self._bristles:
            return -self._bristle_force(context, v)
        return np.asarray(self._net_actuation.Eval(context)[self._actuators] + parts.relief)

    def _bristle_rate(self, context: Context, v: Array) -> tuple[Array, Array]:
        z = context.get_continuous_state_vector().CopyToVector()
        load = np.maximum(np.sign(v) * z / BRISTLE_SLIP, 0.0)
        return z, np.where(self._most > 0, v * (1.0 - load**BRISTLE_SHARPNESS), 0.0)

    def _bristle_force(self, context: Context, v: Array) -> Array:
        z, rate = self._bristle_rate(context, v)
        level = self._parts.Eval(context).friction
        stiffness = level / BRISTLE_SLIP
        force = stiffness * z + 2.0 * np.sqrt(stiffness * self.law.inertia) * rate
        return np.asarray(np.clip(force, -level, level), dtype=float)


def _clip(direction: Array) -> Array:
    """Within -1 and 1."""
    return np.asarray(np.minimum(np.maximum(direction, -1.0), 1.0))


def _last_actuators(plant: MultibodyPlant, joints: Sequence[RevoluteJoint]) -> NDArray[np.int_]:
    """Columns of net_actuation that show the joints' totals."""
    actuators = [plant.get_joint_actuator(a) for a in plant.GetJointActuatorIndices()]
    column = {a.joint().name(): a.input_start() for a in actuators}
    return np.array([column[j.name()] for j in joints], dtype=int)
