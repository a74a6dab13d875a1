"""The CM-530 as an adapter: its program, in bridge mode, carries packets of Protocol 1.0 between the PC link and the servos."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from workbench.device.bus.errors import BusError
from workbench.device.bus.ports import GONE, port_gone
from workbench.device.link import AnswerMessage, FrameReader, FrameType, StateMessage, decode_message, encode_frame

RATE = 57_600
"""Of the PC link [bit/s]."""
PATIENCE = 12.0
"""Milliseconds beyond an answer's own bytes: the program waits 5 for the servo, and an FTDI chip may keep bytes for a few."""
TRIES, WAIT = 3, 500.0
"""How often it is asked, and how long it may take to answer [ms]: between two rounds of the log it answers in 30."""


def enter_bridge(port: Any) -> None:
    """Makes the CM-530 behind a port an adapter. BusError in one line where no device there understands its frames, or where it
    refuses, with its current activity."""
    doing = ""
    try:
        for _ in range(TRIES):
            port.clearPort()
            port.writePort(list(encode_frame(FrameType.BRIDGE)))
            answer, state = _answer(port)
            doing = f"; it is at {state.state.name}: {state.reason}" if state is not None else doing
            if answer is not None and answer.well:
                port.patience = PATIENCE
                _drain(port)
                return
            if answer is not None:
                raise BusError(f"the CM-530 does not go into bridge mode ({answer.result}){doing}; hold START for 1.5 s first")
    except GONE as e:
        raise port_gone(e) from None
    raise BusError(f"no CM-530 with the workbench's program answers at {RATE} bit/s{doing}; `workbench flash` puts it there")


def leave_bridge(port: Any) -> None:
    """Ends the bridge; if the message is lost, the controller notices within a second."""
    with suppress(*GONE):
        port.writePort(list(encode_frame(FrameType.BRIDGE_END)))


def _answer(port: Any) -> tuple[AnswerMessage | None, StateMessage | None]:
    reader, state = FrameReader(), None
    deadline = port.getCurrentTime() + WAIT
    while port.getCurrentTime() < deadline:
        for got in reader.feed(bytes(port.readPort(256))):
            answer = decode_message(got)
            if isinstance(answer, StateMessage):
                state = answer
            if isinstance(answer, AnswerMessage) and answer.type == FrameType.BRIDGE:
                return answer, state
    return None, state


def _drain(port: Any) -> None:
    """Remaining bytes of its log and its state are no answer of a servo."""
    end = port.getCurrentTime() + 60
    while port.getCurrentTime() < end:
        port.readPort(256)
