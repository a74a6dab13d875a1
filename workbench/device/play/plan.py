"""How often the servos can be read while a motion is played, known before it begins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.device.bus.bus import Bus
from workbench.device.bus.group import answer_length
from workbench.device.bus.wire import slow_adapter
from workbench.device.play.rig import MARGIN
from workbench.device.play.watch import WatchOptions
from workbench.files import InputError
from workbench.motion.commands import Commands

STEP = 0.02
"""Readings of a joint farther apart than this miss parts of a walk [s]: a quarter of the shortest pose there is."""
STATE_BYTES = 9
"""Of registers in one reading, on average over those with and without load, voltage and heat."""
ENOUGH = 500
"""Poses of a motion that are looked at."""


@dataclass(frozen=True)
class ReadingPlan:
    """cycle: how long it takes to read every servo once, without poses in between [s]. longest: longest time in the motion in
    which a servo is not read [s]. warning: what to say of it, "" where nothing."""

    cycle: float
    longest: float
    warning: str


def reading_plan(bus: Bus, servos: int, commands: Commands) -> ReadingPlan:
    """How often each servo can be read, from the adapter's measured latency, the length of a reading in bytes and the time
    between poses. InputError where that is so seldom that the watch would have to end the motion."""
    byte, profile = float(bus.port.tx_time_per_byte) / 1000, bus.profile
    kind = bus.group_kind
    if kind:
        reading = (servos + 14 + servos * answer_length(kind, STATE_BYTES)) * byte + bus.latency
        needed = 1
    else:
        reading = ((8 + 6 if profile.protocol == 1 else 14 + 11) + STATE_BYTES) * byte + bus.latency
        needed = servos
    packet = (8 + 5 * servos if profile.protocol == 1 else 14 + 9 * servos) * byte
    free = np.diff(np.append(commands.times, commands.end)) - packet
    fits = np.maximum(np.floor((free - (MARGIN - 1) * reading) / reading), 0).astype(int)[:ENOUGH]
    read = np.concatenate([t + reading * np.arange(1, n + 1) for t, n in zip(commands.times.tolist(), fits.tolist())])
    whole = np.concatenate([[commands.times[0]], read, [commands.times[len(fits) - 1] + free[len(fits) - 1]]])
    longest = float(np.max(whole[needed:] - whole[:-needed])) if len(whole) > needed else float(whole[-1] - whole[0])
    cycle, limit = needed * reading, WatchOptions().silent
    why = slow_adapter(bus.latency) or f"one reading takes {1000 * reading:.1f} ms"
    if longest > limit:
        raise InputError(None, f"between the poses each servo would be read only every {longest:.2f} s, and has to be every "
                               f"{limit:g} s to be watched; {why}; or play it slower; nothing was moved")
    slow = f"each joint is read only every {1000 * max(cycle, 0):.0f} ms, so that the log shows little of a fast motion; {why}"
    return ReadingPlan(cycle, longest, slow if cycle > STEP else "")
