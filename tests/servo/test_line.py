"""The torque-speed line: no-load and reachable speed, and the torque available in either direction."""

import numpy as np
import pytest

from workbench.robot import ServoConstants
from workbench.servo import ServoLaw


def test_no_load_speed_scales_with_the_supply():
    servo = ServoConstants()
    line = ServoConstants(supply_voltage=0.75 * servo.rated_voltage).line
    assert line.no_load_speed == pytest.approx(0.75 * servo.no_load_speed)


def test_reachable_speed_balances_friction_and_is_below_no_load():
    line = ServoConstants().line
    v = line.reachable_speed
    assert line.motor_torque(v) == pytest.approx(line.coulomb + line.viscous * v)
    assert 0 < v < line.no_load_speed


def test_a_servo_weaker_than_its_friction_does_not_move():
    servo = ServoConstants()
    assert ServoConstants(coulomb_friction=2 * servo.torque_at_full_duty).line.reachable_speed == 0


def test_friction_helps_a_servo_that_is_driven_backwards():
    line = ServoConstants().line
    forward, backward = line.available(np.array([1.0, 1.0]), np.array([2.0, -2.0]))
    assert forward == pytest.approx(line.full_torque - 2 * line.back_emf)
    assert backward == pytest.approx(line.full_torque + 2 * line.back_emf + line.coulomb + 2 * line.viscous)
    assert line.available(np.array([-1.0]), np.array([2.0])) == pytest.approx(backward)  # mirrored
    assert line.available(np.array([1.0]), np.array([2.0 * float(line.no_load_speed)])) == 0


def test_law_of_several_servos_has_the_same_line():
    servos = [ServoConstants(), ServoConstants(supply_voltage=9.0)]
    assert ServoLaw.of(servos).line.no_load_speed == pytest.approx([float(s.line.no_load_speed) for s in servos])
