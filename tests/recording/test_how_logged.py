"""Logging conditions identified from the log alone: a sensor refreshed more slowly than it is read, and a duty register."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.shared_data import SHARED
from workbench.recording.formats.read import read_recording
from workbench.recording.servo_log.duty_register import RegisterLog, duty_of, law_of, ramp_goals
from workbench.recording.servo_log.held_sensor import at_their_stamps, refresh_of

COUNT = 2 * np.pi / 4096


def swing(t: np.ndarray) -> np.ndarray:
    return 0.9 * np.sin(5.0 * t) + 0.3 * np.sin(13.0 * t + 1.0)


def read_late(period: float, row: float = 0.01, jitter: float = 5e-5, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Times and positions of six seconds, read every `row` from a sensor that is refreshed every `period` [s]; 0: always."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 6.0, row)
    t = t + rng.normal(size=len(t)) * jitter
    measured = t - np.mod(t - 0.0031, period) if period else t
    return t, np.round(swing(measured) / COUNT) * COUNT


@pytest.mark.parametrize(("period", "row"), [(0.008, 0.01), (0.0123, 0.01), (0.0075, 0.005)])
def test_period_and_phase_of_a_held_sensor_are_found_and_its_positions_brought_to_their_stamps(period, row):
    t, q = read_late(period, row)
    refresh = refresh_of(t, q)
    assert refresh is not None
    assert refresh.period == pytest.approx(period, rel=5e-4)
    before, after = (float(np.sqrt(np.mean(np.square(x - swing(t))))) for x in (q, at_their_stamps(t, q, refresh)))
    assert after < 0.25 * before


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_that_is_measured_as_it_is_read_is_not_held(seed):
    assert refresh_of(*read_late(0.0, seed=seed)) is None
    assert refresh_of(*read_late(0.0, row=0.005, jitter=1e-3, seed=seed)) is None


def test_a_joint_that_hardly_moves_tells_nothing():
    t, q = read_late(0.008)
    assert refresh_of(t, np.round(1e-3 * q / COUNT) * COUNT) is None


def test_a_gap_stays_one():
    t, q = read_late(0.008)
    q[100:103] = np.nan
    refresh = refresh_of(t, q)
    assert refresh is not None
    out = at_their_stamps(t, q, refresh)
    np.testing.assert_array_equal(np.isnan(out), np.isnan(q))


def servo_log(gain: float, seed: int, told: float | None = None) -> tuple[np.ndarray, ...]:
    """A log of a servo with 18 ms of delay, a ramp of 5 rad/s, 1.5 % of minimum duty and a dead zone of a count."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 6.0, 0.01)
    goal = np.where(np.mod(t, 1.5) < 0.75, 0.8, -0.8) if seed % 2 else 0.9 * np.sin((1.0 + seed) * t)
    reference = ramp_goals(t, goal, t - 0.018, 5.0)
    lagging = np.zeros_like(t)
    for k in range(1, len(t)):
        lagging[k] = lagging[k - 1] + 0.12 * (reference[k - 1] - 0.06 - lagging[k - 1])
    position = lagging + rng.normal(size=len(t)) * 3e-4
    e = reference - position
    duty = np.clip(np.sign(e) * (gain * np.maximum(np.abs(e) - COUNT, 0.0) + 0.015 * (np.abs(e) > COUNT)), -1.0, 1.0)
    return t, goal, position, duty


def as_register(duty: np.ndarray, scale: float = 100.0) -> np.ndarray:
    counts = np.round(1000 * np.abs(duty))
    return np.where(duty > 0, counts + 1024, counts) / scale


