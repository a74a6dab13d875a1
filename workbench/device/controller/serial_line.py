"""A serial line to a controller, by pyserial."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import serial
from serial.tools import list_ports

from workbench.device.bus.ports import open_serial
from workbench.files import InputError


class SerialLine:
    """8N1 at a rate, as `Line` wants it; BusError where the port cannot be opened."""

    def __init__(self, port: str, rate: int) -> None:
        self._port = open_serial(port, rate, write_timeout=10)

    def write(self, data: bytes) -> None:
        """Sends, and waits until the operating system has taken it."""
        self._guard(lambda: self._port.write(data))

    def read(self, seconds: float) -> bytes:
        """Bytes received within this time, returned as soon as there are any."""
        until = time.monotonic() + seconds
        while True:
            data: bytes = self._guard(lambda: self._port.read(4096))
            if data or time.monotonic() >= until:
                return data
            time.sleep(0.002)

    def reopen(self) -> None:
        """Closes and opens it again, with DTR and RTS low, which reset some boards; a board may be deaf until then."""
        self._guard(self._port.close)
        self._guard(self._port.open)
        self.lines_low()

    def lines_low(self) -> None:
        """DTR and RTS low; nothing where a port has none."""
        with contextlib.suppress(OSError):
            self._port.dtr = self._port.rts = False

    def close(self) -> None:
        """Gives the port back."""
        self._port.close()

    def _guard(self, call):  # type: ignore[no-untyped-def]  # of whatever it calls
        """An adapter that is pulled out raises termios.error, which is no OSError."""
        try:
            return call()
        except serial.SerialException as e:
            raise OSError(5, " ".join(str(e).split())) from None
        except Exception as e:
            if type(e).__module__ != "termios":
                raise
            raise OSError(5, "the adapter has disconnected") from None


def default_port() -> str:
    """The only serial port there is; InputError that lists them where there is none or more."""
    there = [p.device for p in list_ports.comports() if "USB" in p.device or "ACM" in p.device or Path(p.device).suffix == ""]
    if len(there) != 1:
        raise InputError("--port", f"say which serial port the controller is on; here: {' '.join(there) or 'none'}")
    return str(there[0])
