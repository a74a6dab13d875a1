"""What real servos do beyond a position law with friction: goal ramp, lag and delay, minimum duty, dead zone, derivative gain and
load friction of the nominal law, against closed forms, and by either engine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml

from tests.servo_rig import make_rig, rig_model
from tests.simulation_compiled.drake_steps import CompiledSteps, config_for, drake_and_compiled, drake_steps
from workbench.effects.apply import apply_to_commands
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.recording.formats.log_commands import commands_of_rows
from workbench.robot import EffectSpec, ServoConstants, load_servo_constants, puppy_model
from workbench.robot.servo_profile_file import servo_profile, with_family_law
from workbench.servo import ServoLaw
from workbench.simulation import Job, Simulation
from workbench.simulation.batch import run_job

PLAIN = ServoConstants(compliance_slope=None, compliance_margin=None, punch=None, proportional_gain=6.0, coulomb_friction=0.0,
                       viscous_friction=0.02)
REAL = replace(PLAIN, coulomb_friction=0.05, minimum_duty=0.015, dead_zone=0.088, goal_delay=0.0213, goal_ramp=290.0,
               command_filter=0.012, derivative_gain=0.02, load_friction=0.3)
DRY = {"goal_delay": 0.0, "load_friction": 0.0}


def step_to(goal: float, at: float = 0.0, speed: float = 0.0) -> Commands:
    return Commands(np.array([at]), ("j",), np.array([[goal]]), np.array([[speed]]), np.ones((1, 1), dtype=bool), 1.0,
                    np.array([-1]))


def references(folder, servo: ServoConstants, times, goal: float = 1.0, speed: float = 0.0) -> np.ndarray:
    rig = make_rig(folder, servo, gravity=False)
    rig.command(goal, speed=speed)
    rig.put(0.0)
    return np.array([rig.run(t - rig.context.get_time()) and rig.output("reference") for t in times])


def test_the_goal_ramps_at_the_slower_of_its_own_speed_and_the_moving_speed(tmp_path):
    times, servo = np.array([0.05, 0.1, 0.15]), replace(PLAIN, goal_ramp=200.0)
    np.testing.assert_allclose(references(tmp_path, servo, times), np.deg2rad(200.0) * times, atol=1e-9)
    np.testing.assert_allclose(references(tmp_path, servo, times, speed=2.0), 2.0 * times, atol=1e-9)
    np.testing.assert_allclose(references(tmp_path, servo, times, speed=9.0), np.deg2rad(200.0) * times, atol=1e-9)


def test_the_goal_is_filtered_by_one_time_constant(tmp_path):
    times = np.array([0.005, 0.02, 0.06])
    got = references(tmp_path, replace(PLAIN, command_filter=0.02), times)
    np.testing.assert_allclose(got, 1.0 - np.exp(-times / 0.02), atol=1e-9)


def test_duty_starts_at_the_minimum_outside_the_dead_zone():
    law = ServoLaw.of([replace(PLAIN, minimum_duty=0.015, dead_zone=0.1)])
    edge = np.deg2rad(0.1)
    for error, duty in ((0.99 * edge, 0.0), (edge + 1e-9, 0.015), (edge + 0.1, 0.615), (1.0, 1.0)):
        assert law.duty(np.array([error]))[0] == pytest.approx(duty, abs=1e-6)
        assert law.duty(np.array([-error]))[0] == pytest.approx(-duty, abs=1e-6)


def test_a_derivative_gain_damps_as_so_much_back_emf(tmp_path):
    servo = replace(PLAIN, derivative_gain=0.25)
    rig = make_rig(tmp_path, servo, gravity=False, time_step=1e-4)
    rig.command(0.1)
    rig.put(0.0, reference=0.1)
    stiffness, inertia = servo.gain * servo.torque_at_full_duty, servo.reflected_inertia + 0.1 * 0.1**2
    damping = servo.back_emf + servo.viscous_friction + 0.25 * servo.torque_at_full_duty
    fast, slow = np.roots([inertia, damping, stiffness])
    assert np.isreal(fast)  # so damped that nothing overshoots, which the closed form below says
    for t in (0.03, 0.1, 0.2):
        expected = 0.1 * (1 + (slow * np.exp(fast * t) - fast * np.exp(slow * t)) / (fast - slow))
        assert rig.run(t - rig.context.get_time())[0] == pytest.approx(float(np.real(expected)), abs=2e-4)


def test_load_friction_of_the_law_is_the_effects(tmp_path):
    bare = replace(PLAIN, coulomb_friction=0.02)
    config = config_for("fixed", settle=0.05)
    nominal = Simulation(rig_model(tmp_path, replace(bare, load_friction=0.25)), config).run(step_to(1.2), 0.6)
    effect = rig_model(tmp_path, bare).with_effect(EffectSpec("load_friction", ("j",), {"coefficient": 0.25}))
    np.testing.assert_array_equal(nominal.q, Simulation(effect, config).run(step_to(1.2), 0.6).q)
    without = Simulation(rig_model(tmp_path, bare), config).run(step_to(1.2), 0.6)
    assert np.abs(nominal.q - without.q).max() > 0.01


def test_a_goal_delay_is_a_later_command_and_a_log_that_had_begun_holds_its_first_goal_until_then(tmp_path):
    model, late = rig_model(tmp_path, PLAIN), rig_model(tmp_path, replace(PLAIN, goal_delay=0.02))
    delay = model.with_effect(EffectSpec("command_delay", ("j",), {"delay": 0.02}))
    sent = step_to(0.5, at=0.1)
    np.testing.assert_array_equal(apply_to_commands(sent, late).times, apply_to_commands(sent, delay).times)
    log = commands_of_rows(np.array([0.0, 0.1]), ("j",), np.array([[0.3], [0.5]]))
    for robot in (late, delay):
        heard = apply_to_commands(log, robot)
        np.testing.assert_allclose(heard.times, [0.0, 0.02, 0.12])
        np.testing.assert_allclose(heard.goals[:, 0], [0.3, 0.3, 0.5])
    assert apply_to_commands(sent, model) is sent


def test_a_servo_that_delays_its_goals_lets_go_at_once(tmp_path):
    model, late = rig_model(tmp_path, PLAIN), rig_model(tmp_path, replace(PLAIN, goal_delay=0.02))
    delay = model.with_effect(EffectSpec("command_delay", ("j",), {"delay": 0.02}))
    on = np.array([[True], [True], [False]])
    log = commands_of_rows(np.array([0.0, 0.1, 0.2]), ("j",), np.array([[0.3], [0.5], [0.5]]), on)
    for robot, released in ((late, 0.2), (delay, 0.22)):
        heard = apply_to_commands(log, robot)
        assert heard.times[~heard.enabled[:, 0]][0] == pytest.approx(released)
        assert heard.times[heard.goals[:, 0] == 0.5][0] == pytest.approx(0.12)


def test_joints_of_one_robot_may_hear_their_goals_at_different_times():
    model = puppy_model()
    one = replace(model, servos={**model.servos, "flm": replace(model.servo("flm"), goal_delay=0.03)})
    goals = np.linspace(0.1, 0.2, 3)[:, None] * np.ones(15)
    sent = Commands(np.array([0.0, 0.1, 0.2]), model.joints, goals, np.zeros((3, 15)), np.ones((3, 15), dtype=bool), 0.3,
                    np.full(3, -1))
    for begun, first in ((False, 0.0), (True, 0.1)):
        heard = apply_to_commands(replace(sent, begun=begun), one)
        rows = [k for k in range(6) if not (begun and k == 1)]  # nothing changes at 0.03 s then
        np.testing.assert_allclose(heard.times, np.array([0.0, 0.03, 0.1, 0.13, 0.2, 0.23])[rows])
        late, other = heard.goals[:, heard.column("flm")], heard.goals[:, heard.column("frm")]
        np.testing.assert_allclose(late, np.array([first, 0.1, 0.1, 0.15, 0.15, 0.2])[rows])
        np.testing.assert_allclose(other, np.array([0.1, 0.1, 0.15, 0.15, 0.2, 0.2])[rows])


def test_both_engines_take_the_same_steps():
    model = puppy_model()
    model = replace(model, servos=dict.fromkeys(model.joints, replace(REAL, command_filter=0.0)))
    config = config_for("fixed")
    compiled = CompiledSteps(model, config)
    worst = max(float(np.abs(step.after - compiled.after(step)).max()) for step in drake_steps(model, config, 0, 60))
    assert worst < 1e-11


@pytest.mark.parametrize("changes", [{}, DRY, {**DRY, "goal_ramp": 0.0}, {**DRY, "derivative_gain": 0.0, "command_filter": 0.0}],
                         ids=["all", "without load friction", "lag alone", "ramp alone"])
def test_both_engines_play_a_log_between_steps_alike(tmp_path, changes):
    model = rig_model(tmp_path, replace(REAL, **changes), mass=0.3)
    t = np.arange(0, 0.8, 0.01037)
    goals = np.where(t[:, None] < 0.4, 0.8 * np.sin(9 * t[:, None]), -0.6)
    on = (t < 0.5) | (t > 0.6)
    commands = commands_of_rows(t, ("j",), goals, on[:, None])
    times = np.arange(0.0, 0.8, 0.005)
    job = Job(model, config_for("fixed", settle=0.02), commands, 0.8, 0.0, times=times, start=(np.zeros(1), np.zeros(1)))
    drake, ours = (run_job(j) for j in drake_and_compiled(job))
    assert np.abs(drake.q).max() > 0.5
    np.testing.assert_allclose(ours.q, drake.q, atol=1e-10)


def test_constants_that_are_not_given_change_nothing_and_are_not_written():
    servo = ServoConstants()
    assert set(servo.constants()) == set(servo.as_dict()) | {"proportional_gain"}
    assert "goal_ramp" not in servo.as_dict()
    law = ServoLaw.of([servo])
    assert np.isinf(law.ramp).all()
    for more in (law.lag, law.derivative, law.load_friction):
        assert not more.any()
    assert servo.share_known("torque_at_full_duty") == servo.share_known("supply_voltage") == 0.1
    assert servo.share_known("goal_delay") == 0.0


def test_servo_yaml_gives_them_with_how_well_they_are_known(tmp_path):
    path = tmp_path / "servo.yaml"
    content = PLAIN.as_dict() | {"goal_delay": {"value": 0.02, "sd": 0.01}, "goal_ramp": 290, "minimum_duty": 0.015,
                                 "torque_tolerance": 0.5, "back_emf_tolerance": 0.3}
    path.write_text(yaml.safe_dump(content))
    servo = load_servo_constants(path)
    assert servo.share_known("goal_delay") == pytest.approx(0.5)
    assert servo.share_known("torque_at_full_duty") == 0.5
    assert servo.share_known("back_emf") == 0.3
    path.write_text(yaml.safe_dump(servo.as_dict()))
    assert load_servo_constants(path) == servo


@pytest.mark.parametrize(("changes", "expected"), [
    ({"minimum_duty": 0.02}, "minimum_duty belongs to proportional_gain; with compliance_slope expected punch"),
    ({"goal_delay": 20.0}, "goal_delay: expected at most 1 s"), ({"load_friction": -0.1}, "load_friction: expected a non-neg"),
    ({"torque_tolerance": "wide"}, "torque_tolerance: expected a number")])
def test_what_cannot_be_is_said(changes, expected):
    with pytest.raises(InputError, match=expected):
        ServoConstants(**changes)


def test_the_other_law_drops_what_goes_with_a_proportional_gain_alone():
    servo = REAL.updated({"compliance_slope": 32, "compliance_margin": 1, "punch": 32})
    assert servo.minimum_duty == servo.dead_zone == 0.0
    assert servo.goal_ramp == REAL.goal_ramp


def test_what_a_file_leaves_out_of_the_law_comes_from_its_family() -> None:
    sheet = ServoConstants(model="STS3215", stall_torque=2.94, no_load_speed=4.71, rated_voltage=12.0, supply_voltage=12.0,
                           coulomb_friction=0.05, viscous_friction=0.06, reflected_inertia=0.028, proportional_gain=2.6,
                           compliance_slope=None, compliance_margin=None, punch=None)
    family = servo_profile("STS3215").nominal
    full = with_family_law(sheet, ("stall_torque", "goal_ramp"))
    assert full.goal_ramp == 0.0  # the file said so
    for key in ("goal_delay", "minimum_duty", "dead_zone", "load_friction"):
        assert getattr(full, key) == family[key].value > 0
        assert full.share_known(key) == pytest.approx(family[key].sd / family[key].value)
    assert full.stall_torque == 2.94
    assert with_family_law(replace(sheet, model="a servo of no family"), ()) == replace(sheet, model="a servo of no family")
    assert with_family_law(ServoConstants(), ()) == ServoConstants()  # of the AX-12A nothing more is known


def test_a_filter_far_faster_than_a_step_is_none():
    """Turned back by a step, it would divide by exp(-step / lag), which is 0."""
    lags = [ServoLaw.of([replace(PLAIN, command_filter=lag)]).lag[0] for lag in (0.0, 1e-9, 2e-3)]
    assert lags == [0.0, 0.0, 2e-3]
