"""The nominal robot as plain data."""

from workbench.files.resources import ROBOTS, ConfigurePackageMap, ConfigureParser, data_file, resolve_model, resource_dir
from workbench.robot.bus_ids import bus_ids
from workbench.robot.feet import foot_points, legs
from workbench.robot.kinematics import JointFrame, Kinematics
from workbench.robot.model import GRAVITY, PUPPY, EffectSpec, Ground, RobotModel, puppy_model
from workbench.robot.model_file import ModelFile, Posterior, load_model, load_model_file, save_model
from workbench.robot.names import BUS_IDS, JOINTS, RIGID_BODIES
from workbench.robot.servo_constants import COUNT, SPEED_UNIT, ServoConstants, load_servo_constants

__all__ = [
    "BUS_IDS", "COUNT", "GRAVITY", "JOINTS", "PUPPY", "RIGID_BODIES", "ROBOTS", "SPEED_UNIT", "ConfigurePackageMap",
    "ConfigureParser", "EffectSpec", "Ground", "JointFrame", "Kinematics", "ModelFile", "Posterior",
    "RobotModel", "ServoConstants", "bus_ids", "data_file", "foot_points", "legs", "load_model", "load_model_file",
    "load_servo_constants", "puppy_model", "resolve_model", "resource_dir", "save_model",
]
