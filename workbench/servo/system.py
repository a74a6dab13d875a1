"""The servo bank: the nominal servo law as a Drake system."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint
from pydrake.systems.framework import (
    BasicVector,
    Context,
    ContinuousState,
    DependencyTicket,
    DiscreteValues,
    LeafSystem,
    ValueProducer,
)

from workbench.servo.law import ServoLaw
from workbench.types import Array, Mask

BRISTLE_SLIP = 5e-4
"""Deflection [rad] at which a bristle of a continuous plant yields; a tenth of a count, so that no sensor sees it."""
BRISTLE_SHARPNESS = 8
"""Exponent of the bristle's yield: 1 is Dahl's, higher ones come nearer to Coulomb's corner."""


class ServoBank(LeafSystem):
    """n position servos: goal and moving speed in, torque on the joints out.

        plant_state    (nq + nv) -->+-----------+--> generalized_force (nv)  N m: duty torque, as the plant takes it
        goal_position  (n) rad ---->| ServoBank |--> motor_torque      (n)   N m: duty torque less back-EMF
        moving_speed   (n) rad/s -->|           |--> duty              (n)   -1 to 1
        torque_enable  (n) 0 or 1 ->+-----------+--> reference         (n)   rad: the ramped goal

    moving_speed and torque_enable may stay unconnected: at once, and all on. The reference advances every `period` seconds
    (discrete state, n) towards the goal, or, where the law has a lag, towards the goal behind a first-order filter (discrete
    state, n), by no more than the law's own ramp. Back-EMF and viscous friction act as joint damping of the plant, Coulomb
    friction as its joints' actuators (implicit) or as bristles of this system (continuous state, n; after Dahl 1968), which both
    hold at rest; generalized_force holds the rest.
    Build it with AddServos, which sets all that on the plant.
    """

    def __init__(
        self, plant: MultibodyPlant, joints: Sequence[RevoluteJoint], law: ServoLaw, period: float, bristles: bool
    ) -> None:
        super().__init__()
        self.law = law
        self.joints = tuple(j.name() for j in joints)
        n, nq, nv = len(joints), plant.num_positions(), plant.num_velocities()
        self._q = np.array([j.position_start() for j in joints], dtype=int)
        self._v = np.array([j.velocity_start() for j in joints], dtype=int)
        self._x_v = self._v + nq
        self._period = period
        self._bristles = bristles
        self._force = np.zeros(nv)
        self._state = self.DeclareVectorInputPort("plant_state", nq + nv)
        self._goal = self.DeclareVectorInputPort("goal_position", n)
        self._speed = self.DeclareVectorInputPort("moving_speed", n)
        self._enable = self.DeclareVectorInputPort("torque_enable", n)
        self._reference = self.DeclareDiscreteState(n)
        self._slope = law.gain * law.full_torque  # of the law as torque over |error|, before it is cut
        self._offset = law.punch * law.full_torque - self._slope * law.margin
        self._derives, self._lags = bool(law.derivative.any()), bool(law.lag.any())
        self._own_step = law.ramp * period
        self._cached_command = self.DeclareCacheEntry(
            "command", ValueProducer(allocate=lambda: AbstractValue.Make((np.zeros(n), np.zeros(n), np.zeros(n), None)),
                                     calc=lambda context, value: value.set_value(self._calc_command(context))),
            {self._goal.ticket(), self._speed.ticket(), self._enable.ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._advance)
        state = {self._state.ticket(), self._enable.ticket(), self.xd_ticket()} | self._declare_terms(plant)
        if self._lags:
            self._filtered = int(self.DeclareDiscreteState(n))
        force_state = state | ({self.xc_ticket()} if bristles else set())
        self.DeclareVectorOutputPort("generalized_force", nv, self._calc_force, force_state)
        self.DeclareVectorOutputPort("motor_torque", n, self._calc_motor_torque, state)
        self.DeclareVectorOutputPort("duty", n, self._calc_duty, state)
        self.DeclareStateOutputPort("reference", self._reference)
        if bristles:
            self.DeclareContinuousState(n)
            self._bristle_stiffness = law.coulomb / BRISTLE_SLIP
            self._bristle_damping = 2.0 * np.sqrt(self._bristle_stiffness * law.inertia)  # critical, for the servo alone

    def _declare_terms(self, plant: MultibodyPlant) -> set[DependencyTicket]:
        """What outputs depend on besides, in a bank whose servos do more than the nominal law."""
        return set()

    def SetFirstCommand(self, context: Context, time: float) -> None:
        """Tells terms that count from it when the first command comes [s]; the nominal law does not ask."""

    def SetReference(self, context: Context, reference: Array) -> None:
        """Puts the ramp at `reference` (n,) [rad], as after power-on at a known pose."""
        context.SetDiscreteState(0, np.asarray(reference, dtype=float))
        if self._lags:
            context.SetDiscreteState(self._filtered, np.asarray(reference, dtype=float))

    def ShiftRamp(self, context: Context, seconds: float) -> None:
        """Moves the ramp on, or back where `seconds` is negative: a command that comes between two periods has gone on for a
        while when the next begins, and the one before has gone too far. A ramp that has arrived does not go back."""
        goal, down, up, on = self._command(context)
        reference, share = context.get_discrete_state(0).CopyToVector(), abs(seconds) / self._period
        if self._lags:
            lagging = context.get_discrete_state(self._filtered).CopyToVector()
            slow, passed = self.law.lag > 0, self._filtered_share(abs(seconds))
            goal = np.where(slow, lagging + passed * (goal - lagging) if seconds > 0 else lagging, goal)
        step = np.minimum(np.maximum(goal - reference, down * share), up * share)
        moves = True if on is None else on
        context.SetDiscreteState(0, np.where(moves, reference + np.copysign(1.0, seconds) * step, reference))
        if self._lags:
            sent, left = self._command(context)[0], np.where(slow, 1.0 - passed, 1.0)
            back = np.where(slow, (lagging - passed * sent) / left, sent)
            context.SetDiscreteState(self._filtered, goal if seconds > 0 else back)

    def _filtered_share(self, seconds: float) -> Array:
        """Share of a step of the goal (n,) that is behind the filter after so long."""
        with np.errstate(divide="ignore"):
            return -np.expm1(-seconds / self.law.lag)

    def _command(self, context: Context) -> tuple[Array, Array, Array, Mask | None]:
        """Goal (n,) [rad], how far down and up the ramp goes in a period (n,) [rad], and which servos are on (n,), None for all;
        cached while inputs last."""
        return self._cached_command.Eval(context)  # type: ignore[no-any-return]

    def _calc_command(self, context: Context) -> tuple[Array, Array, Array, Mask | None]:
        speed = self._speed.Eval(context) if self._speed.HasValue(context) else np.zeros(len(self.joints))
        step = np.minimum(np.where(speed > 0, speed * self._period, np.inf), self._own_step)
        on = self._enable.Eval(context) > 0.5 if self._enable.HasValue(context) else None
        return self._goal.Eval(context), -step, step, None if on is None or on.all() else on

    def _advance(self, context: Context, values: DiscreteValues) -> None:
        goal, down, up, on = self._command(context)
        reference = context.get_discrete_state(0).value()
        if self._lags:
            lagging = context.get_discrete_state(self._filtered).value()
            goal = lagging + self._filtered_share(self._period) * (goal - lagging)
            values.set_value(self._filtered, goal)
        new = reference + np.minimum(np.maximum(goal - reference, down), up)
        if on is not None:  # the ramp starts at the measured position once torque is back
            new = np.where(on, new, self._state.Eval(context)[self._q])
        values.set_value(0, new)

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        x = self._state.Eval(context)
        error = context.get_discrete_state(0).value() - x[self._q]
        size = np.abs(error)
        size = np.minimum(self._offset + self._slope * size, self.law.full_torque) * (size > self.law.margin)
        torque = np.copysign(size, error)
        if self._derives:
            torque = self.law.duty(error, x[self._x_v]) * self.law.full_torque
        on = self._command(context)[3]
        if on is not None:  # no back-EMF either: undo the joint's share of damping
            torque = np.where(on, torque, self.law.back_emf * x[self._x_v])
        if self._bristles:
            torque = torque - self._bristle_force(context, x[self._x_v])
        self._force[self._v] = torque
        output.SetFromVector(self._force)

    def _bristle_rate(self, context: Context, v: Array) -> tuple[Array, Array]:
        """Bristles follow the joint and yield at the Coulomb torque; returns deflection [rad] and its rate [rad/s], (n,)."""
        z = context.get_continuous_state_vector().CopyToVector()
        load = np.maximum(np.sign(v) * z / BRISTLE_SLIP, 0.0)
        return z, np.where(self.law.coulomb > 0, v * (1.0 - load**BRISTLE_SHARPNESS), 0.0)

    def _bristle_force(self, context: Context, v: Array) -> Array:
        z, rate = self._bristle_rate(context, v)
        force = self._bristle_stiffness * z + self._bristle_damping * rate
        return np.asarray(np.clip(force, -self.law.coulomb, self.law.coulomb), dtype=float)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
        """Derivatives of the bristles' deflections [rad/s]."""
        if self._bristles:
            derivatives.SetFromVector(self._bristle_rate(context, self._state.Eval(context)[self._x_v])[1])

    def _calc_motor_torque(self, context: Context, output: BasicVector) -> None:
        x, on = self._state.Eval(context), self._command(context)[3]
        error = context.get_discrete_state(0).value() - x[self._q]
        output.SetFromVector(self.law.motor_torque(error, x[self._x_v], True if on is None else on))

    def _calc_duty(self, context: Context, output: BasicVector) -> None:
        on, x = self._command(context)[3], self._state.Eval(context)
        error = context.get_discrete_state(0).value() - x[self._q]
        output.SetFromVector(self.law.duty(error, x[self._x_v]) * (1.0 if on is None else on))
