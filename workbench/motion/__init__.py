"""Motions as tables of poses, and as commands on the bus."""

from workbench.motion.commands import Commands
from workbench.motion.files import load_motion, save_motion
from workbench.motion.motion import Motion
from workbench.motion.mtn import MtnFile, MtnPage, load_mtn
from workbench.motion.smoothing import (
    Trajectory,
    filter_derivatives,
    inconsistency,
    interpolate,
    interpolate_motion,
    low_pass,
    savitzky_golay,
)
from workbench.motion.table import PoseTable

__all__ = [
    "Commands", "Motion", "MtnFile", "MtnPage", "PoseTable", "Trajectory", "filter_derivatives", "inconsistency",
    "interpolate", "interpolate_motion", "load_motion", "load_mtn", "low_pass", "save_motion", "savitzky_golay",
]
