"""A robot that walks on its own program while the computer sends the table of the cycle after next, over the PC link."""

from __future__ import annotations

from typing import Any

from workbench.device.bus.errors import BusError
from workbench.device.controller.play import FIRST_POSE, SILENT, Controller
from workbench.device.link import AnswerMessage, ControllerState, FrameType, LogMessage, Message, StateMessage, upload_frames
from workbench.device.tables.table_file import TableFile, encode_table


class LeftPlayError(Exception):
    """The controller's program stopped walking; `reason` as it gives it."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(reason)


class CycleController(Controller):
    """A conversation during a walk. Two buffers: one table plays, another is received and checked; the program changes to it at
    the end of a cycle if its first pose is within reach, and else keeps the old one. port, stop: as of `Controller`."""

    def __init__(self, port: Any, stop: Any = lambda: "") -> None:
        super().__init__(port, stop)
        self._sequence = self._answered = 0

    def begin(self, table: TableFile) -> float:
        """Uploads the first table, ramps to neutral and plays it; returns when its first pose was sent [s, this computer's
        clock]. BusError, also where a table is refused."""
        self.upload(table)
        self._sequence = self.state().accepted
        self.to_neutral()
        return self.start() + FIRST_POSE + self.clock_offset()

    def send_next(self, table: TableFile) -> None:
        """Sends a table that takes over at the end of the cycle; does not wait for the answer."""
        self._sequence = (self._sequence + 1) % 256
        self._answered = len(self.heard)
        for part in upload_frames(encode_table(table), self._sequence):
            self._send(part)

    def taken(self) -> bool:
        """Whether the last table sent has been received and checked; BusError where it was refused."""
        for _, m in self.heard[self._answered:]:
            if isinstance(m, AnswerMessage) and not m.well:
                raise BusError(f"the table is refused: {m.result}")
            if isinstance(m, AnswerMessage) and m.type == FrameType.END:
                return True
        return False

    def listen(self, until: float) -> None:
        """Hears it until a time on the computer's clock [s]. LeftPlayError where it stopped walking or refused to change tables,
        BusError where it fell silent."""
        while self.now() < until:
            m = self._wait(_news, until - self.now())
            if isinstance(m, StateMessage) and m.state == ControllerState.PLAY:
                raise LeftPlayError(f"a table was not played: {m.table_fault}")
            if m is not None:
                state = m if isinstance(m, StateMessage) else self.state()
                raise LeftPlayError(state.reason + (f" (servo {state.servo})" if state.servo is not None else ""))
            if self.now() - self.heard[-1][0] > SILENT:
                raise BusError("the controller fell silent; it stops after its cycles: hold START for 1.5 s, or switch it off")


def _news(m: Message) -> bool:
    """Whether a message reports that the controller no longer walks, or that the next table's first pose was out of reach."""
    if isinstance(m, StateMessage):
        return m.state != ControllerState.PLAY or m.table_fault != "none"
    return isinstance(m, LogMessage) and m.state != ControllerState.PLAY
