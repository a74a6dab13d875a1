"""A robot that is not the puppy: other lengths, other masses, other ways round of its servos."""

import numpy as np

from tests.shared_data import practice
from workbench.compare.session import load_session
from workbench.gait.evaluate import Evaluator
from workbench.gait.machine import GaitMachine
from workbench.gait.request import Request
from workbench.gait.shape import GaitShape


def test_the_practice_quadruped_walks_by_the_same_numbers():
    model = load_session(practice("p0_nothing_hidden")).model
    machine = GaitMachine(model)
    trot = GaitShape("trot", (-1, 1), 12, 2.4, stride=0.07, duty=0.6, lift=0.03, crouch=0.045, lead=1.0)
    forward, = Evaluator(machine, Request(), []).judge([trot], 0)
    assert forward.nominal is not None
    assert not forward.nominal.fell
    assert forward.nominal.speed > 0.15
    assert {m.where for m in forward.margins if m.name == "range"} == set(model.joints)
    assert np.isfinite([m.use for m in forward.margins]).all()
