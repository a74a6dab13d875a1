"""Whole jobs by the compiled station against the same jobs by Drake: settling, commands between steps, windows, logs."""

from __future__ import annotations

import gc
import importlib.util
from dataclasses import replace

import numpy as np
import pytest

from tests.servo_rig import rig_model
from tests.simulation_compiled.drake_steps import config_for, drake_and_compiled
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.motion.files import load_motion
from workbench.robot import EffectSpec, Ground, RobotModel, ServoConstants, data_file, puppy_model
from workbench.simulation import Job, SimulationConfig, Start, simulate_batch
from workbench.simulation.batch import run_job, simulate_stream
from workbench.simulation.compiled import covers
from workbench.simulation.compiled.angles import servo_angles
from workbench.simulation.compiled.kernel import is_compiled
from workbench.simulation.rollout import BaseState
from workbench.simulation.steady import BaseStates

HELD = np.deg2rad(1e-9)
WALKING = np.deg2rad(2e-3)
"""RMS of joints [rad]."""
TIMES = np.concatenate([[-0.1, -0.001], np.arange(0.0, 1.2, 1 / 120)])


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return puppy_model(ground=Ground(friction=0.6, stiffness=1e5, dissipation=20.0))


def walk_job(model: RobotModel, base: str, **more) -> Job:
    walk = load_motion(data_file("robotis_walk.csv"), model).commands(2)
    late = replace(walk, times=walk.times + 0.00037)  # between two steps
    return Job(model, config_for(base), late, 1.2, 0.1, times=TIMES, **more)


def both(job: Job):
    drake, compiled = drake_and_compiled(job)
    return run_job(drake), run_job(compiled)


def rms(a: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(a))))


@pytest.mark.parametrize("effect", [
    None, EffectSpec("coulomb_friction", ("frm",), {"torque": 0.12}), EffectSpec("backlash", ("flm",), {"gap": 2.0}),
    EffectSpec("load_friction", ("flm",), {"coefficient": 0.3}), EffectSpec("zero_offset", ("frb",), {"angle": 3.0})],
    ids=lambda e: e.effect if e else "nominal")
def test_a_held_robot_plays_the_same(robot, effect):
    drake, compiled = both(walk_job(robot if effect is None else robot.with_effect(effect), "fixed"))
    assert np.abs(drake.q - compiled.q).max() < HELD
    assert np.abs(drake.v - compiled.v).max() < 1e-8
    if effect is not None and effect.effect in ("backlash", "zero_offset"):
        assert np.abs(drake.servo_q - compiled.servo_q).max() < HELD


def test_angles_alone_are_those_of_whole_jobs_whatever_ran_before(robot):
    """A configuration that is gone may leave its address to another; its schedule is not for that one."""
    commands = load_motion(data_file("robotis_walk.csv"), robot).commands(1)

    def angles(step: float) -> np.ndarray:
        config = replace(config_for("fixed"), engine="compiled", time_step=step)
        job = Job(robot, config, commands, 1.0, times=TIMES[2:], lead=0.0, start=(np.zeros(15), np.zeros(15)))
        return servo_angles([[job]])[0][0]

    def alone(step: float) -> np.ndarray:
        config = replace(config_for("fixed"), engine="compiled", time_step=step)
        return run_job(Job(robot, config, commands, 1.0, times=TIMES[2:], lead=0.0, start=(np.zeros(15), np.zeros(15)))).q

    expected, ran = {step: alone(step) for step in (0.002, 0.001)}, TIMES[2:] <= 1.0
    for step in [0.002, 0.001] * 8:
        np.testing.assert_allclose(angles(step)[ran], expected[step][ran], atol=1e-9)


def put_back(times: tuple[float, ...]) -> BaseStates:
    """A base with a prescribed lean and turn."""
    turn = np.array([[0.9995, 0.02, -0.01, 0.02], [0.999, -0.015, 0.02, -0.03]])
    v = np.array([[0.05, 0.0, 0.0], [0.03, -0.02, 0.0]])
    return BaseStates(np.array(times), turn, v, 2 * v)


def test_a_walk_that_goes_on_from_a_state_plays_the_same(robot):
    base = BaseState(*map(np.array, ([0.0, 0.0, 0.22], [0.999, 0.01, -0.02, 0.3], [0.1, 0.0, 0.2], [0.1, 0.0, 0.0])))
    q = np.linspace(-0.1, 0.1, 15)
    start = Start(q, 3 * q, base=base, reference=q + 0.02)
    drake, compiled = both(replace(walk_job(robot, "free"), start=start, times=np.arange(0.0, 0.5, 1 / 120), duration=0.5))
    assert rms(drake.q - compiled.q) < WALKING
    assert np.abs(drake.p_WB - compiled.p_WB).max() < 1e-5


@pytest.mark.parametrize("effect", [
    EffectSpec("payload", ("body_link",), {"mass": 0.25, "position": (0.02, 0.0, 0.03)}),
    EffectSpec("zero_offset", ("frb",), {"angle": 3.0}), EffectSpec("ground_tilt", (), {"forward": 1.0, "left": 1.0})],
    ids=lambda e: e.effect)
def test_walks_in_windows_differ_by_less_than_a_hundredth_of_an_effect(robot, effect):
    windows = put_back((0.4, 0.8))
    nominal, _ = both(walk_job(robot, "free", steadied=windows))
    drake, compiled = both(walk_job(robot.with_effect(effect), "free", steadied=windows))
    apart = rms(drake.q - compiled.q)
    assert apart < WALKING
    assert apart < 0.01 * rms(drake.q - nominal.q)
    assert np.abs(drake.p_WB - compiled.p_WB).max() < 1e-5


