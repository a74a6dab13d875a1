"""The error of a rollout's time step is subtracted, as estimated for a similar robot."""

import numpy as np
import pytest

from tests.evidence.linear import FRAME
from workbench import load_session
from workbench.compare.session_takes import read_takes
from workbench.identify.evidence.rollouts import StepErrors, extrapolate
from workbench.identify.options import PROBLEM
from workbench.robot import EffectSpec, data_file, puppy_model
from workbench.simulation import SimulationConfig
from workbench.simulation.compiled.angles import servo_angles
from workbench.simulation.job import Job

TIMES = np.arange(0.2, 4.8, FRAME)


def test_an_error_of_the_first_order_is_taken_off_whole_and_each_step_rolled_out_once():
    asked = []

    def roll(questions):
        asked.extend(q.step for q in questions)
        return [{0: np.array([[5.0], [np.nan]]) + 3.0 * q.step} for q in questions]

    errors, robot = StepErrors((0,), roll), puppy_model()
    for step in (2.0, 1.0, 2.0, 0.5):
        np.testing.assert_allclose(errors.at(robot, step)[0], [[3.0 * step], [0.0]])
    assert asked == [2.0, 2 * PROBLEM.fine, PROBLEM.fine, 1.0, 0.5]


def angles(take, model, step):
    config = SimulationConfig(base="fixed", settle=0.02, time_step=step, engine="compiled")
    job = Job(model, config, take.commands, TIMES[-1] + 0.1, 0.1, name="x", times=TIMES, start=take.start_state())
    return servo_angles([[job]])[0][0]


@pytest.mark.parametrize("which", [0, 1], ids=["slow", "steps"])
def test_of_an_arm_with_more_friction_a_tenth_of_the_error_is_left(which):
    """The tutorial's arm: what the nominal robot's steps are wrong by is what those of the worn one are."""
    session = load_session(data_file("tutorial_arm/session.yaml"))
    take = read_takes(session)[0][which]
    worn = session.model.with_effect(EffectSpec("coulomb_friction", ("elbow",), {"torque": 0.12}))
    nominal = {step: angles(take, session.model, step) for step in (2e-3, 1e-3, 5e-4)}
    right = angles(take, worn, 6.25e-5)
    wrong = nominal[2e-3] - extrapolate(nominal[1e-3], nominal[5e-4])
    raw = angles(take, worn, 2e-3)
    before, after = (np.sqrt(np.square(x - right).mean()) for x in (raw, raw - wrong))
    assert before > np.radians(0.04)  # as much as the log's noise
    assert after < 0.25 * before
