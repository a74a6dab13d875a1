"""A run of the compiled station in pieces is the run of Drake in pieces."""

from __future__ import annotations

import numpy as np
import pytest

from workbench.gait.machine import GaitMachine
from workbench.gait.shape import GaitShape
from workbench.gait.table import gait_table
from workbench.robot import EffectSpec, puppy_model
from workbench.simulation import Simulation, SimulationConfig
from workbench.simulation.compiled import CompiledSteppedRun
from workbench.simulation.stepped import SteppedRun


def test_pieces_with_late_servos_are_as_in_drake() -> None:
    """Two servos act 30 ms late, so that goals of one piece arrive in the next."""
    model = puppy_model()
    late = tuple(EffectSpec("command_delay", (j,), {"delay": 0.03}) for j in model.joints[:2])
    model = model.with_effects(late)
    shape = GaitShape("trot", (1, 1), 8, 2.2, stride=0.04, duty=0.6, lift=0.02, crouch=0.04)
    table = gait_table(GaitMachine(puppy_model()), shape, "t")
    config = SimulationConfig(time_step=2e-3, contact_period=0.0, log_period=2e-3)

    def walked(run: SteppedRun | CompiledSteppedRun) -> np.ndarray:
        for commands, seconds in ((table.start.commands(1), table.start_seconds), (table.cycle.commands(1), table.period)):
            run.send(commands)
            run.advance(seconds)
        p = run.take().p_WB
        assert p is not None
        return p

    ours, drakes = walked(CompiledSteppedRun(model, config)), walked(Simulation(model, config).stepped())
    assert ours.shape == drakes.shape
    assert ours == pytest.approx(drakes, abs=1e-9)
    assert np.hypot(*ours[-1, :2]) > 0.01


def test_a_take_before_the_first_piece_is_refused() -> None:
    config = SimulationConfig(time_step=2e-3, contact_period=0.0, log_period=2e-3)
    for run in (CompiledSteppedRun(puppy_model(), config), Simulation(puppy_model(), config).stepped()):
        with pytest.raises(RuntimeError, match="call advance"):
            run.take()
