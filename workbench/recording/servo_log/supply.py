"""Checks whether the servos can have run on the recorded supply voltage."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workbench.recording.recording import Recording


@dataclass(frozen=True)
class SupplyChecks:
    """falls: below so much of its own median the supply has broken down. lasts: for so many rows at least."""

    falls: float = 0.6
    lasts: int = 3


SUPPLY = SupplyChecks()


def supply_problems(r: Recording, c: SupplyChecks = SUPPLY) -> Iterator[str]:
    """A line if the voltage is 0 throughout, or breaks down."""
    voltage = r.channels.get("voltage")
    if voltage is None or len(voltage) != len(r.time) or not np.isfinite(voltage).any():
        return
    usual = float(np.nanmedian(voltage))
    if np.nanmax(np.abs(voltage)) == 0:
        yield "voltage: is 0 in every row: was the register read?"
        return
    usual = max(usual, float(np.nanquantile(voltage, 0.9)))
    low = np.flatnonzero(voltage < c.falls * usual)
    if len(low) >= c.lasts:
        lasts = "to the end" if low[-1] == len(voltage) - 1 and np.all(np.diff(low) == 1) else f"in {len(low)} rows"
        yield (f"voltage: falls from {usual:.3g} V to {float(np.nanmin(voltage)):.3g} V, first at {r.time[low[0]]:.3f} s (row "
               f"{low[0] + 1}), {lasts}: the supply broke down, or the register was not read")
