"""The servos' bus from the host: strict, over dynamixel-sdk."""

from workbench.device.bus.bus import Bus, BusOptions
from workbench.device.bus.errors import BusError, NoAnswerError, PortGoneError
from workbench.device.bus.ports import SerialPort, open_port, serial_ports

__all__ = ["Bus", "BusError", "BusOptions", "NoAnswerError", "PortGoneError", "SerialPort", "open_port", "serial_ports"]
