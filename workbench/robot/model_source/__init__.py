"""Turns the user's file into one that Drake reads (URDF to SDF, meshes to known formats, packages located), and lists its
doubtful values."""

from workbench.robot.model_source.checks import check_own_friction, link_sizes, model_problems, own_friction
from workbench.robot.model_source.prepare import ModelSource, prepare, user_file

__all__ = ["ModelSource", "check_own_friction", "link_sizes", "model_problems", "own_friction", "prepare", "user_file"]
