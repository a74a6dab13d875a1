"""Recordings, and the takes that are made of them; recorded and simulated takes are the same kind of thing."""

from workbench.recording.body_track import BodyTrack
from workbench.recording.formats.joint_log import read_joint_log, write_joint_log
from workbench.recording.formats.motive import read_motive
from workbench.recording.formats.motive_write import write_motive
from workbench.recording.formats.read import read_recording
from workbench.recording.mocap.mending import survey
from workbench.recording.mocap.observe import observe
from workbench.recording.mocap.registration import register
from workbench.recording.mocap.yaw import YawEstimate, session_yaw
from workbench.recording.recording import Measurement, Recording
from workbench.recording.take import Take
from workbench.recording.take_from import take_from_recording

__all__ = ["BodyTrack", "Measurement", "Recording", "Take", "YawEstimate", "observe", "read_joint_log", "read_motive",
           "read_recording", "register", "session_yaw", "survey", "take_from_recording", "write_joint_log", "write_motive"]
