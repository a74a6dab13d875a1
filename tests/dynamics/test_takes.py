"""Inverse dynamics of takes: derivatives with gaps and noise, unseen channels, files, and a simulated walk."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

from tests.quadruped import quadruped_sdf, stand_csv
from workbench.dynamics import (
    InverseDynamics,
    InverseDynamicsResult,
    RobotTrajectory,
    inverse_dynamics,
    load_inverse_dynamics,
    save_inverse_dynamics,
)
from workbench.dynamics.derivatives import differentiate
from workbench.dynamics.trajectory import angular_motion
from workbench.files import InputError
from workbench.motion import load_motion
from workbench.motion.commands import Commands
from workbench.recording import Take, quaternions
from workbench.robot import Ground, RobotModel, data_file
from workbench.simulation import Simulation, SimulationConfig
from workbench.simulation.play import play_motion
from workbench.view.report.forces import margin_table

RATE = 120.0


@pytest.fixture(scope="module")
def model() -> RobotModel:
    return RobotModel(description=str(quadruped_sdf()), ground=Ground(0.6, 1e5, 20.0))


@pytest.fixture(scope="module")
def walk(model: RobotModel) -> Take:
    motion = load_motion(data_file("robotis_walk.csv"), model)
    return play_motion(Simulation(model, SimulationConfig(contact_period=1e-3)), motion, cycles=3)


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def waving(model: RobotModel, seconds: float = 2.0, base: str = "fixed") -> tuple[Take, RobotTrajectory]:
    """All joints on slow sines (and a base that bobs and turns), as a take at 120 Hz and exactly."""
    t = np.arange(0, seconds, 1 / RATE)[:, None]
    n = len(model.joints)
    w, phase = 2 * np.pi * np.linspace(0.5, 1.2, n), np.linspace(0, 5, n)
    q, v, a = 0.3 * np.sin(w * t + phase), 0.3 * w * np.cos(w * t + phase), -0.3 * w**2 * np.sin(w * t + phase)
    N, turn = len(t), np.zeros((len(t), 6))
    p, quat, V, A = np.zeros((N, 3)), np.tile([1.0, 0, 0, 0], (N, 1)), turn.copy(), turn.copy()
    if base == "free":  # a turn about z at a growing rate, and a bob
        yaw, rate = 0.4 * t[:, 0] ** 2, 0.8 * t[:, 0]
        quat = Rotation.from_rotvec(np.outer(yaw, [0, 0, 1])).as_quat(scalar_first=True)
        p[:, 2], V[:, 5], A[:, 5] = 0.3 + 0.01 * np.sin(5 * t[:, 0]), 0.05 * np.cos(5 * t[:, 0]), -0.25 * np.sin(5 * t[:, 0])
        V[:, 2], A[:, 2] = rate, 0.8
    take = Take("waving", "test", t[:, 0], model.joints, q, base=base, p_WB=p, quat_WB=quat)
    return take, RobotTrajectory(t[:, 0], model.joints, q, v, a, p, quat, V, A)


# ---- derivatives ---------------------------------------------------------------------------------------------------------------


def test_cubics_come_out_exactly_through_gaps_and_uneven_times() -> None:
    rng = np.random.default_rng(0)
    t = np.sort(rng.uniform(0, 2, 240))
    c = rng.normal(size=(2, 4))
    y = np.polynomial.polynomial.polyval(t, c.T).T
    y[100:103, 0] = np.nan
    y[200, 1] = np.nan
    d = differentiate(t, y, 0.15)
    seen = np.isfinite(y)
    for order, got in enumerate((d.value, d.first, d.second)):
        exact = np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyder(c.T, order)).T
        enough = np.isfinite(got)
        assert enough[seen].mean() > 0.98
        assert not enough[~seen].any()
        np.testing.assert_allclose(got[enough], exact[enough], atol=1e-6 * 10.0**order)


def test_even_samples_give_savitzky_and_golay() -> None:
    y = np.random.default_rng(1).normal(size=(100, 3))
    d = differentiate(np.arange(100) / RATE, y, 12 / RATE)
    for order, got in enumerate((d.value, d.first, d.second)):
        expected = savgol_filter(y, 13, 3, deriv=order, delta=1 / RATE, axis=0)
        np.testing.assert_allclose(got[6:-6], expected[6:-6], atol=1e-9 * RATE**order)


def test_noise_is_found_under_a_motion() -> None:
    rng = np.random.default_rng(2)
    t = np.arange(0, 6, 1 / RATE)
    d = differentiate(t, np.sin(6 * t)[:, None] + rng.normal(0, [[1e-3, 4e-3]], (len(t), 2)), 0.1)
    np.testing.assert_allclose(d.noise, [1e-3, 4e-3], rtol=0.15)


def test_turning_comes_from_quaternions_of_either_sign() -> None:
    t = np.arange(0, 2, 1 / RATE)
    tilt = Rotation.from_rotvec([0.3, -0.2, 0.1])
    spin = Rotation.from_rotvec(np.outer(0.5 * t + 0.6 * t**2, [0, 0, 1]))
    quat = (spin * tilt).as_quat(scalar_first=True)
    quat[::3] *= -1
    d = differentiate(t, quaternions.continuous(quat)[0], 0.05)
    s, s1, s2 = (1.5 + np.sin(3 * t))[:, None], 3 * np.cos(3 * t)[:, None], -9 * np.sin(3 * t)[:, None]  # length does not matter
    stretched = s * d.value, s1 * d.value + s * d.first, s2 * d.value + 2 * s1 * d.first + s * d.second
    u, omega, alpha = angular_motion(*stretched)
    np.testing.assert_allclose(np.abs(np.sum(u * quat, axis=1))[5:-5], 1, atol=1e-6)
    np.testing.assert_allclose(omega[5:-5], np.outer(0.5 + 1.2 * t, [0, 0, 1])[5:-5], atol=2e-4)
    np.testing.assert_allclose(alpha[5:-5], np.outer(np.full(len(t), 1.2), [0, 0, 1])[5:-5], atol=0.02)


# ---- takes ---------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("base", ["fixed", "free"])
def test_a_take_gives_what_its_exact_motion_gives(model: RobotModel, base: str) -> None:
    take, exact = waving(model, base=base)
    solver = InverseDynamics(model, base=base)  # type: ignore[arg-type]
    result, expected = solver.of_take(take, window=0.1, floor=0.0, draws=0), solver.of(exact)
    inner = slice(8, -8)
    for key in ("torque", "motor_torque", "support", "base_wrench_residual"):
        got, want = getattr(result, key)[inner], getattr(expected, key)[inner]
        np.testing.assert_allclose(got, want, atol=0.01 * np.abs(want).max() + 1e-12, err_msg=key)
    assert result.problems == ()


@pytest.mark.parametrize("base", ["fixed", "free"])
def test_stated_uncertainty_is_the_scatter_of_the_error(model: RobotModel, walk: Take, base: str) -> None:
    """With known noise, errors over their stated sigma have a spread near one: a stand and a simulated walk at 120 Hz."""
    take = waving(model)[0] if base == "fixed" else walk.resampled(np.arange(-0.25, 1.35, 1 / RATE))
    solver = InverseDynamics(model, base=base)  # type: ignore[arg-type]
    clean = solver.of_take(take, window=0.1, draws=0)
    rng = np.random.default_rng(7)
    sigma = np.radians(0.12)
    moved = Rotation.from_rotvec(rng.normal(0, sigma, (len(take), 3))) * Rotation.from_quat(take.quat_WB, scalar_first=True)
    noisy = replace(take, q=take.q + rng.normal(0, sigma, take.q.shape), q_sigma=np.full(take.q.shape, sigma),
                    p_WB=take.p_WB + rng.normal(0, 1e-4, (len(take), 3)), quat_WB=moved.as_quat(scalar_first=True))
    result = solver.of_take(noisy, window=0.1, draws=8)
    assert result.torque_sigma.min() > 0
    assert 0.7 < rms(((result.torque - clean.torque) / result.torque_sigma)[8:-8]) < 1.4
    if base == "free":
        error = result.base_wrench_residual - clean.base_wrench_residual
        assert 0.6 < rms((error / result.residual_sigma)[8:-8]) < 1.5
        turned = replace(take, quat_WB=noisy.quat_WB, q_sigma=np.zeros(take.q.shape))
        alone = solver.of_take(turned, window=0.1, draws=8)
        assert 0.5 < rms((alone.torque - clean.torque)[8:-8]) / rms(alone.torque_sigma[8:-8]) < 2
    guessed = solver.of_take(replace(noisy, q_sigma=None), window=0.1, draws=8)  # from the scatter alone
    np.testing.assert_allclose(np.median(guessed.torque_sigma, axis=0), np.median(result.torque_sigma, axis=0), rtol=0.4)


def test_gaps_stay_gaps_and_are_said(model: RobotModel) -> None:
    take, _ = waving(model)
    q = take.q.copy()
    q[60:70, take.column("flm")] = np.nan
    result = inverse_dynamics(model, replace(take, q=q))
    gone = ~np.isfinite(result.torque).all(axis=1)
    assert np.array_equal(np.flatnonzero(gone), np.arange(60, 70))
    assert not np.isfinite(result.torque_sigma[gone]).any()
    assert any(p.startswith("flm: gaps in 4.2 %") for p in result.problems)
    assert np.isfinite([load.rms for load in result.loads.values()]).all()
    unseen = replace(take, base="free", p_WB=np.full((len(take), 3), np.nan))
    with pytest.raises(InputError, match="no sample has all joints"):
        inverse_dynamics(model, unseen)


def test_joints_that_were_not_seen_are_held(model: RobotModel) -> None:
    take, _ = waving(model)
    seen = tuple(j for j in model.joints if j not in ("neck", "head"))
    part = replace(take, joints=seen, q=take.q[:, [take.column(j) for j in seen]])
    result = inverse_dynamics(model, part, draws=0)
    assert np.all(result.q[:, [result.column("neck"), result.column("head")]] == 0)
    assert result.problems == ("head, neck: not seen; held at zero",)
    commands = Commands(np.array([0.0]), ("neck",), np.array([[0.5]]), np.array([[0.0]]), np.array([[True]]), 1.0, np.array([0]))
    told = inverse_dynamics(model, replace(part, commands=commands, starts_at=-1.0), draws=0)
    np.testing.assert_allclose(told.q[:, told.column("neck")], 0.5, atol=1e-9)
    assert "commanded" in told.problems[0]
    assert np.abs(told.torque[:, told.column("neck")] - result.torque[:, told.column("neck")]).max() > 0.01


def test_a_zeroed_take_stands_at_its_rest_angles(model: RobotModel) -> None:
    take, _ = waving(model, base="free")
    whole = inverse_dynamics(model, take, draws=0)
    tilt = quaternions.about(np.array([0, 1.0, 0]), 0.05)
    level = quaternions.multiply(take.quat_WB, quaternions.conjugate(tilt))
    zeroed = replace(take, q=take.q - 0.1, quat_WB=level, zeroed=True)
    again = inverse_dynamics(model, zeroed, draws=0, rest=dict.fromkeys(model.joints, 0.1), rest_rotation=tilt)
    np.testing.assert_allclose(again.torque, whole.torque, atol=1e-6)
    np.testing.assert_allclose(again.base_wrench_residual, whole.base_wrench_residual, atol=1e-5)
    assert "taken as zero" in inverse_dynamics(model, zeroed, draws=0).problems[0]


def test_takes_that_do_not_fit_are_refused(model: RobotModel) -> None:
    take, _ = waving(model)
    with pytest.raises(InputError, match="joint 'knee'"):
        inverse_dynamics(model, replace(take, joints=("knee", *take.joints[1:])))
    with pytest.raises(InputError, match="the take's is fixed"):
        InverseDynamics(model).of_take(take)
    with pytest.raises(InputError, match="no pose of 'body_link'"):
        inverse_dynamics(model, replace(take, base="free", p_WB=None))


def test_a_base_led_along_a_path_is_supported_by_what_leads_it(model: RobotModel) -> None:
    take, exact = waving(model, base="free")
    led = inverse_dynamics(model, replace(take, base="path"), draws=0, window=0.1)
    down = {f: np.zeros(len(take), dtype=bool) for f in ("blb", "brb", "flb", "frb")}
    alone = InverseDynamics(model).of(exact, stance=down)
    np.testing.assert_allclose(led.support[8:-8], alone.base_wrench_residual[8:-8], atol=0.15)
    assert np.all(led.base_wrench_residual == 0)


# ---- files ---------------------------------------------------------------------------------------------------------------------


def result_with_everything(model: RobotModel) -> InverseDynamicsResult:
    take, _ = waving(model, seconds=0.5, base="free")
    q = take.q.copy()
    q[20:22, 3] = np.nan
    return InverseDynamics(model).of_take(replace(take, q=q), draws=2)


def test_a_result_comes_back_from_its_file(model: RobotModel, tmp_path: Path) -> None:
    result = result_with_everything(model)
    back = load_inverse_dynamics(save_inverse_dynamics(result, tmp_path / "new" / "id.csv"))
    for key in ("time", "q", "v", "a", "torque", "motor_torque", "base_wrench_residual", "support", "torque_margin",
                "speed_margin", "torque_sigma", "residual_sigma"):
        np.testing.assert_allclose(getattr(back, key), getattr(result, key), rtol=1e-7, atol=1e-12, err_msg=key)
    assert (back.name, back.base, back.joints, back.problems) == (result.name, result.base, result.joints, result.problems)
    assert back.loads == result.loads
    assert tuple(back.contact) == tuple(result.contact)
    for foot, force in result.contact.items():
        np.testing.assert_allclose(back.contact[foot], force, rtol=1e-7, atol=1e-12)


def test_the_margins_have_the_uncertainty_of_noise(model: RobotModel) -> None:
    """Ten times the noise, ten times the standard deviation, which the table shows next to the margin."""
    take, _ = waving(model, seconds=0.5)
    results = [inverse_dynamics(model, replace(take, source="motive", q_sigma=np.full(take.q.shape, noise)), draws=8, window=0.1)
               for noise in (1e-4, 1e-3)]
    small, large = (np.array([load.torque_sigma for load in r.loads.values()]) for r in results)
    assert np.median(large / small) == pytest.approx(10, rel=0.3)
    assert f"(sd {large[0]:.2f})" in margin_table(results[1])
    assert "noise" in margin_table(results[1])
    assert "sd" not in margin_table(inverse_dynamics(model, take, draws=0))


def test_files_speak_degrees(model: RobotModel, tmp_path: Path) -> None:
    import pandas as pd

    result = result_with_everything(model)
    table = pd.read_csv(save_inverse_dynamics(result, tmp_path / "id.csv"), comment="#")
    np.testing.assert_allclose(table["position.flm"], np.degrees(result.q[:, result.column("flm")]), rtol=1e-8)
    np.testing.assert_allclose(table["residual.force.z"], result.base_wrench_residual[:, 5], rtol=1e-8)


def test_damaged_files_are_refused_with_their_line(model: RobotModel, tmp_path: Path) -> None:
    path = save_inverse_dynamics(result_with_everything(model), tmp_path / "id.csv")
    lines = path.read_text().splitlines()

    def damaged(change: dict[int, str]) -> Path:
        out = tmp_path / "damaged.csv"
        out.write_text("\n".join(change.get(i, line) for i, line in enumerate(lines)) + "\n")
        return out

    renamed = lines[3].replace("support.moment.y", "support.my")
    for change, message in (({0: "time,torque"}, "line 1"), ({1: "# {}"}, "line 2"), ({1: '# {"loads": 3}'}, "line 2"),
                            ({10: lines[10][:50]}, "line 11: expected"), ({3: renamed}, "'support.moment.y' is missing"),
                            ({7: "x" + lines[7]}, "expected numbers")):
        with pytest.raises(InputError, match=message):
            load_inverse_dynamics(damaged(change))
    with pytest.raises(InputError, match="cannot be read"):
        load_inverse_dynamics(tmp_path / "none.csv")
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(InputError):
        save_inverse_dynamics(result_with_everything(model), blocked / "id.csv")


# ---- a simulated walk ----------------------------------------------------------------------------------------------------------


def test_a_simulated_walk_is_explained(model: RobotModel, walk: Take) -> None:
    """Torques and forces that another computation (the discrete plant with its contact solver) put in come out again."""
    solver = InverseDynamics(model)
    result = solver.of_take(walk)
    inner = slice(20, -20)
    rotor = np.array([model.servo(j).reflected_inertia for j in model.joints])
    ours = (result.torque + rotor * result.a)[inner]
    truth = differentiate(walk.time, walk.torque, 0.02).value[inner]
    assert rms(ours - truth) < 0.4 * rms(truth)
    assert np.corrcoef(ours.ravel(), truth.ravel())[0, 1] > 0.9
    weight = solver.machine.mass * 9.81
    total = sum(result.contact.values())[inner]
    expected = differentiate(walk.time, sum(walk.contact[f] for f in result.contact), 0.02).value[inner]
    assert rms(total - expected) < 0.08 * weight
    residual = np.linalg.norm(result.base_wrench_residual[inner, 3:], axis=1)
    assert np.median(residual) < 1e-3 * weight
    assert rms(residual) < 0.05 * weight


def test_a_floor_believed_too_slippery_shows_in_the_residual(model: RobotModel, walk: Take) -> None:
    right = InverseDynamics(model).of_take(walk, draws=0)
    wrong = InverseDynamics(model, friction=0.1).of_take(walk, draws=0)
    assert rms(wrong.base_wrench_residual[20:-20, 3:]) > 3 * rms(right.base_wrench_residual[20:-20, 3:])


def test_at_rest_the_servos_hold_what_statics_says(model: RobotModel) -> None:
    """On the stand nothing is left to choose: simulated and reconstructed torques agree closely."""
    motion = load_motion(stand_csv(), model)
    take = play_motion(Simulation(model, SimulationConfig(base="fixed")), motion, cycles=1)
    part = take.resampled(np.arange(-0.2, 3.0, 1e-3))
    result = inverse_dynamics(model, part, draws=0)
    rotor = np.array([model.servo(j).reflected_inertia for j in model.joints])
    ours = (result.torque + rotor * result.a)[20:-20]
    truth = differentiate(part.time, part.torque, 0.02).value[20:-20]
    assert rms(ours - truth) < 0.05 * rms(truth)
