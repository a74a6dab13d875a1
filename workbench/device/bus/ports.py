"""The serial port of an adapter (U2D2, USB2Dynamixel, the CM-530 as a bridge), opened strictly."""

from __future__ import annotations

import errno
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import serial
from dynamixel_sdk import PortHandler
from serial import SerialException
from serial.tools import list_ports

from workbench.device.bus.errors import BusError, PortGoneError

GONE: tuple[type[Exception], ...] = (OSError, SerialException)
"""What pyserial lets through when the adapter is pulled; and on Linux termios.error, which is neither."""
try:
    import termios

    GONE = (*GONE, termios.error)
except ImportError:  # Windows
    pass


OPENING: tuple[type[Exception], ...] = (*GONE, ValueError)


def open_serial(name: str, rate: int, write_timeout: float | None = None) -> serial.Serial:
    """A serial port for this program alone, which returns from a read at once. BusError in one line where there is none of that
    name, it may not be opened, or another program has it."""
    try:
        return serial.Serial(name, rate, timeout=0, write_timeout=write_timeout, exclusive=True)
    except OPENING as e:
        number = getattr(e, "errno", None) or 0
        reason = "there is no such port" if not Path(name).exists() else WHY.get(number, " ".join(str(e).split()))
        raise BusError(f"port {name}: {reason}; ports of this machine: {', '.join(serial_ports()) or 'none'}") from None


WHY = {errno.EACCES: "no permission; are you in the group dialout?", errno.EBUSY: "another program has it",
       errno.EAGAIN: "another program has it", errno.EWOULDBLOCK: "another program has it"}


class PatientPort(PortHandler):  # type: ignore[misc]  # the SDK is untyped
    """dynamixel-sdk's port with time-outs of our own: the bytes' time and `patience` [ms], instead of the SDK's 34 ms."""

    patience = 3.0

    def setPacketTimeout(self, packet_length: int) -> None:
        """Starts the time-out for an answer of so many bytes."""
        self.setPacketTimeoutMillis(packet_length * self.tx_time_per_byte + self.patience)


class SerialPort(PatientPort):
    """A serial port, opened for this program alone, with a clock that never jumps."""

    is_open: bool
    ser: Any

    def setupPort(self, cflag_baud: int) -> bool:
        """Opens it, or sets the rate of one that is open."""
        if self.is_open:
            self.ser.baudrate = self.baudrate
        else:
            self.ser = open_serial(self.port_name, self.baudrate)
            self.is_open = True
        self.ser.reset_input_buffer()
        self.tx_time_per_byte = 10_000 / self.baudrate
        return True

    def getCurrentTime(self) -> float:
        """Milliseconds of the monotonic clock."""
        return time.monotonic() * 1000

    def pause(self, seconds: float) -> None:
        """Lets time go by [s]."""
        if seconds > 0:
            time.sleep(seconds)


class StripEcho:
    """A port behind an adapter that hears itself: the echo of each packet is removed, and compared."""

    def __init__(self, port: Any) -> None:
        self.__dict__["port"] = port

    def __getattr__(self, name: str) -> Any:
        return getattr(self.port, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self.port, name, value)

    def writePort(self, packet: Sequence[int]) -> int:
        """Sends, and waits for the echo."""
        port = self.port
        count = int(port.writePort(packet))
        deadline = port.getCurrentTime() + count * port.tx_time_per_byte + port.patience
        back = b""
        while len(back) < count and port.getCurrentTime() < deadline:
            back += bytes(port.readPort(count - len(back)))
        if back != bytes(packet):
            raise BusError(f"the adapter's echo was {back.hex(' ') or 'nothing'}; expected {bytes(packet).hex(' ')}")
        return count


def open_port(name: str, rate: int) -> SerialPort:
    """Opens a serial port at a bit rate. BusError in one line where there is none of that name (with those that there are), it is
    another program's, or cannot do the rate."""
    port = SerialPort(name)
    port.baudrate = rate
    opened = port.setBaudRate(rate)
    if not opened:
        raise BusError(f"port {name}: dynamixel-sdk has no bit rate of {rate}")
    return port


def serial_ports(usb: bool = False) -> list[str]:
    """Serial ports of this machine, or those on USB alone."""
    return sorted(str(p.device) for p in list_ports.comports() if p.vid is not None or not usb)


def port_gone(error: BaseException) -> PortGoneError:
    """The error to raise where the operating system has lost the adapter."""
    return PortGoneError(f"the adapter has disconnected ({' '.join(str(error).split())}); reconnect it and repeat the command")
