"""Logs in windows: each starts from the recorded state, and a right model leaves nothing in any of them."""

from dataclasses import dataclass

import numpy as np
import pytest

from tests.servo_rig import rig_model
from workbench.identify.rollouts.windows import recorded_states, states_at
from workbench.recording.formats.log_commands import commands_of_rows
from workbench.recording.take import Take
from workbench.robot import EffectSpec, ServoConstants
from workbench.simulation import SimulationConfig
from workbench.simulation.compiled.angles import servo_angles
from workbench.simulation.job import Job
from workbench.simulation.steady import JointStates

TIMES = np.arange(0.0, 3.0, 0.0103)
SERVO = ServoConstants(stall_torque=0.7, no_load_speed=19.0, rated_voltage=7.4, supply_voltage=7.4, coulomb_friction=0.013,
                       viscous_friction=0.004, reflected_inertia=0.0018, proportional_gain=0.6, compliance_slope=None,
                       compliance_margin=None, punch=None)


@dataclass(frozen=True)
class Log:
    """What `recorded_states` looks at of a registered take."""

    model: object
    recorded: Take


def goals():
    time = np.arange(0.0, 3.0, 0.01)
    return commands_of_rows(time, ("j",), (1.1 * np.sin(2.2 * time) + 0.5 * np.sin(7.0 * time))[:, None])


def angles(model, restarts=None, commands=None, times=TIMES):
    config = SimulationConfig(base="fixed", settle=0.02, time_step=1e-3, engine="compiled")
    job = Job(model, config, commands or goals(), times[-1] + 2e-3, 0.1, name="x", times=times, restarts=restarts)
    return servo_angles([[job]])[0][0]


def test_states_are_those_of_the_recorded_motion(tmp_path):
    time = np.arange(0.0, 2.0, 0.01)
    q = 0.3 * time - 0.2 * time**2 + 0.1 * time**3
    q[120:140] = np.nan
    log = Log(rig_model(tmp_path, SERVO), Take("x", "recording", time, ("j",), q[:, None], starts_at=0.0))
    states = recorded_states(log, 0.5)
    np.testing.assert_allclose(states.times, [0.5, 1.0, 1.5])
    np.testing.assert_allclose(states.q[:, 0], 0.3 * states.times - 0.2 * states.times**2 + 0.1 * states.times**3, atol=1e-9)
    np.testing.assert_allclose(states.v[:, 0], 0.3 - 0.4 * states.times + 0.3 * states.times**2, atol=1e-8)
    assert recorded_states(log, 0.5) is states
    assert np.isnan(recorded_states(log, 0.65).q[1, 0])  # 1.3 s, where nothing was seen


def test_a_right_model_put_back_to_its_own_states_goes_on_as_it_did(tmp_path):
    model = rig_model(tmp_path, SERVO)
    whole = angles(model)
    log = Log(model, Take("x", "recording", TIMES, ("j",), whole, starts_at=0.0))
    assert np.abs(angles(model, recorded_states(log, 0.5)) - whole).max() < 2e-3


def test_what_a_wrong_model_leaves_begins_anew_in_each_window(tmp_path):
    model = rig_model(tmp_path, SERVO)
    recorded = angles(model.with_effect(EffectSpec("load_friction", ("j",), {"coefficient": 0.5})))
    log = Log(model, Take("x", "recording", TIMES, ("j",), recorded, starts_at=0.0))
    left = np.abs(angles(model, recorded_states(log, 0.5)) - recorded)[:, 0]
    after = TIMES % 0.5
    assert np.median(left[(TIMES > 0.5) & (after < 0.02)]) < 0.2 * np.median(left[(TIMES > 0.5) & (after > 0.2)])
    assert left.mean() < np.abs(angles(model) - recorded).mean()


@pytest.mark.parametrize("late", [0.0, 0.004])
def test_a_joint_that_was_not_seen_is_left_alone(tmp_path, late):
    model, unseen = rig_model(tmp_path, SERVO), np.full((1, 1), np.nan)
    put = angles(model, JointStates(np.array([1.0 + late]), unseen, unseen))
    np.testing.assert_allclose(put, angles(model), atol=1e-9)


def test_a_sensor_with_its_own_clock_does_not_spoil_the_speed_of_a_steady_swing():
    time = np.arange(0.0, 6.0, 0.01)
    held = np.floor((time + 1.3e-3) / 8e-3) * 8e-3  # refreshed every 8 ms, read every 10 ms
    position, speed = (f(held if f is np.sin else time) for f in (np.sin, np.cos))
    at = np.arange(0.5, 5.5, 0.5)
    _, told = states_at(time, 4.0 * position, at)
    narrow = [np.polynomial.polynomial.polyfit(time[near] - t, 4.0 * position[near], 3)[1]
              for t in at for near in [np.abs(time - t) <= 0.03 + 1e-9]]
    true = 4.0 * np.interp(at, time, speed)
    assert np.abs(told - true).max() < 0.3 * np.abs(narrow - true).max()
