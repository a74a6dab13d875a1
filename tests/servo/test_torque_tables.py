"""Torques given as tables: read, written, and the same in Drake and in the compiled station."""

import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

from tests.servo_rig import SDF
from workbench.files import InputError
from workbench.recording.formats.log_commands import commands_of_rows
from workbench.robot import RobotModel, ServoConstants, load_model
from workbench.robot.model_file import save_model
from workbench.robot.servo_constants import load_servo_constants
from workbench.robot.torque_table import TorqueTable
from workbench.servo import Instant
from workbench.servo.tabled import TURNING, Tabled
from workbench.simulation import Job, SimulationConfig
from workbench.simulation.batch import simulate_batch

SERVO = ServoConstants(compliance_slope=None, compliance_margin=None, punch=None, proportional_gain=1.2, stall_torque=0.7,
                       no_load_speed=19.0, rated_voltage=7.4, supply_voltage=7.4, coulomb_friction=0.013,
                       viscous_friction=0.004, reflected_inertia=0.0018)
WAVE = tuple(0.05 * math.sin(0.4 * k) for k in range(13))
TABLES = (TorqueTable("angle", tuple(-90.0 + 15 * k for k in range(13)), WAVE),
          TorqueTable("angle and direction", (-60.0, 0.0, 60.0), (-0.01, -0.05, -0.01)),
          TorqueTable("duty", (-1.0, -0.2, 0.0, 0.2, 1.0), (0.05, 0.0, 0.0, 0.0, -0.05)),
          TorqueTable("duty and direction", (0.0, 0.5), (-0.01, -0.04)),
          TorqueTable("speed", (-300.0, 0.0, 300.0), (0.02, 0.0, -0.02)))


@pytest.fixture
def rig(tmp_path):
    (tmp_path / "rig.sdf").write_text(SDF.format(length=0.1, mass=0.5))

    def made(*tables):
        return RobotModel(str(tmp_path / "rig.sdf"), base="base", servos={"j": replace(SERVO, torque_tables=tables)})
    return made


def angles(model, engine):
    time = np.arange(0.0, 1.5, 0.01)
    goal = 1.1 * np.sin(2.2 * time) + 0.5 * np.sin(7.0 * time + 1.0)
    on = (np.abs(time - 1.2) > 0.1)[:, None]  # switched off for a while
    config = SimulationConfig(base="fixed", contact_period=0, settle=0.1, engine=engine)
    (take,) = simulate_batch([Job(model, config, commands_of_rows(time, ("j",), goal[:, None], on), 1.5, 0.0, times=time)], 1)
    return take.q[:, 0]


@pytest.mark.parametrize("tables", [*((t,) for t in TABLES), TABLES], ids=lambda t: t[0].depends_on if len(t) == 1 else "all")
def test_both_engines_move_alike(rig, tables):
    model = rig(*tables)
    drake, compiled = angles(model, "drake"), angles(model, "compiled")
    assert np.abs(drake - compiled).max() < 1e-9
    assert np.abs(drake - angles(rig(), "drake")).max() > 1e-3  # and the table is felt


def test_a_torque_of_angle_is_what_it_says(rig):
    """A constant torque turns the resting arm as gravity does."""
    lifted = rig(TorqueTable("angle", (-180.0, 180.0), (0.02, 0.02)))
    time = np.arange(0.0, 2.0, 0.01)
    commands = commands_of_rows(time, ("j",), np.zeros((len(time), 1)), np.ones((len(time), 1), dtype=bool))
    frictionless = replace(lifted.servo("j"), coulomb_friction=0.0, viscous_friction=0.05)
    model = replace(lifted, servos={"j": frictionless})
    (take,) = simulate_batch([Job(model, SimulationConfig(base="fixed", contact_period=0, settle=0.1), commands, 2.0, 0.0,
                                  times=time)], 1)
    stiffness = 1.2 * 0.7 + 0.5 * 9.81 * 0.1  # of the servo, and of gravity near rest
    assert take.q[-1, 0] == pytest.approx(0.02 / stiffness, rel=0.02)


def test_lines_between_knots_and_constant_beyond():
    term = Tabled([(0, TorqueTable("speed", (-1.0, 1.0, 2.0), (3.0, 5.0, 0.0))),
                   (1, TorqueTable("duty and direction", (0.0, 1.0), (0.0, -2.0)))], 2)
    slow, fast = math.radians(0.5), math.radians(30.0)
    none = np.zeros(2)

    def at(v, duty):
        return term.more_torque(Instant(0.0, np.array([v, v]), np.array([0.0, duty]), none, none, none, none))
    assert at(slow, 0.0)[0] == pytest.approx(4.5)
    assert at(fast, 0.0)[0] == 0.0
    assert at(-fast, 0.0)[0] == 3.0
    assert at(TURNING, -0.5)[1] == pytest.approx(-1.0 / math.sqrt(2))
    assert at(-TURNING, -0.5)[1] == pytest.approx(1.0 / math.sqrt(2))


def test_servo_and_model_files_keep_tables(rig, tmp_path):
    model = rig(*TABLES)
    save_model(model, tmp_path / "model.yaml")
    assert load_model(tmp_path / "model.yaml").servo("j").torque_tables == TABLES
    (tmp_path / "servo.yaml").write_text(yaml.safe_dump(model.servo("j").as_dict()))
    assert load_servo_constants(tmp_path / "servo.yaml") == model.servo("j")
    assert model.sha256 != rig().sha256


@pytest.mark.parametrize(("tables", "said"), [
    ("angle", "expected a list"),
    ([{"depends_on": "angle", "at": [0, 1]}], r"torque_tables\[0\].*expected the keys"),
    ([{"depends_on": "angles", "at": [0, 1], "torque": [0, 1]}], "depends_on: expected 'angle'"),
    ([{"depends_on": "angle", "at": [0, 1], "torque": [0]}], "equally many"),
    ([{"depends_on": "angle", "at": [1, 0], "torque": [0, 0]}], "increasing"),
    ([{"depends_on": "angle", "at": [0, "x"], "torque": [0, 0]}], "finite"),
])
def test_a_table_that_cannot_be_is_refused(tmp_path, tables, said):
    path = tmp_path / "servo.yaml"
    path.write_text(yaml.safe_dump(SERVO.as_dict() | {"torque_tables": tables}))
    with pytest.raises(InputError, match=said):
        load_servo_constants(path)
