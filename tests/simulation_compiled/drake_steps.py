"""Single steps of Drake's station, and the same steps by the compiled one, from the same states."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from workbench.effects.apply import physics_of
from workbench.effects.base import Effect
from workbench.robot import EffectSpec, RobotModel
from workbench.servo import TermBank
from workbench.simulation import Job, Simulation, SimulationConfig
from workbench.simulation.compiled.arrays import Log, State, work_for
from workbench.simulation.compiled.machine import Machine, machine_of
from workbench.simulation.compiled.run import DONE, TOUCHED, run
from workbench.simulation.compiled.schedule import schedule_of
from workbench.simulation.compiled.structures import tables_of
from workbench.types import Array


@dataclass(frozen=True)
class Step:
    """State of the plant x and of the bank (lagging: the goal behind its filter) before a step, the goal while it lasts, and the
    plant's state after it."""

    x: Array
    reference: Array
    lagging: Array
    memory: Array
    goal: Array
    on: Array
    time: float
    after: Array


def config_for(base: str, step: float = 2e-3, settle: float = 0.4) -> SimulationConfig:
    return SimulationConfig(base=base, time_step=step, settle=settle, contact_period=0.0)


def drake_steps(model: RobotModel, config: SimulationConfig, seed: int, count: int, swing: float = 0.35, switched: bool = False,
                changed: Callable[[MultibodyPlant], None] | None = None) -> Iterator[Step]:
    """Steps of a robot that goes to new random goals every 30 steps; switched: servos go off and on again; changed: settings
    of Drake's plant alone."""
    random = np.random.default_rng(seed)
    sim = Simulation(model, config)
    if changed is not None:
        changed(sim.plant)
    sim._rest_in_neutral(None)
    sim._set_first_command(0.0)
    plant, context = sim.plant, sim._plant_context
    bank_context = sim._bank()[1]
    n = len(model.joints)
    sim.simulator.Initialize()
    goal, on = np.zeros(n), np.ones(n)
    for k in range(count):
        if k % 30 == 0:
            goal = random.uniform(-swing, swing, n)
            on = (random.uniform(size=n) > 0.3).astype(float) if switched and k % 60 else np.ones(n)
            sim._command(goal, random.uniform(0.0, 6.0, n) * (random.uniform(size=n) > 0.2), on)
        x = plant.GetPositionsAndVelocities(context).copy()
        reference = bank_context.get_discrete_state(0).CopyToVector()
        bank = sim._bank()[0]
        lagging = bank_context.get_discrete_state(bank._filtered).CopyToVector() if bank._lags else reference
        remembers = isinstance(bank, TermBank)
        memory = bank_context.get_discrete_state(1).CopyToVector() if remembers else np.zeros(4 * n + 1)
        sim.simulator.AdvanceTo((k + 1) * config.time_step)
        yield Step(x, reference, lagging, memory, goal + physics_of(model).zero, on, k * config.time_step,
                   plant.GetPositionsAndVelocities(context).copy())


class CompiledSteps:
    """The compiled station of a model, for single steps from states of Drake's plant."""

    def __init__(self, model: RobotModel, config: SimulationConfig, apart: bool = False) -> None:
        physics, self.free = physics_of(model), config.base == "free"
        self.tables = tables_of(model, physics.build, self.free)
        self.machine: Machine = machine_of(model, physics, self.tables, self.free, config.time_step, apart)
        self.config, self.zero = config, physics.zero

    def after(self, step: Step) -> Array | None:
        """State of the plant after the step; None where it is Drake's, as something touches that the station does not know."""
        m, n = self.machine, len(self.tables.joints)
        base = step.x[:7].copy() if self.free else np.array([1.0, 0, 0, 0, 0, 0, 0])
        start = 7 if self.free else 0
        joints = len(m.servos.joint)
        state = State(base=base, q=step.x[start:start + n].copy(), v=step.x[start + n:].copy(), reference=step.reference.copy(),
                      goal=step.goal.copy(), lagging=step.lagging.copy(), reach=np.full(joints, np.inf), on=step.on > 0.5,
                      memory=np.ascontiguousarray(step.memory[:-1].reshape(4, -1)), stepped=step.memory[-1:].copy())
        schedule = schedule_of(self.config, None, 0.0, self.config.time_step, step.time, None)
        none = np.zeros((0, joints))
        schedule = schedule._replace(begin=-step.time, goal=none, speed=none, on=none.astype(bool))
        log = Log(np.empty((0, n)), np.empty((0, n)), np.empty((0, 7)), np.empty((0, joints)), np.empty((0, 0, 3)))
        how = run(*m, schedule, state, log, work_for(*m))
        if how == TOUCHED:
            return None
        assert how == DONE
        return np.concatenate([state.base if self.free else [], state.q, state.v])


def typical(effect: Effect, where: tuple[str, ...], more: float = 1.5) -> EffectSpec:
    """An effect well above where it starts to be felt."""
    parameters: dict[str, float | tuple[float, float, float]] = {}
    for p in effect.parameters:
        value = min(max(p.typical * (1.0 if p.replaces or p.shapes else more), p.low), p.high)
        parameters[p.name] = (0.3 * value, -0.2 * value, value) if p.vector else value
    return EffectSpec(effect.name, where, parameters)


def drake_and_compiled(job: Job) -> tuple[Job, Job]:
    """The same job by either engine."""
    return tuple(replace(job, config=replace(job.config, engine=e)) for e in ("drake", "compiled"))  # type: ignore[return-value]
