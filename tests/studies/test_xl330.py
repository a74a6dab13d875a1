"""The rig's study: its simulation and fits, on cases with known answers, and on the recordings where available."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from studies.xl330 import bam
from studies.xl330.fitting import Number, Problem, fit_all
from studies.xl330.refit import fit_published, training
from studies.xl330.rig import DUTY_PER_UNIT, Log, find_logs, nominal_servo, published, write_session
from studies.xl330.station import played
from tests.shared_data import shared
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.recording import write_joint_log

M1 = {"kt": 0.387, "R": 4.02, "armature": 0.0018, "q_offset": 0.031, "friction_base": 0.0128, "friction_viscous": 0.0037}
FRICTIONLESS = M1 | {"friction_base": 0.0, "friction_viscous": 0.0, "q_offset": 0.0}


def _logs(gains: tuple[int, ...], seconds: float, step: float) -> bam.Logs:
    """A lift, a fast wave and a release at each gain; nothing recorded yet."""
    t = np.arange(0.0, seconds, step)
    goals = {"lift": 1.4 * np.sin(1.2 * t) ** 2, "wave": np.sin(2.0 * t**2), "drop": -1.2 * np.minimum(t / 1.5, 1.0)}
    on = {name: np.ones(len(t), dtype=bool) for name in ("lift", "wave")} | {"drop": t < 1.7}
    each = [(name, g) for g in gains for name in goals]
    goal = np.column_stack([goals[name] for name, _ in each])
    return bam.Logs(tuple(f"{name}_{g}" for name, g in each), tuple(g for _, g in each), goal, np.zeros_like(goal),
                    np.column_stack([on[name] for name, _ in each]), np.zeros(len(each)),
                    np.array([g * DUTY_PER_UNIT for _, g in each]), 0.49, 0.1, 7.4)


def test_m1_in_the_words_of_a_servo_file() -> None:
    servo = nominal_servo(M1, 7.4, 100)
    assert servo["stall_torque"] == pytest.approx(0.387 * 7.4 / 4.02)
    assert float(servo["stall_torque"]) / float(servo["no_load_speed"]) == pytest.approx(0.387**2 / 4.02)  # back-EMF
    assert servo["proportional_gain"] == pytest.approx(0.28774, rel=1e-4)  # data/README.md: 0.0028774 for each unit


def test_a_free_pendulum_keeps_its_period() -> None:
    """Without motor and friction: 2 pi sqrt(I / m g l), I with the armature; and BAM's step gives and takes no energy over it."""
    logs = _logs((100,), 4.0, bam.STEP)
    logs = replace(logs, enabled=np.zeros_like(logs.enabled), position=np.full_like(logs.position, 0.05))
    q = bam.roll_out(logs, "m1", FRICTIONLESS)[:, 0, 0]
    crossings = np.flatnonzero((q[:-1] > 0) & (q[1:] <= 0)) + q[:-1][(q[:-1] > 0) & (q[1:] <= 0)] / -np.diff(q)[
        (q[:-1] > 0) & (q[1:] <= 0)]
    expected = 2 * np.pi * np.sqrt((0.49 * 0.01 + 0.0018) / (0.49 * bam.GRAVITY * 0.1))
    assert np.mean(np.diff(crossings)) * bam.STEP == pytest.approx(expected, rel=3e-3)


@pytest.mark.parametrize(("model", "more", "budget"), [
    ("m1", {}, 0.02),
    ("m3", {"load_friction_base": 0.2}, 0.02 + 0.2 * 0.5),
    ("m4", {"load_friction_base": 0.2, "load_friction_stribeck": 0.1, "friction_stribeck": 0.03},
     0.02 + 0.03 / np.e + 0.5 * (0.2 + 0.1 / np.e)),
    ("m6", {"load_friction_motor": 0.3, "load_friction_external": 0.1, "load_friction_motor_stribeck": 0.0,
            "load_friction_external_stribeck": 0.0, "load_friction_motor_quad": 0.01, "load_friction_external_quad": 0.005,
            "friction_stribeck": 0.0}, 0.02 + abs(-0.2 * 0.1 - 0.3 * 0.3) + 0.005 * 0.04 / np.e),
])
def test_budgets_of_friction(model: str, more: dict[str, float], budget: float) -> None:
    """Motor 0.3 N m against a load of -0.2, at the Stribeck speed (bam/model.py, compute_frictions, by hand)."""
    p = {k: np.array(v) for k, v in ({"friction_base": 0.02, "dtheta_stribeck": 0.5, "alpha": 2.0} | more).items()}
    found = bam.friction(model, p, np.array(0.3), np.array(-0.2), np.array(0.5))
    assert float(found) == pytest.approx(budget)


