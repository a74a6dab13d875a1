"""Every figure of the workbench. Each takes plain takes and arrays and returns a matplotlib Figure; none uses pyplot."""

from workbench.view.figures.body import body_attitude, body_path, footfalls
from workbench.view.figures.errors import joint_errors
from workbench.view.figures.files import EncodedFigure, encode, save_figure
from workbench.view.figures.joints import joint_grid, joint_overlay, phase_portrait
from workbench.view.figures.servos import base_wrench, joint_torques, servo_margins
from workbench.view.figures.stance import Stance, by_joint, stance_of, unseen_of
from workbench.view.figures.strip import film_strip

__all__ = [
    "EncodedFigure", "Stance", "base_wrench", "body_attitude", "body_path", "by_joint", "encode", "film_strip", "footfalls",
    "joint_errors", "joint_grid", "joint_overlay", "joint_torques", "phase_portrait", "save_figure", "servo_margins",
    "stance_of", "unseen_of",
]
