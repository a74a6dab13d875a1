"""The other engine's servo code: its closed forms, and its agreement with the workbench's, which it does not share."""

import numpy as np
import pytest

from studies.other_engine.firmware import commands_from_rows, read_rows
from studies.other_engine.servo import Reference, ServoBank
from workbench.motion import load_motion
from workbench.robot import COUNT, ServoConstants, data_file
from workbench.servo import ServoLaw

AX12 = ServoConstants()


def test_duty_is_zero_inside_the_margin_and_the_punch_just_outside():
    bank = ServoBank([AX12])
    assert bank.duty(np.array([0.999 * COUNT])) == 0
    np.testing.assert_allclose(bank.duty(np.array([1.0001 * COUNT])), 32 / 1023, rtol=1e-3)


def test_duty_is_full_one_slope_beyond_the_margin_and_odd():
    bank = ServoBank([AX12])
    half = bank.duty(np.array([(1 + 16) * COUNT]))
    np.testing.assert_allclose(half, 32 / 1023 + (1 - 32 / 1023) / 2)
    assert bank.duty(np.array([33.01 * COUNT])) == 1
    assert bank.duty(np.array([-33.01 * COUNT])) == -1
    np.testing.assert_allclose(bank.duty(np.array([-17 * COUNT])), -half)


def test_proportional_gain_has_neither_margin_nor_punch():
    bank = ServoBank([AX12.updated({"proportional_gain": 2.0})])
    for error, duty in ((1e-4, 2e-4), (0.3, 0.6), (-0.7, -1.0)):
        np.testing.assert_allclose(bank.duty(np.array([error])), duty)


def test_motor_stalls_and_runs_free_in_proportion_to_the_supply():
    bank = ServoBank([AX12])
    full = np.array([1.0])
    np.testing.assert_allclose(bank.motor_torque(full, np.array([0.0])), 1.5 * 11.1 / 12)
    np.testing.assert_allclose(bank.motor_torque(full, np.array([6.18 * 11.1 / 12])), 0, atol=1e-12)
    assert bank.motor_torque(full, np.array([3.0]), enabled=np.array([False])) == 0


def test_law_agrees_with_the_workbench():
    servos = [AX12, AX12.updated({"compliance_slope": 64, "punch": 0, "supply_voltage": 9}),
              AX12.updated({"proportional_gain": 2.0})]
    rng = np.random.default_rng(0)
    error, speed = rng.normal(0, 0.1, (1000, 3)), rng.normal(0, 3, (1000, 3))
    theirs, ours = ServoLaw.of(servos), ServoBank(servos)
    np.testing.assert_allclose(ours.motor_torque(error, speed), theirs.motor_torque(error, speed), atol=1e-12)


def test_reference_moves_at_the_moving_speed_and_stops_at_the_goal():
    reference = Reference(2)
    on, q = np.ones(2, dtype=bool), np.zeros(2)
    reference.command(1.0, np.array([0.5, -0.5]), np.array([0.25, 0.0]), on, q)
    np.testing.assert_allclose(reference.at(2.0), [0.25, -0.5])
    reference.command(2.0, np.array([0.0, 0.0]), np.array([0.1, 1.0]), on, q)
    np.testing.assert_allclose(reference.at(2.1), [0.24, -0.4])
    np.testing.assert_allclose(reference.at(10.0), [0, 0], atol=1e-15)


def test_a_servo_that_is_enabled_starts_from_where_the_joint_is():
    reference = Reference(1)
    off, on = np.array([False]), np.array([True])
    goal, speed = np.array([1.0]), np.array([0.1])
    reference.command(0.0, goal, speed, off, np.zeros(1))
    reference.command(1.0, goal, speed, on, np.array([-0.4]))
    np.testing.assert_allclose(reference.at(2.0), [-0.3])


def test_firmware_agrees_with_the_workbench():
    path = data_file("robotis_walk.csv")
    ours, theirs = commands_from_rows(*read_rows(path), cycles=3), load_motion(path).commands(3)
    theirs = theirs.reordered(ours.joints)
    np.testing.assert_allclose(ours.times, theirs.times, atol=1e-12)
    np.testing.assert_allclose(ours.goals, theirs.goals, atol=1e-12)
    np.testing.assert_allclose(ours.speeds, theirs.speeds, atol=1e-12)
    assert ours.end == pytest.approx(theirs.end)


def test_firmware_refuses_what_falls_outside_the_registers():
    with pytest.raises(ValueError, match="0 to 1023"):
        commands_from_rows(("a",), np.array([0.0, 1.0]), np.array([[0.0], [200.0]]))
