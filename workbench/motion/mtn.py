"""ROBOTIS motion files (.mtn, RoboPlus Motion 1.x): pages of poses by bus ID.

Layout as measured on published files: `key=value` lines, LF or CRLF, names in UTF-8 (with or without byte order mark) or in the
author's code page, always 255 or 127 pages, mostly two arbitrary bytes after the last page. Version 1.00 knows no motor types:
all have 1024 counts. On a computer of a comma country, numbers have decimal commas.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.files.listing import list_names
from workbench.files.numerals import number_of
from workbench.files.reading import MOST_TEXT, read_bytes
from workbench.motion.motion import Motion
from workbench.robot import COUNT
from workbench.robot.mounting import Mounting
from workbench.types import Array, Mask


@dataclass(frozen=True, eq=False)
class MtnPage:
    """One page. Columns are bus IDs, from 0.

    number: from 1, in file order. next, exit: page that follows, or that follows a stop; 0 = none. repeat: how often it
    plays. speed_rate: divides pauses and times. inertial_force: 0 to 127, larger starts and stops more gently.
    compliance: (I,) softness 1 to 7. positions: (S, I) counts. pauses: (S,) after each step, times: (S,) to reach it,
    [s] at speed_rate 1.
    """

    number: int
    name: str
    next: int
    exit: int
    repeat: int
    speed_rate: float
    inertial_force: int
    compliance: NDArray[np.int64]
    positions: NDArray[np.int64]
    pauses: Array
    times: Array

    def __str__(self) -> str:
        return f"page {self.number} '{self.name}'" if self.name else f"page {self.number}"


@dataclass(frozen=True, eq=False)
class MtnFile:
    """A motion file. enable: (I,) which bus IDs it moves. motor_type: (I,), 0 = 1024 counts over 300 degrees."""

    source: str
    version: str
    enable: Mask
    motor_type: NDArray[np.int64]
    pages: tuple[MtnPage, ...]

    @property
    def used(self) -> tuple[MtnPage, ...]:
        """Pages that hold steps."""
        return tuple(p for p in self.pages if len(p.positions))

    def page(self, which: str | int | None = None) -> MtnPage:
        """A page by name or number; None: the only one that holds steps. InputError lists what there is."""
        number = int(which) if isinstance(which, int) or (which and which.isdecimal()) else None
        found = [p for p in self.used if which is None or p.number == number or p.name == which]
        if len(found) != 1:
            wanted = "one page with steps" if which is None else f"one page '{which}' with steps"
            there = list_names([p.name or str(p.number) for p in self.used], 12) or "none"
            raise InputError(self.source, f"expected {wanted}, found {len(found)} (name it: FILE.mtn#page); pages: {there}")
        return found[0]

    def motion(self, which: str | int | None, bus_ids: Mapping[str, int],
               mountings: Mapping[str, Mounting] | None = None) -> Motion:
        """One pass of a page as a motion of the joints that `bus_ids` names; a pause becomes a second row of its pose.

        mountings: of servos whose angle differs from their joint's. The first row is the page's last step where it repeats or
        follows itself, else the neutral pose. InputError if the file moves an ID that no joint has: it was written for another
        robot.
        """
        page = self.page(which)
        moved = [int(i) for i in np.flatnonzero(self.enable)]
        by_id = {i: joint for joint, i in bus_ids.items()}
        for i in moved:
            if i not in by_id:
                raise InputError(self.source, f"bus ID {i} moves in this file, but no joint of the robot has it")
            if self.motor_type[i] != 0:
                motor = self.motor_type[i]
                raise InputError(self.source, f"bus ID {i}: motor type {motor}; expected 0 (1024 counts, 300 deg)")
        joints = tuple(sorted(by_id[i] for i in moved))
        mounted = [(mountings or {}).get(j, Mounting()) for j in joints]
        zeros = [m.zero_count(512, COUNT) for m in mounted]
        steps = (page.positions[:, [bus_ids[j] for j in joints]] - np.array(zeros)) * COUNT * [m.direction for m in mounted]
        loops = page.repeat > 1 or page.next == page.number
        times, rows = [0.0], [steps[-1] if loops else np.zeros(len(joints))]
        for step, time, pause in zip(steps, page.times / page.speed_rate, page.pauses / page.speed_rate):
            for elapsed in (time, pause) if pause > 0 else (time,):
                times.append(times[-1] + float(elapsed))
                rows.append(step)
        name = page.name or str(page.number)
        return Motion(name, np.array(times), joints, np.array(rows), f"{self.source}#{name}")


_LONGEST = 600.0
"""Pause or time of a step [s]; the tool writes 2.04 s at most."""
_LARGEST = 1e9
"""A number beyond is damage: counts, times and rates are below 1e4."""
_TAIL = 8
"""Bytes that the tool may leave after the last page, of which two are seen; more is a page that was cut off."""
_CODE_PAGES = ("utf-8-sig", "cp949", "cp1252", "latin-1")


def load_mtn(path: str | Path) -> MtnFile:
    """Reads a ROBOTIS motion file; InputError names the line and the expected content."""
    lines = [(n, line.strip()) for n, line in enumerate(_text(path).splitlines(), start=1)]
    ends = [k for k, (_, line) in enumerate(lines) if line == "page_end"]
    starts = [k for k, (_, line) in enumerate(lines) if line == "page_begin"]
    edges = sorted([*starts, *ends])
    if len(starts) != len(ends) or edges[::2] != starts or edges[1::2] != ends:
        raise InputError(
            path, f"{len(starts)} page_begin and {len(ends)} page_end; expected them in pairs (is the file cut off?)")
    if not starts:
        raise InputError(path, "no pages; expected a ROBOTIS motion file (type=motion)")
    header = _Fields(path, lines[:starts[0]])
    if header.one("type") != "motion":
        raise InputError(path, f"type={header.one('type')}; expected type=motion")
    enable = header.integers("enable")
    version = header.one("version").replace(",", ".")
    typed = "motor_type" in header.values or version != "1.00"
    motors = header.integers("motor_type", len(enable)) if typed else np.zeros(len(enable), dtype=np.int64)
    pages = tuple(_page(number, _Fields(path, lines[s + 1:e]), len(enable))
                  for number, (s, e) in enumerate(zip(starts, ends), start=1))
    return MtnFile(str(path), version, enable != 0, motors, pages)


def _text(path: str | Path) -> str:
    """The text up to the last page's end, in the first code page that can decode all of it."""
    content = read_bytes(path, MOST_TEXT)
    last = content.rfind(b"page_end")
    end = len(content) if last < 0 else last + len(b"page_end")
    tail = content[end:].strip()
    if len(tail) > _TAIL or (len(tail) > 2 and b"page_begin".startswith(tail)):
        line = content.count(b"\n", 0, end) + 2
        raise InputError(path, f"line {line}: {len(content) - end} bytes without a page_end; expected the file to end here, "
                               "or whole pages (is the file cut off?)")
    for name in _CODE_PAGES:
        with suppress(UnicodeDecodeError):
            return content[:end].decode(name)
    raise AssertionError("latin-1 holds any bytes")


