"""Numbers of runs whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.files import InputError
from workbench.gait.evaluate import SEARCH
from workbench.gait.limits import GaitLimits, binding, run_margins
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import fallen, measure
from workbench.gait.request import Request
from workbench.gait.requirements import direction_margins, speed_margins, worse_half
from workbench.recording.take import Take
from workbench.robot import puppy_model

MODEL = puppy_model()


def take_of(speed=0.2, turning=0.0, seconds=4.0, tilt=0.0, torque=0.3, every=0.01) -> Take:
    """A body that glides on a circle at a constant speed, its joints at rest under a torque."""
    t = np.arange(-0.1, seconds + 1e-9, every)
    on = np.maximum(t, 0)
    h = turning * on
    p = np.column_stack([np.sin(h) / turning * speed if turning else speed * on,
                         (1 - np.cos(h)) / turning * speed if turning else 0 * on, np.full_like(t, 0.18)])
    quat = np.column_stack([np.cos(h / 2) * np.cos(tilt / 2), np.sin(tilt / 2) * np.cos(h / 2), np.sin(tilt / 2) * np.sin(h / 2),
                            np.sin(h / 2) * np.cos(tilt / 2)])
    n = len(MODEL.joints)
    return Take("glide", "simulation", t, MODEL.joints, np.zeros((len(t), n)), starts_at=0.0, v=np.zeros((len(t), n)),
                p_WB=p, quat_WB=quat, torque=np.full((len(t), n), torque))


def test_speed_turn_and_torque_of_a_glide():
    m = measure(take_of(0.2, 0.5), MODEL, 0.5, 0.5)
    assert m.velocity == pytest.approx((0.2, 0.0), abs=1e-6)
    assert m.turn_rate == pytest.approx(0.5)
    assert m.rms == pytest.approx([0.3] * 15)
    assert not m.fell
    assert m.jerk < 0.2
    assert m.power == pytest.approx(16 * 0.05 * 11.1)  # no duty: what servos and controller take at rest
    assert m.drift == pytest.approx(0.5 * 3.5)


@pytest.mark.parametrize(("rows", "counts"), [(1, False), (2, False), (3, True)])
def test_a_torque_counts_from_ten_milliseconds_on(rows, counts):
    """Of rollouts as searches and certificates log them: an impulse in one row or two is none that a servo has to hold."""
    take = take_of(every=SEARCH.log_period)
    torque = take.torque.copy()
    torque[500:500 + rows, 3] = 1.2
    m = measure(replace(take, torque=torque), MODEL, 0.5, 0.5)
    assert (max(m.peak) == pytest.approx(1.2)) is counts
    assert (m.torque_use[3] > 2 * m.torque_use[4]) is counts


def test_a_tilted_or_sunken_body_fell():
    assert measure(take_of(tilt=np.radians(40)), MODEL, 0.5, 0.5).fell
    low = take_of()
    p = low.p_WB.copy()
    p[200:, 2] = 0.08
    assert measure(replace(low, p_WB=p), MODEL, 0.5, 0.5).fell
    assert fallen(15).fell


def test_margins_name_the_joint_that_has_least_left():
    machine = GaitMachine(MODEL)
    take = take_of()
    torque = take.torque.copy()
    torque[:, MODEL.joints.index("flm")] = 0.6
    m = measure(replace(take, torque=torque), MODEL, 0.5, 0.5)
    limit = binding(run_margins(machine, m, GaitLimits(rms=0.5)))
    assert (limit.name, limit.where, limit.use) == ("RMS torque", "flm", pytest.approx(1.2))
    free = binding(run_margins(machine, m, GaitLimits()))
    assert free.use == pytest.approx(0.6 / (1.3875 / 2))
    advice = [x for x in run_margins(machine, m, GaitLimits()) if x.advice and x.where == "flm"]
    assert advice[0].use == pytest.approx(0.6 / (1.3875 / 5))


def test_requests_judge_the_way_that_was_asked():
    glide, circle = measure(take_of(0.2), MODEL, 0.5, 0.5), measure(take_of(0.2, 0.4), MODEL, 0.5, 0.5)
    assert Request().progress(glide) == pytest.approx(0.2)
    assert Request("backward").progress(glide) == pytest.approx(-0.2)
    assert all(m.use < 1 for m in direction_margins(Request(), glide))
    assert any(m.use > 1 for m in direction_margins(Request(), circle))
    assert all(m.use < 1 for m in direction_margins(Request("arc", radius=0.5), circle))
    assert any(m.use > 1 for m in direction_margins(Request("arc", radius=0.5), glide))
    assert Request("turn").progress(circle) == pytest.approx(0.4)
    assert any(m.use > 1 for m in direction_margins(Request("turn"), circle))  # it walks while it turns
    slow = {m.name: m.use for m in speed_margins(Request(speed=0.3), glide, [glide, fallen(15)])}
    assert slow["speed"] > 1
    assert slow["falls"] > 1
    assert worse_half([1.0, 2.0, 3.0, 4.0]) == 1.5


@pytest.mark.parametrize(("wrong", "said"), [
    ({"speed": -1.0}, "speed: expected a positive number"), ({"way": "arc"}, "radius"), ({"radius": 1.0}, "radius"),
    ({"slope": 1.2}, "slope: expected within 60 deg"), ({"aim": "energy"}, "expected a speed to keep")])
def test_a_request_that_makes_no_sense_is_one_line(wrong, said):
    with pytest.raises(InputError, match=said):
        Request(**wrong)
