"""How the player brings the robot to rest before a motion."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.device.servos import arm, robot
from tests.device.test_play import OPTIONS, played
from workbench.device.virtual import seconds


def test_a_joint_that_hangs_is_brought_to_neutral_itself_and_let_down_from_there(tmp_path):
    """From below its friction would hold it elsewhere than the simulated robot, which rests where it falls to from neutral."""
    r = robot(model=arm(tmp_path))
    sense, hangs = r.body.sense, 3 * 300 / 1023
    r.body.sense = lambda joint, now: replace(s := sense(joint, now), angle=s.angle - math.radians(hangs) * (joint == 2))
    result = played(tmp_path, r)
    servo = r.servos["two"]
    told = [(seconds(t), value) for t, a, value in servo.written if a == 30 and seconds(t) < result.started - 0.1]
    above = [t for t, value in told if value == 515]
    down = [t for t, value in told if value == 512 and t > above[-1]]
    assert down[0] - above[0] == pytest.approx(0.3, abs=0.02)
    log = np.genfromtxt(tmp_path / "wave.csv", delimiter=",", names=True, deletechars="")
    first = log["time"][np.abs(log["goal.one"]) > 1e-6][0]
    assert first == pytest.approx(OPTIONS.rest, abs=0.02), "the log begins when all have come to rest"
    assert result.started - down[0] == pytest.approx(OPTIONS.seat_seconds + OPTIONS.rest, abs=0.03)
