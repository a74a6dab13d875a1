"""Motion capture as it comes over the network: NatNet packets, the recording of a take, and an emulated Motive to record from."""

from workbench.device.capture.finish import Capture, finish
from workbench.device.capture.link import UdpLink, VirtualLink
from workbench.device.capture.recorder import Recorder, RecordOptions
from workbench.device.capture.take import record_take
from workbench.device.capture.virtual_motive import Faults, VirtualMotive

__all__ = ["Capture", "Faults", "RecordOptions", "Recorder", "UdpLink", "VirtualLink", "VirtualMotive", "finish", "record_take"]
