"""The virtual robot: servos byte for byte on a half-duplex bus, in virtual time; the body they move is handed in."""

from workbench.device.virtual.ax12a import AX12A
from workbench.device.virtual.body import Body, Drive, RampBody, Sense
from workbench.device.virtual.bus import ServoBus, Talker
from workbench.device.virtual.clock import MICROSECOND, MILLISECOND, SECOND, Clock, seconds
from workbench.device.virtual.families import MX28, STS3215, XL330, XL430
from workbench.device.virtual.port import VirtualPort
from workbench.device.virtual.protocol import Instruction, Protocol, Protocol1, bit_flips
from workbench.device.virtual.protocol2 import Protocol2
from workbench.device.virtual.registers import Register, VirtualProfile
from workbench.device.virtual.servo import VirtualServo

__all__ = [
    "AX12A",
    "MICROSECOND",
    "MILLISECOND",
    "MX28",
    "SECOND",
    "STS3215",
    "XL330",
    "XL430",
    "Body",
    "Clock",
    "Drive",
    "Instruction",
    "Protocol",
    "Protocol1",
    "Protocol2",
    "RampBody",
    "Register",
    "Sense",
    "ServoBus",
    "Talker",
    "VirtualPort",
    "VirtualProfile",
    "VirtualServo",
    "bit_flips",
    "seconds",
]