def test_the_register_is_recognised_by_its_sign_bit_in_any_unit_and_nothing_else_is():
    t, goal, position, duty = servo_log(2.6, 0)
    on = np.ones(len(t), dtype=bool)
    for scale in (1.0, 100.0):
        np.testing.assert_allclose(duty_of(as_register(duty, scale), goal - position, on), duty, atol=6e-4)
    np.testing.assert_allclose(duty_of(as_register(-duty), goal - position, on), duty, atol=6e-4)  # counted the other way
    for other in (duty, np.abs(duty) * 1000, np.round(40 + 3 * duty), np.zeros_like(t), np.full_like(t, np.nan)):
        assert duty_of(other, goal - position, on) is None


def test_a_servos_law_is_read_from_its_register_over_logs_of_several_gains():
    logs = []
    for seed, gain in enumerate((1.3, 2.6, 2.6)):
        t, goal, position, duty = servo_log(gain, seed)
        logs.append(RegisterLog(t, goal, position, duty, np.ones(len(t), dtype=bool), 2 * gain))  # told twice what it is
    law = law_of(logs)
    assert law is not None
    assert law.gain == pytest.approx(0.5, rel=0.02)
    assert law.delay == pytest.approx(0.018, abs=1.5e-3)
    assert law.ramp == pytest.approx(5.0, rel=0.03)
    assert law.minimum_duty == pytest.approx(0.015, abs=4e-3)
    assert "ramp 28" in str(law)
    assert law_of([]) is None


def test_goals_stamped_by_another_clock_are_told_from_late_ones():
    logs = []
    for seed, gain in enumerate((1.3, 2.6, 2.6)):
        t, goal, position, duty = servo_log(gain, seed)
        logs.append(RegisterLog(t, np.interp(1.01 * t, t, goal), position, duty, np.ones(len(t), dtype=bool), gain))
    law = law_of(logs)
    assert law is not None
    assert law.rate == pytest.approx(1.01, abs=1e-3)
    assert law.delay == pytest.approx(0.018, abs=2e-3)
    assert law.gain == pytest.approx(1.0, rel=0.02)


def test_a_goal_ramps_on_its_way_and_stands_where_it_has_come():
    sent, goal = np.array([0.0, 1.0, 1.5]), np.array([0.0, 1.0, 0.8])
    np.testing.assert_allclose(ramp_goals(sent, goal, np.array([0.5, 1.2, 1.4, 1.6, 3.0]), 1.0), [0.0, 0.2, 0.4, 0.6, 0.8])
    np.testing.assert_allclose(ramp_goals(sent, goal, np.array([1.2, 1.6]), np.inf), [1.0, 0.8])


def test_a_bam_log_with_the_register_in_another_column_has_duty_and_says_so(tmp_path):
    t, goal, position, duty = servo_log(2.6, 0)
    rows = zip(t.tolist(), goal.tolist(), position.tolist(), as_register(duty).tolist())
    entries = [{"timestamp": a, "goal_position": g, "position": q, "torque": x, "load": 0, "torque_enable": True}
               for a, g, q, x in rows]
    path = tmp_path / "log.json"
    path.write_text(json.dumps({"motor": "m", "entries": entries}))
    r = read_recording(path)
    np.testing.assert_allclose(r.channels["duty.m"], duty, atol=6e-4)
    assert r.notes == ("duty.m is the servo's own register, which the column `torque` holds",)
    assert not any("load" in text for text in r.problems)


@pytest.mark.skipif(not (SHARED / "data" / "sts3215").is_dir(), reason="needs the recordings in ../shared/data/sts3215")
def test_a_real_servo_of_which_this_is_so_and_others_of_which_it_is_not():
    found = [read_recording(p) for p in sorted((SHARED / "data" / "sts3215").glob("arm150_0.741kg_kp*_sin_sin_1.json"))]
    periods = [float(text.split(" every ")[1].split()[0]) for r in found for text in r.notes if "refreshed" in text]
    assert len(periods) == len(found) == 3
    assert periods == pytest.approx([8.0] * 3, abs=0.01)
    assert all(any("register" in text for text in r.notes) for r in found)
    assert not any(read_recording(p).notes for p in sorted((SHARED / "data" / "xl330").glob("*.json")))
