"""One servo's log in encoder ticks: a line `ticks of JOINT`, then lines `milliseconds goal position`, 4096 ticks to the turn."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from workbench.files import InputError
from workbench.recording import Recording
from workbench.recording.formats.log_commands import commands_of_rows
from workbench.recording.formats.registry import RecordingFormat

FIRST = b"ticks of "
TICK = 2 * math.pi / 4096


def matches(head: bytes) -> bool:
    """Recognised by its first line."""
    return head.startswith(FIRST)


def read(path: Path) -> Recording:
    """SI and radians inside; InputError names the line that is damaged."""
    first, *lines = path.read_text(encoding="utf-8").splitlines()
    joint, rows = first.removeprefix(FIRST.decode()).strip(), []
    for number, line in enumerate(lines, start=2):
        try:
            milliseconds, goal, position = map(int, line.split())
        except ValueError:
            raise InputError(path, f"line {number}: expected three whole numbers, got '{line}'") from None
        rows.append((milliseconds, goal, position))
    if len(rows) < 2:
        raise InputError(path, "expected two rows or more")
    table = np.array(rows, dtype=float)
    time, goal, position = (table[:, 0] - table[0, 0]) * 1e-3, (table[:, 1] - 2048) * TICK, (table[:, 2] - 2048) * TICK
    return Recording(
        source=str(path), kind="tick_log", version="", time=time, frames=np.arange(len(time)),
        rate=float(1 / np.median(np.diff(time))), units="ticks",
        channels={f"goal.{joint}": goal, f"position.{joint}": position},
        commands=commands_of_rows(time, (joint,), goal[:, None], np.ones((len(time), 1), dtype=bool)))


FORMAT = RecordingFormat("tick_log", "a log in encoder ticks", matches, read)
