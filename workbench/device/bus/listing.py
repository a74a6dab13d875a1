"""Lists the servos on a bus of which nothing is known: any of the families with a profile, at any of their bit rates."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Any

from workbench.device.bus.bus import Bus
from workbench.device.bus.errors import BusError, NoAnswerError
from workbench.device.bus.survey import FIRST, FoundServo, Survey, all_ids, survey
from workbench.device.bus.wire import ping
from workbench.robot.servo_profile_file import model_name, servo_profiles
from workbench.types import Progress

LONGEST_PING = {1: 6, 2: 14}
"""Bytes of the answer to a ping, by protocol."""
FEW = range(1, 21)
"""IDs that are asked at other bit rates; nearly every robot has a servo among them."""


def list_servos(port: Any, strip_echo: bool = False, progress: Progress | None = None) -> tuple[Survey, ...]:
    """One survey, without joints, for each family on the bus. If no servo answers at the port's bit rate, others are tried,
    and the port keeps the first at which somebody does. Servos of an unknown model are included in the first survey of their
    protocol, without registers. BusError where no servo answers at all."""
    tell = progress or (lambda what, done: None)
    own = int(port.getBaudRate())
    answered = _who(port, strip_echo, None, lambda done: tell("looking at each ID", done))
    rates = sorted({rate for p in servo_profiles().values() for rate in p.bit_rates.values()} - {own}, reverse=True)
    for k, rate in enumerate(rates):
        if answered:
            break
        tell(f"no servo answers at {own} bit/s; trying {rate}", k / len(rates))
        if port.setBaudRate(rate) and _who(port, strip_echo, FEW):
            answered = _who(port, strip_echo)
    if not answered:
        port.setBaudRate(own)
        raise BusError(f"no servo answers, at {own} bit/s or any other; is the servos' power on, and is this the right port?")
    out = []
    for protocol, ids in answered.items():
        out += _surveys(port, strip_echo, protocol, ids, tell)
    return tuple(out)


def _who(port: Any, strip_echo: bool, ids: Iterable[int] | None = None,
         tell: Callable[[float], None] = lambda done: None) -> dict[int, list[int]]:
    """IDs that answer a ping, by protocol, of `ids` or else of all that it allows; patient until one has answered, then as
    patient as that one needed."""
    out: dict[int, list[int]] = {}
    for step, protocol in enumerate((1, 2)):
        profile = next(p for p in servo_profiles().values() if p.protocol == protocol)
        through = Bus(port, profile, strip_echo=strip_echo).port
        asked = list(all_ids(protocol) if ids is None else ids)
        patience = max(float(port.patience), FIRST)
        for k, servo in enumerate(asked):
            tell((step + k / len(asked)) / 2)
            took = _answer_time(through, ping(protocol, servo), LONGEST_PING[protocol], patience)
            if took is not None:
                out.setdefault(protocol, []).append(servo)
                patience = min(patience, max(float(port.patience), 2 * took))
    return out


def _answer_time(port: Any, packet: bytes, length: int, patience: float) -> float | None:
    """How long it takes until so many bytes have answered a packet [ms]; None where not one has come by then."""
    port.clearPort()
    port.writePort(list(packet))
    begun, heard = port.getCurrentTime(), 0
    deadline = begun + (len(packet) + length) * port.tx_time_per_byte + patience
    while heard < length and port.getCurrentTime() < deadline:
        heard += len(port.readPort(length - heard))
    return port.getCurrentTime() - begun if heard else None


def _surveys(port: Any, strip_echo: bool, protocol: int, ids: list[int], tell: Progress) -> list[Survey]:
    left, out = list(ids), []
    profiles = [p for p in servo_profiles().values() if p.protocol == protocol]
    for profile in profiles:
        bus = Bus(port, profile, strip_echo=strip_echo)
        own = [servo for servo in left if bus.exists(servo, tries=2) in profile.models]
        if own:
            out.append(survey(bus, None, own, lambda what, done: tell(f"{profile.name}: {what}", done)))  # noqa: B023
            left = [servo for servo in left if servo not in own]
    if left:
        strangers = {servo: _stranger(Bus(port, profiles[0], strip_echo=strip_echo), servo) for servo in left}
        if out:
            out[0] = replace(out[0], found=dict(out[0].found) | strangers)
        else:
            out.append(Survey(profiles[0], int(port.getBaudRate()), strangers, (), ()))
    return out


def _stranger(bus: Bus, servo: int) -> FoundServo:
    number = 0
    with suppress(BusError, NoAnswerError):
        number = bus.exists(servo, tries=2) or 0
    return FoundServo(servo, None, number, model_name(number, bus.profile.protocol), {}, math.nan, math.nan, 0, ())
