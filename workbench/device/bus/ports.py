"""The serial port of an adapter (U2D2, USB2Dynamixel, the CM-530 as a bridge), opened strictly."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dynamixel_sdk import PortHandler
from serial import SerialException
from serial.tools import list_ports

from workbench.device.bus.errors import BusError, PortGoneError

FTDI_LATENCY = 1e-3
"""Time after which an adapter with an FTDI chip should hand over what has come in [s]; Linux sets 16 ms."""

GONE: tuple[type[Exception], ...] = (OSError, SerialException)
"""What pyserial lets through when the adapter is pulled; and on Linux termios.error, which is neither."""
try:
    import termios

    GONE = (*GONE, termios.error)
except ImportError:  # Windows
    pass


class SerialPort(PortHandler):  # type: ignore[misc]  # the SDK is untyped
    """dynamixel-sdk's port with a clock that never jumps and time-outs of our own: the bytes' time and `patience` [ms]."""

    patience = 3.0

    def getCurrentTime(self) -> float:
        """Milliseconds of the monotonic clock."""
        return time.monotonic() * 1000

    def setPacketTimeout(self, packet_length: int) -> None:
        """Starts the time-out for an answer of so many bytes."""
        self.setPacketTimeoutMillis(packet_length * self.tx_time_per_byte + self.patience)

    def pause(self, seconds: float) -> None:
        """Lets time go by [s]."""
        if seconds > 0:
            time.sleep(seconds)


class StripEcho:
    """A port behind an adapter that hears itself: what comes back of each packet is taken off, and compared."""

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
    try:
        opened = port.setBaudRate(rate)
    except GONE as e:
        reason = str(e).partition(": ")[2] or str(e)
        if not Path(name).exists():
            reason = "there is no such port"
        raise BusError(f"port {name}: {reason}; ports of this machine: {', '.join(serial_ports()) or 'none'}") from None
    if not opened:
        raise BusError(f"port {name}: dynamixel-sdk has no bit rate of {rate}")
    waits = ftdi_latency(name)
    if waits is not None and waits > FTDI_LATENCY:
        port.patience += 1000 * waits
    return port


def serial_ports(usb: bool = False) -> list[str]:
    """Serial ports of this machine, or those on USB alone."""
    return sorted(str(p.device) for p in list_ports.comports() if p.vid is not None or not usb)


def ftdi_latency(name: str) -> float | None:
    """After how long an FTDI adapter hands over what came in [s]; None where Linux does not say."""
    path = Path("/sys/bus/usb-serial/devices") / Path(name).name / "latency_timer"
    try:
        return int(path.read_text()) / 1000
    except (OSError, ValueError):
        return None


def gone(error: BaseException) -> PortGoneError:
    """The error to raise where the operating system has lost the adapter."""
    return PortGoneError(f"the adapter is gone ({' '.join(str(error).split())}); plug it in again and repeat the command")
