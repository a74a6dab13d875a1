"""The servo bank against closed forms, in discrete plants, under an integrator, and under CENIC."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from tests.servo_rig import GRAVITY, LENGTH, make_rig, rig_model
from workbench.files import InputError
from workbench.robot import COUNT, ServoConstants
from workbench.servo import AddServos, ServoLaw

PLANTS = {"discrete": {"time_step": 5e-4}, "runge_kutta3": {"time_step": 0.0, "integrator": "runge_kutta3"},
          "cenic": {"time_step": 0.0, "integrator": "cenic"}}
FRICTIONLESS = ServoConstants(coulomb_friction=0.0, viscous_friction=0.0)
PROPORTIONAL = ServoConstants(compliance_slope=None, compliance_margin=None, punch=None, proportional_gain=6.0,
                              coulomb_friction=0.0, viscous_friction=0.02)
each_plant = pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)


def inertia(servo: ServoConstants, mass: float = 0.1) -> float:
    return servo.reflected_inertia + mass * LENGTH**2


@each_plant
def test_step_response_of_a_proportional_law_is_the_linear_one(tmp_path, plant):
    servo, goal = PROPORTIONAL, 0.1
    rig = make_rig(tmp_path, servo, gravity=False, **plant)
    rig.command(goal)
    rig.put(0.0, reference=goal)
    k, b, i = servo.gain * servo.torque_at_full_duty, servo.back_emf + servo.viscous_friction, inertia(servo)
    w, z = np.sqrt(k / i), b / (2 * np.sqrt(k * i))
    assert z < 1  # the closed form below
    wd = w * np.sqrt(1 - z * z)
    for t in (0.05, 0.1, 0.2):
        expected = goal * (1 - np.exp(-z * w * t) * (np.cos(wd * t) + z * w / wd * np.sin(wd * t)))
        assert rig.run(t - rig.context.get_time())[0] == pytest.approx(expected, abs=5e-4)


@each_plant
def test_no_load_speed_at_the_supply_voltage(tmp_path, plant):
    rig = make_rig(tmp_path, FRICTIONLESS, gravity=False, **plant)
    rig.command(100.0)
    rig.put(-2.0, reference=100.0)
    assert rig.run(0.5)[1] == pytest.approx(6.18 * 11.1 / 12, rel=1e-4)


def test_stall_torque_at_the_supply_voltage(tmp_path):
    rig = make_rig(tmp_path, FRICTIONLESS)
    rig.command(3.0)
    rig.put(0.0, reference=3.0)
    assert rig.output("duty") == 1.0
    assert rig.output("motor_torque") == pytest.approx(1.5 * 11.1 / 12)
    assert rig.output("motor_torque") == pytest.approx(rig.output("generalized_force"))


@each_plant
def test_rests_inside_the_margin_without_torque(tmp_path, plant):
    rig = make_rig(tmp_path, ServoConstants(compliance_margin=4), gravity=False, **plant)
    rig.command(3.5 * COUNT)
    rig.put(0.0, reference=3.5 * COUNT)
    assert rig.run(0.3)[0] == pytest.approx(0.0, abs=1e-9)
    assert rig.output("duty") == 0.0


def test_duty_starts_at_punch_and_rises_over_the_slope():
    law = ServoLaw.of([ServoConstants(compliance_margin=2, compliance_slope=32, punch=100)])
    for beyond, duty in ((-0.1, 0), (1e-9, 100 / 1023), (16, (100 + 923 / 2) / 1023), (32, 1), (60, 1)):
        error = np.array([(2 + beyond) * COUNT])
        assert law.duty(error)[0] == pytest.approx(duty, abs=1e-6)
        assert law.duty(-error)[0] == pytest.approx(-duty, abs=1e-6)


@each_plant
def test_friction_holds_a_load_below_it_and_yields_above(tmp_path, plant):
    servo = ServoConstants(coulomb_friction=0.06)
    for share, held in ((0.95, True), (1.1, False)):
        rig = make_rig(tmp_path, servo, mass=0.1, **plant)
        start = float(np.arcsin(share * servo.coulomb_friction / (0.1 * GRAVITY * LENGTH)))
        rig.command(0.0, enabled=False)
        rig.put(start)
        moved = abs(rig.run(1.0)[0] - start)
        assert (moved < 1e-3) == held


@each_plant
def test_slides_as_far_as_its_energy_against_friction(tmp_path, plant):
    servo = ServoConstants(coulomb_friction=0.06, viscous_friction=0.0)
    rig = make_rig(tmp_path, servo, gravity=False, **plant)
    rig.command(0.0, enabled=False)  # no back-EMF with torque disabled
    rig.put(0.0, rate=2.0)
    assert rig.run(1.0)[0] == pytest.approx(2.0**2 * inertia(servo) / (2 * 0.06), rel=0.03)
    assert abs(rig.run(0.1)[1]) < 1e-4


@each_plant
def test_sags_under_a_load_as_law_and_friction_allow(tmp_path, plant):
    servo = ServoConstants()
    rig = make_rig(tmp_path, servo, mass=0.4, **plant)
    rig.command(1.0)
    rig.put(1.0)
    angle, _ = rig.run(1.5)
    load = 0.4 * GRAVITY * LENGTH * np.sin(angle)
    law = ServoLaw.of([servo])
    least, most = (float(law.rest_error(np.array([load + s * servo.coulomb_friction]))[0]) for s in (-1, 1))
    assert least - 1e-4 < 1.0 - angle < most + 1e-4


@each_plant
def test_lags_a_ramp_by_what_its_torque_needs(tmp_path, plant):
    servo, speed = ServoConstants(), 1.5
    rig = make_rig(tmp_path, servo, gravity=False, **plant)
    rig.command(2.0, speed)
    rig.put(0.0)
    angle, rate = rig.run(1.0)
    torque = servo.coulomb_friction + (servo.back_emf + servo.viscous_friction) * speed
    lag = servo.margin + (torque / servo.torque_at_full_duty - servo.punch_duty) / servo.gain
    assert rate == pytest.approx(speed, rel=1e-3)
    assert speed * 1.0 - angle == pytest.approx(lag, abs=2e-3)
    assert rig.output("reference") == pytest.approx(speed * 1.0, abs=2e-3)


def test_the_ramp_starts_at_the_measured_angle_when_torque_comes_back(tmp_path):
    rig = make_rig(tmp_path, ServoConstants(coulomb_friction=0.0), mass=0.2)
    rig.command(0.0, 0.5, enabled=False)
    rig.put(0.8, reference=0.0)
    angle, _ = rig.run(0.05)
    rig.command(0.8, 0.5)
    rig.run(0.02)
    assert rig.output("reference") == pytest.approx(angle + 0.5 * 0.02, abs=3e-3)


def test_replaces_the_damping_and_inertia_that_the_sdf_gives(tmp_path):
    rig = make_rig(tmp_path, ServoConstants(reflected_inertia=0.004))
    plant = rig.diagram.plant()
    assert rig.joint.default_damping() == pytest.approx(1.5 / 6.18 + 0.01)
    mass_matrix = plant.CalcMassMatrix(rig.plant_context)
    assert mass_matrix[0, 0] == pytest.approx(0.004 + 0.1 * LENGTH**2, rel=1e-5)


def test_refuses_what_it_cannot_do(tmp_path):
    model = rig_model(tmp_path, ServoConstants())
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    with pytest.raises(InputError, match="no joint 'j'"):
        AddServos(builder, plant, model)
    Parser(plant).AddModels(str(model.path))
    with pytest.raises(InputError, match="continuous plant"):
        AddServos(builder, plant, model, friction="bristle")
    plant.AddJointActuator("second", plant.GetJointByName("j"))
    with pytest.raises(InputError, match="2 actuators"):
        AddServos(builder, plant, model)
    plant.Finalize()
    with pytest.raises(InputError, match="finalized already"):
        AddServos(builder, plant, model)


def test_servo_constants_refuse_two_laws_and_nonsense():
    with pytest.raises(InputError, match="excludes"):
        ServoConstants(proportional_gain=3.0)
    with pytest.raises(InputError, match="expected"):
        replace(ServoConstants(), compliance_slope=None)
    with pytest.raises(InputError, match="supply_voltage"):
        ServoConstants(supply_voltage=-1.0)
    assert ServoConstants().updated({"proportional_gain": 3.0}).compliance_slope is None
