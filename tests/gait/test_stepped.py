"""Runs in pieces, and runs of a free base from a state."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.files import InputError
from workbench.motion import Commands, load_motion
from workbench.robot import EffectSpec, data_file, puppy_model
from workbench.simulation import Simulation, SimulationConfig
from workbench.simulation.compiled import CompiledSteppedRun, stepped

FIELDS = ("time", "q", "v", "p_WB", "quat_WB", "torque")


@pytest.fixture(scope="module")
def walk():
    return load_motion(data_file("robotis_walk.csv"), puppy_model()).commands(2)


@pytest.fixture(scope="module")
def station():
    return Simulation(puppy_model(), SimulationConfig(time_step=2e-3))


def part(commands: Commands, first: float, last: float) -> Commands:
    """Those from `first` on and before `last` [s], on a clock that begins at `first`."""
    inside = (commands.times >= first - 1e-9) & (commands.times < last - 1e-9)
    return replace(commands, times=commands.times[inside] - first, goals=commands.goals[inside], speeds=commands.speeds[inside],
                   enabled=commands.enabled[inside], poses=commands.poses[inside], end=last - first)


@pytest.mark.parametrize("effects", [(), (EffectSpec("command_delay", ("flm",), {"delay": 0.03}),)])
def test_pieces_give_the_run_in_one_to_the_bit(walk, effects):
    station = Simulation(puppy_model(effects=effects), SimulationConfig(time_step=2e-3))
    whole = station.run(walk, 0.6, lead=0.0)
    run = station.stepped()
    run.send(part(walk, 0.0, 0.24))
    run.advance(0.1)
    run.advance(0.14)
    run.send(part(walk, 0.24, 10.0))
    run.advance(0.36)
    pieces = run.take()
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(pieces, field), getattr(whole, field), err_msg=field)
    for foot in whole.contact:
        np.testing.assert_array_equal(pieces.contact[foot], whole.contact[foot])


def test_goes_on_from_a_state_as_the_run_it_was_taken_from(station, walk):
    whole = station.run(walk, 0.574, lead=0.0)
    at = float(walk.times[4])  # a pose is sent at that instant: 468 ms, on a step
    run = station.stepped()
    run.send(walk)
    run.advance(at)
    state = run.state
    later = station.stepped(state)
    later.send(part(walk, at, 10.0))
    later.advance(0.106)
    again = later.take()
    np.testing.assert_allclose(again.p_WB[-1], whole.p_WB[-1], atol=1e-6)
    np.testing.assert_allclose(again.q[-1], whole.q[-1], atol=1e-5)
    np.testing.assert_allclose(np.interp(0.0, again.time, again.p_WB[:, 0]), state.base.p_WB[0])
    once = station.run(part(walk, at, 10.0), 0.106, start=state)
    np.testing.assert_allclose(once.p_WB[-1], whole.p_WB[-1], atol=1e-6)


def test_what_was_due_later_is_withdrawn_by_new_commands(station, walk):
    run = station.stepped()
    run.send(walk)
    run.advance(0.05)
    hold = replace(part(walk, 0.0, 0.1), goals=np.zeros((1, 15)))
    run.send(hold)
    run.advance(1.0)
    assert np.abs(run.take().q[-1]).max() < np.radians(6)  # dead band and droop about neutral


def test_a_run_ends_the_stepped_one_before_it(station, walk):
    run = station.stepped()
    station.run(duration=0.01)
    with pytest.raises(RuntimeError, match="ended this one"):
        run.advance(0.1)


def test_refuses_a_base_on_a_path():
    with pytest.raises(InputError, match="free or fixed"):
        Simulation(puppy_model(), SimulationConfig(base="path")).stepped()


def test_commands_that_no_delay_reaches_back_to_make_no_difference(walk, monkeypatch):
    """The delay of one servo is added to the delay of every servo; the run is advanced in pieces of 0.1 s."""
    config = SimulationConfig(time_step=2e-3, contact_period=0.0, log_period=0.01)
    delays = (EffectSpec("command_delay", ("flm",), {"delay": 0.03}), EffectSpec("command_delay", (), {"delay": 0.02}))
    takes = []
    for back in (0.1, np.inf):
        monkeypatch.setattr(stepped, "LOOK_BACK", back)
        run = CompiledSteppedRun(puppy_model(effects=delays), config)
        for first in np.arange(0.0, 1.0, 0.1):
            run.send(part(walk, first, first + 0.1))
            run.advance(0.1)
        takes.append(run.take())
    for field in ("q", "v", "p_WB", "quat_WB"):
        np.testing.assert_array_equal(getattr(takes[0], field), getattr(takes[1], field), err_msg=field)