def test_a_whole_log_has_the_same_torques_and_ground_forces(robot):
    config = replace(config_for("free"), contact_period=1 / 120)
    job = replace(walk_job(robot, "free"), times=None, duration=0.3, config=config)
    drake, compiled = both(job)
    assert np.array_equal(drake.time, compiled.time)
    assert np.abs(drake.torque - compiled.torque).max() < 1e-6
    assert drake.contact.keys() == compiled.contact.keys()
    for foot, force in drake.contact.items():
        assert np.abs(force - compiled.contact[foot]).max() < 1e-4
    assert max(np.abs(f).max() for f in compiled.contact.values()) > 1.0


@pytest.mark.parametrize(("logged", "first"), [(False, 0.0), (True, 0.0), (True, 2.0)])
def test_a_log_that_begins_in_motion_with_a_servo_switched_off(tmp_path, logged, first):
    servo = ServoConstants(compliance_slope=None, compliance_margin=None, punch=None, proportional_gain=8.0)
    rig = rig_model(tmp_path, servo, 0.1).with_effect(EffectSpec("zero_offset", ("j",), {"angle": 5.0}))
    times = np.array([0.0, 0.1, 0.2503, 0.6])
    on = np.array([[True], [True], [False], [True]])
    goals, speeds = np.array([[0.2], [0.9], [0.9], [-0.4]]), np.array([[first], [3.0], [0.0], [2.0]])
    commands = Commands(times, rig.joints, goals, speeds, on, 1.0, np.full(4, -1))
    config = SimulationConfig(base="fixed", time_step=1e-3, settle=0.2, contact_period=0.0)
    start = Start(np.array([0.3]), np.array([-1.0]), logged)
    job = Job(rig, config, commands, 1.0, times=np.arange(0.0, 1.0, 0.01), start=start)
    drake, compiled = both(job)
    assert np.abs(drake.q - compiled.q).max() < HELD
    assert np.ptp(compiled.q) > 0.3


def fall(robot: RobotModel) -> Job:
    """Falls onto its belly, because its servos hold nothing: the compiled station gives up during this run."""
    limp = replace(robot, servos={j: replace(robot.servo(j), stall_torque=1e-3, coulomb_friction=0.0) for j in robot.joints})
    return replace(walk_job(limp, "free"), duration=0.6, times=np.arange(0.0, 0.6, 0.01))


def test_a_robot_that_falls_on_its_belly_is_drakes(robot):
    job = fall(robot)
    drake, compiled = drake_and_compiled(job)
    with pytest.raises(InputError, match="shapes touch"):
        run_job(compiled)
    auto = run_job(replace(job, config=replace(job.config, engine="auto")))
    assert np.array_equal(auto.q, run_job(drake).q)


def test_what_is_not_covered_is_said(robot):
    hydroelastic = replace(walk_job(robot, "free"), config=replace(config_for("free"), contact="hydroelastic"))
    assert covers(hydroelastic) == "contact 'hydroelastic'"
    assert covers(walk_job(robot, "free")) is None


def test_a_batch_mixes_engines_and_keeps_its_order(robot):
    times = np.array([0.0, 0.01])
    short = [replace(walk_job(robot, "fixed"), duration=0.02 * (1 + i), name=str(i), times=times) for i in range(4)]
    jobs = [replace(j, config=replace(j.config, engine="drake")) if i % 2 else j for i, j in enumerate(short)]
    assert [t.name for t in simulate_batch(jobs, 2)] == ["0", "1", "2", "3"]


def test_takes_that_nobody_waits_for_are_dropped_without_a_word(robot, monkeypatch):
    """As after an error in an earlier one."""
    lost = []
    monkeypatch.setattr("sys.unraisablehook", lost.append)
    short = replace(walk_job(robot, "fixed"), duration=0.02, times=np.array([0.0, 0.01]))
    jobs = [replace(short, config=replace(short.config, engine="drake"), name=str(i)) for i in range(6)]
    stream = iter(simulate_stream(jobs, 2))
    assert next(stream).name == "0"
    del stream
    gc.collect()
    assert not lost


def test_threads_that_fall_back_to_drake_do_not_play_on_one_station_at_once(robot):
    """They would end in a crash, or in each other's takes."""
    job = fall(robot)
    job = replace(job, config=replace(job.config, engine="auto"))
    alone = run_job(job)
    for take in simulate_batch([replace(job, name=str(k)) for k in range(4)], 2):
        np.testing.assert_array_equal(take.q, alone.q)


def test_the_same_code_compiled_in_another_checkout_does_not_count(tmp_path, monkeypatch):
    """numba would compile again, in each of several processes at once."""
    monkeypatch.setattr("workbench.simulation.compiled.kernel.cache_folder", lambda: tmp_path / "kept")
    source = "from workbench.simulation.compiled.kernel import kernel\n\n\n@kernel\ndef double(x):\n    return 2.0 * x\n"
    doubles = []
    for checkout in ("one", "other"):
        path = tmp_path / checkout / "double.py"
        path.parent.mkdir()
        path.write_text(source)
        spec = importlib.util.spec_from_file_location(f"double_{checkout}", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        doubles.append(module.double)
    first, second = doubles
    assert first(1.0) == 2.0
    assert is_compiled(first)
    assert not is_compiled(second)
