"""Turns the user's file into one that Drake reads (URDF to SDF, meshes to known formats, packages located), and lists its
doubtful values."""

from workbench.robot.model_source.checks import link_sizes, model_problems
from workbench.robot.model_source.prepare import ModelSource, prepare, user_file

__all__ = ["ModelSource", "link_sizes", "model_problems", "prepare", "user_file"]
