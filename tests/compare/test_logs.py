"""Sessions whose takes are servo logs: rollouts begin where the log does, on its clock, with its torque releases."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.command import refused, succeeds
from tests.servo_rig import SDF
from workbench.compare.compare_session import compare_session
from workbench.compare.prediction import predict_session
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes, register_takes
from workbench.recording import read_recording, write_joint_log
from workbench.recording.formats.log_commands import commands_of_rows
from workbench.recording.servo_log.state import state_at
from workbench.robot import EffectSpec, RobotModel
from workbench.simulation import Job, Simulation, SimulationConfig, Start, simulate_batch

SERVO = {"stall_torque": 0.7, "no_load_speed": 19.0, "rated_voltage": 7.4, "supply_voltage": 7.4, "coulomb_friction": 0.013,
         "viscous_friction": 0.004, "reflected_inertia": 0.0018, "proportional_gain": 1.15}
FIXED = SimulationConfig(base="fixed", contact_period=0)
OFFSET = EffectSpec("zero_offset", ("j",), {"angle": 5.0})
SENSED = Start(np.array([0.5]), np.array([-1.5]), logged=True)


def _session(folder: Path, predict: bool = False) -> Path:
    if not (folder / "log.csv").exists():
        (folder / "log.csv").write_text("time,goal.j\n0,0\n1,0\n")
    (folder / "rig.sdf").write_text(SDF.format(length=0.1, mass=0.5))
    (folder / "servo.yaml").write_text(yaml.safe_dump(SERVO))
    content: dict = {"format": 1, "robot": {"model": "rig.sdf", "base": "base", "servos": "servo.yaml"},
                     "takes": [{"name": "log", "recording": "log.csv", "base": "fixed", "servos": {"proportional_gain": 0.6}}]}
    if predict:
        content["predict"] = [{"name": "next", "commands": "next.csv", "base": "fixed", "servos": {"proportional_gain": 0.6}}]
    (folder / "session.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    return folder / "session.yaml"


def _times() -> np.ndarray:
    """Irregular, and far from zero."""
    return 5.0 + np.cumsum(np.random.default_rng(3).uniform(0.0034, 0.0061, 220))


def _record(folder: Path, effect: EffectSpec | None = None) -> dict[str, np.ndarray]:
    """Writes log.csv: the arm thrown from 0.5 rad, following a sine, let go after 0.6 s; returns its channels."""
    model = load_session(_session(folder)).model.with_servos({"proportional_gain": 0.6})
    model = model if effect is None else model.with_effect(effect)
    time = _times()
    goal, on = 0.5 + 0.8 * np.sin(4 * (time - time[0])), time - time[0] < 0.6
    take = Simulation(model, FIXED).run(commands_of_rows(time, ("j",), goal[:, None], on[:, None]), 1.2, start=SENSED).as_logged()
    q, v = (np.interp(time - time[0], take.time, c[:, 0]) for c in (take.q, take.v))
    channels = {"goal.j": goal, "position.j": q, "velocity.j": v, "enabled.j": on.astype(float)}
    write_joint_log(folder / "log.csv", time, channels)
    return channels


@pytest.mark.parametrize("effect", [None, OFFSET])
def test_a_log_is_compared_from_its_measured_start(tmp_path: Path, effect: EffectSpec | None) -> None:
    channels = _record(tmp_path, effect)
    released = np.flatnonzero(channels["enabled.j"] == 0)
    assert np.ptp(channels["position.j"][released]) > 0.3  # it swings when let go, so that a release that is missed would show
    session = load_session(_session(tmp_path))
    takes, _ = read_takes(session)
    start = takes[0].start_state()
    assert start is not None
    assert (start.q[0], start.v[0], start.logged) == (pytest.approx(0.5), pytest.approx(-1.5), True)
    assert takes[0].duration == pytest.approx(_times()[-1] - _times()[0])
    model = session.model if effect is None else session.model.with_effect(effect)
    (compared,) = compare_session(session.with_model(model), n_jobs=1).takes
    assert compared.joints["j"].error < 1e-4
    assert compared.joints["j"].noise == pytest.approx(np.nanmedian(compared.recorded.q_sigma))  # it has no rest to tell it
    assert compared.simulated.time[0] == pytest.approx(_times()[0], abs=1e-6)


def test_jobs_begin_where_they_are_told(tmp_path: Path) -> None:
    _record(tmp_path)
    session = load_session(_session(tmp_path))
    (take,), _ = read_takes(session)
    job = Job(take.model, FIXED, take.commands, 0.2, start=take.start_state(), times=np.array([0.0, 0.1]))
    (rollout,) = simulate_batch([job], 1)
    (registered,), _ = register_takes(session, [take], {"log": rollout})
    assert rollout.q[0, 0] == pytest.approx(0.5)
    recorded = np.interp(0.1, registered.recorded.since_start, registered.recorded.q[:, 0])
    assert rollout.q[1, 0] == pytest.approx(recorded, abs=1e-4)


def test_elapsed_time_reaches_what_fades(tmp_path: Path) -> None:
    _record(tmp_path)
    session = load_session(_session(tmp_path))
    model = session.model.with_effect(EffectSpec("thermal_fade", (), {"rate": 0.5}))
    (take,), _ = read_takes(session)
    jobs = [Job(model, FIXED, take.commands, 0.4, start=take.start_state(), elapsed=e) for e in (0.0, 4.0)]
    cold, warm = simulate_batch(jobs, 1)
    assert np.abs(cold.q - warm.q).max() > 0.05


def test_a_log_at_rest_in_neutral_begins_at_rest(tmp_path: Path) -> None:
    time = 0.004 * np.arange(50)
    count = 0.088  # degrees
    for first, begins in ((0, None), (1, None), (4, 4 * count)):
        position = np.deg2rad(count) * np.concatenate([np.full(10, first), np.round(np.linspace(first, 20, 40))])
        write_joint_log(tmp_path / "log.csv", time, {"goal.j": np.zeros(50), "position.j": position})
        start = read_takes(load_session(_session(tmp_path)))[0][0].start_state()
        assert (start is None) if begins is None else (start is not None and np.rad2deg(start.q[0]) == pytest.approx(begins))


def test_a_start_after_the_end_of_its_recording_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time = 0.02 * np.arange(51)
    write_joint_log(tmp_path / "log.csv", time, {"goal.j": np.sin(time), "position.j": np.sin(time)})
    session = _session(tmp_path)
    content = yaml.safe_load(session.read_text())
    content["takes"][0]["starts_at"] = 0.95
    session.write_text(yaml.safe_dump(content))
    for verb in ("compare", "diagnose"):
        said = refused(capsys, verb, str(session), "--out", str(tmp_path / "out"))
        assert f"{session}: take 'log': starts_at: 0.95 s, but the recording ends at 1 s; expected 0.1 s or more of" in said
    assert not (tmp_path / "out").exists()


def test_velocity_comes_from_positions_where_a_log_tells_none(tmp_path: Path) -> None:
    time = _times()
    write_joint_log(tmp_path / "log.csv", time, {"goal.j": time * 0, "position.j": 0.3 + 2.0 * (time - time[0])})
    state = state_at(read_recording(tmp_path / "log.csv"), ("j", "other"), time[0])
    assert state is not None
    np.testing.assert_allclose(state, [[0.3, 0.0], [2.0, 0.0]], atol=1e-6)


@pytest.mark.parametrize("effect", [None, OFFSET])
def test_a_log_is_foretold_as_it_was_recorded(tmp_path: Path, effect: EffectSpec | None,
                                              capsys: pytest.CaptureFixture[str]) -> None:
    channels = _record(tmp_path, effect)
    time = _times()
    blank = np.where(np.arange(len(time)) == 0, 1.0, np.nan)
    first = {name: channels[name] * blank for name in ("position.j", "velocity.j")}
    write_joint_log(tmp_path / "next.csv", time, {k: channels[k] for k in ("goal.j", "enabled.j")} | first)
    session = load_session(_session(tmp_path, predict=True))
    model: RobotModel = session.model if effect is None else session.model.with_effect(effect)
    (path,) = predict_session(session, model, tmp_path / "out", n_jobs=1).paths
    screened_out = read_recording(path)
    np.testing.assert_allclose(screened_out.time, time, atol=1e-8)
    np.testing.assert_allclose(screened_out.channels["position.j"], channels["position.j"], atol=1e-4)
    np.testing.assert_array_equal(screened_out.channels["enabled.j"], channels["enabled.j"])
    if effect is None:
        assert "next.csv" in succeeds(capsys, "predict", str(tmp_path / "session.yaml"), "--out", str(tmp_path / "cli"))


def test_links_start_where_they_are_put_and_servos_as_they_told(tmp_path: Path) -> None:
    model = replace(load_session(_session(tmp_path)).model, effects=(OFFSET,))
    simulation = Simulation(model, FIXED)
    by_link = simulation.run(duration=0.01, start=(np.array([0.3]), np.array([0.0])))
    by_servo = simulation.run(duration=0.01, start=Start(np.array([0.3]), np.array([0.0]), logged=True))
    assert by_link.q[0, 0] == pytest.approx(0.3)
    assert by_servo.as_logged().q[0, 0] == pytest.approx(0.3)
    assert by_servo.q[0, 0] == pytest.approx(0.3 + np.deg2rad(5.0))