class _Fields:
    """`key=value` lines of a header or page; every complaint names its line."""

    def __init__(self, path: str | Path, lines: list[tuple[int, str]]) -> None:
        self.path = path
        self.first = lines[0][0] if lines else 1
        self.values: dict[str, list[tuple[int, str]]] = {}
        for n, line in lines:
            key, equals, value = line.partition("=")
            if line and not equals:
                raise InputError(path, f"line {n}: expected key=value, found '{line[:20]}'")
            if line:
                self.values.setdefault(key.strip(), []).append((n, value.strip()))

    def one(self, key: str) -> str:
        return self._entry(key)[1]

    def numbers(self, key: str, count: int | None = None) -> Array:
        return self.parse(*self._entry(key), key, count)

    def integers(self, key: str, count: int | None = None) -> NDArray[np.int64]:
        line, value = self._entry(key)
        numbers = self.parse(line, value, key, count)
        if np.any(numbers != np.round(numbers)):
            raise InputError(self.path, f"line {line}: {key}: expected whole numbers, found '{value[:30]}'")
        return np.asarray(numbers, dtype=np.int64)

    def parse(self, line: int, value: str, key: str, count: int | None) -> Array:
        words = [number_of(word.replace(",", ".")) for word in value.split()]
        if None in words:
            raise InputError(self.path, f"line {line}: {key}: expected numbers, found '{value[:30]}'")
        numbers = np.array(words, dtype=float)
        if (count is not None and len(numbers) != count) or not np.isfinite(numbers).all():
            raise InputError(self.path, f"line {line}: {key}: expected {count} finite numbers, found {len(numbers)}")
        if np.any(np.abs(numbers) > _LARGEST):
            raise InputError(self.path, f"line {line}: {key}: expected numbers below {_LARGEST:g}, found '{value[:30]}'")
        return numbers

    def _entry(self, key: str) -> tuple[int, str]:
        entries = self.values.get(key, [])
        if len(entries) != 1:
            raise InputError(self.path, f"line {self.first}: expected one {key}=, found {len(entries)}")
        return entries[0]


def _page(number: int, fields: _Fields, ids: int) -> MtnPage:
    play = fields.numbers("play_param", 5)
    steps = [(n, fields.parse(n, value, "step", ids + 2)) for n, value in fields.values.get("step", ())]
    for n, step in steps:
        if np.any((step[:ids] < 0) | (step[:ids] > 1023)):
            raise InputError(fields.path, f"line {n}: step: expected positions from 0 to 1023")
        if not (step[ids] >= 0 and step[ids + 1] > 0 and step[ids:].max() <= _LONGEST):
            wanted = f"a pause of 0 s or more, a time above 0 s, at most {_LONGEST:g} s"
            raise InputError(fields.path, f"line {n}: step: expected {wanted}")
        if np.any(step[:ids] != np.round(step[:ids])):
            raise InputError(fields.path, f"line {n}: step: expected positions in whole counts")
    if not 0.01 <= play[3] <= 100:
        raise InputError(fields.path, f"line {fields.first}: play_param: speed rate {play[3]:g}; expected 0.01 to 100")
    table = np.array([step for _, step in steps]).reshape(len(steps), ids + 2)
    return MtnPage(
        number=number, name=fields.one("name"), next=int(play[0]), exit=int(play[1]), repeat=int(play[2]),
        speed_rate=float(play[3]), inertial_force=int(play[4]), compliance=fields.integers("compliance", ids),
        positions=table[:, :ids].astype(np.int64), pauses=table[:, ids], times=table[:, ids + 1],
    )
