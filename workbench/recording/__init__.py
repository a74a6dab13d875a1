"""Recordings, and the takes that are made of them; recorded and simulated takes are the same kind of thing."""

from workbench.recording.joint_log import read_joint_log, write_joint_log
from workbench.recording.mending import survey
from workbench.recording.motive import read_motive
from workbench.recording.motive_write import write_motive
from workbench.recording.observe import observe
from workbench.recording.read import read_recording
from workbench.recording.recording import Measurement, Recording
from workbench.recording.registration import register
from workbench.recording.take import BodyTrack, Take
from workbench.recording.take_from import take_from_recording
from workbench.recording.yaw import YawEstimate, session_yaw

__all__ = ["BodyTrack", "Measurement", "Recording", "Take", "YawEstimate", "observe", "read_joint_log", "read_motive",
           "read_recording", "register", "session_yaw", "survey", "take_from_recording", "write_joint_log", "write_motive"]
