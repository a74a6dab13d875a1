"""From the file that a user has to one that Drake reads: URDF as SDF, meshes in formats that it knows, packages found; and what
is doubtful in it."""

from workbench.robot.model_source.checks import link_sizes, model_problems
from workbench.robot.model_source.prepare import ModelSource, prepare, user_file

__all__ = ["ModelSource", "link_sizes", "model_problems", "prepare", "user_file"]
