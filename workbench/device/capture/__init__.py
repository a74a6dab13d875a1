"""Motion capture as it comes over the network: NatNet packets, and the recording of a take."""

from workbench.device.capture.finish import Capture, finish
from workbench.device.capture.link import UdpLink
from workbench.device.capture.recorder import Recorder, RecordOptions
from workbench.device.capture.take import BackgroundRecording, record_take

__all__ = ["BackgroundRecording", "Capture", "RecordOptions", "Recorder", "UdpLink", "finish", "record_take"]