def test_a_refit_finds_what_was_put_in() -> None:
    logs = _logs((100, 200, 400), 2.0, bam.STEP)
    true = M1 | {"friction_base": 0.03, "q_offset": 0.0}
    logs = replace(logs, position=bam.roll_out(logs, "m1", true)[:, 0])
    (found,) = fit_published("m1", M1, logs, [training(logs, 200)], starts=1)
    assert bam.errors(logs, bam.roll_out(logs, "m1", found))[0].max() < 2e-3
    assert found["friction_base"] == pytest.approx(0.03, rel=0.05)


def test_fits_stay_in_bounds_and_beside_each_other() -> None:
    """A line fitted twice in one go: freely, and with a bound that holds the slope down."""
    x = np.linspace(0, 1, 200)[:, None]
    numbers = (Number("slope", 0.5, 0.0, 3.0, 0.5), Number("base", 0.0, -1.0, 1.0, 0.1))
    held = (Number("slope", 0.5, 0.0, 1.0, 0.5), numbers[1])
    both = np.array([True])
    free, bounded = fit_all([Problem(numbers, both), Problem(held, both)],
                            lambda v: v["slope"][None, :, None] * x[:, :, None] + v["base"][None, :, None], 2.0 * x + 0.3, {})
    assert free.values == pytest.approx({"slope": 2.0, "base": 0.3}, abs=1e-3)
    assert bounded.values["slope"] == pytest.approx(1.0)
    assert bounded.cost > free.cost


def test_a_session_of_the_rig(tmp_path: Path) -> None:
    t = np.linspace(0.1, 2.0, 300)
    for gain in (100, 200):
        write_joint_log(tmp_path / f"{gain}.csv", t, {"goal.servo": np.sin(t), "position.servo": 0.9 * np.sin(t),
                                                      "velocity.servo": np.cos(t), "enabled.servo": t * 0 + 1})
    found = [Log(tmp_path / f"{g}.csv", g, "wave", 0.49, 0.1, 7.4) for g in (100, 200)]
    path = write_session(tmp_path / "session", found[:1], M1, predict=found[1:])
    session = load_session(path)
    assert session.takes[0].servos["proportional_gain"] == pytest.approx(100 * DUTY_PER_UNIT)
    assert session.predict[0].servos["proportional_gain"] == pytest.approx(200 * DUTY_PER_UNIT)
    assert session.model.kinematics.masses["arm"] == pytest.approx(0.49)
    rows = np.genfromtxt(tmp_path / "session/predict/wave_200.csv", delimiter=",", names=True)
    assert np.isfinite(rows["positionservo"]).sum() == 1
    assert list(played(session, session.model, 100)) == ["wave_100"]
    assert "use" not in yaml.safe_load(path.read_text())["takes"][0]
    with pytest.raises(InputError, match="logs of one rig"):
        write_session(tmp_path / "other", [found[0], replace(found[1], mass=0.5)], M1)
    with pytest.raises(InputError, match="expected BAM logs"):
        find_logs(tmp_path)


def test_published_models_err_as_the_data_say() -> None:
    """data/README.md: M1 82, M3 69, M6 74 mrad on logs of this rig that are not in the folder. Between its gains 200 and 400 they
    leave the same to a few per cent."""
    folder = shared("data/xl330")
    logs = bam.even(find_logs(folder)).at([200, 400])
    for model, said in (("m1", 82), ("m3", 69), ("m6", 74)):
        error = 1e3 * bam.errors(logs, bam.roll_out(logs, model, published(folder, model))).mean()
        assert error == pytest.approx(said, rel=0.04), model
