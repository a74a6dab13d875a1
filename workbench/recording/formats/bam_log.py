"""BAM logs (Rhoban/bam): JSON of one servo that carries a pendulum."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import InputError
from workbench.files.reading import read_json
from workbench.recording.formats.log_commands import commands_of_rows, order_problem
from workbench.recording.formats.numbers import rate_of
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.recording import Recording
from workbench.recording.servo_log.duty_register import duty_of
from workbench.types import Array

_FULL_DUTY = 885.0
"""PWM register of an XL-330 at full duty; its load register holds the PWM, negatives as unsigned 16 bit."""
_SUPPLY, _LEAST_VOLTS = 0.1, 0.5
"""Allowed difference between supply and measured voltage: a share of it, a drop under load, and [V] at least."""
_CHANNELS = {"goal_position": "goal", "position": "position", "speed": "velocity", "temp": "temperature"}
_REQUIRED = ("timestamp", "position", "goal_position")


def _is_calibration(content: Any) -> bool:
    return isinstance(content, dict) and bool(content) and all(
        isinstance(of, dict) and "homing_offset" in of for of in content.values())


def read_bam_log(path: str | Path) -> Recording:
    """Reads a BAM log: rad, rad/s, volts and degrees Celsius unchanged; the load register becomes `duty`.

    Time is the log's own. The file does not name the joint: it gets the motor's name, and in a take the name of the model's only
    joint. InputError if the file is not JSON, is truncated, lacks a key in an entry or contains something other than a number.
    """
    source = str(path)
    content = read_json(path)
    if not isinstance(content, dict) or not isinstance(content.get("entries"), list) or not content["entries"]:
        keys = ", ".join(map(str, list(content)[:6])) if isinstance(content, dict) else ""
        found = f"one with {keys or 'nothing'}" if isinstance(content, dict) else "another value"
        if _is_calibration(content):
            raise InputError(source, "a calibration file of LeRobot (ids, homing offsets and ranges of servos), no recording; "
                                     "expected a BAM log, a JSON object with a list 'entries'")
        if isinstance(content, list) and content and isinstance(content[0], dict):
            raise InputError(source, "a list of records: write CSV with pandas' read_json(FILE).to_csv('log.csv', index=False); "
                                     "expected a BAM log, a JSON object with a list 'entries'")
        raise InputError(source, f"expected a BAM log, a JSON object with a list 'entries', found {found}")
    entries: list[Any] = content["entries"]
    time = _column(source, entries, "timestamp", True)
    if (problem := order_problem(time)) is not None:
        raise InputError(source, f"entries[{problem.row}].timestamp: {problem.text}")
    joint = str(content.get("motor", "servo"))[:40]
    channels = {f"{channel}.{joint}": _column(source, entries, key, key in _REQUIRED) for key, channel in _CHANNELS.items()
                if key in _REQUIRED or key in entries[0]}
    problems = []
    if "load" in entries[0]:
        load = _column(source, entries, "load", False)
        load = np.where(load > 32767, load - 65536, load)
        if not np.any(load):
            problems.append("load is 0 in every row: it was not read, so duty is unknown")
        elif np.nanmax(np.abs(load)) <= _FULL_DUTY:
            channels[f"duty.{joint}"] = load / _FULL_DUTY
        else:
            problems.append(f"load exceeds {_FULL_DUTY:.0f}: it is not a PWM register, so duty is unknown")
    metadata = {k: str(v) for k, v in content.items() if isinstance(v, (str, int, float)) and not isinstance(v, bool)}
    notes: tuple[str, ...] = ()
    if f"duty.{joint}" not in channels and "torque" in entries[0]:
        enabled = _column(source, entries, "torque_enable", False) if "torque_enable" in entries[0] else np.ones(len(time))
        error = channels[f"goal.{joint}"] - channels[f"position.{joint}"]
        duty = duty_of(_column(source, entries, "torque", False), error, enabled != 0)
        if duty is not None:
            channels[f"duty.{joint}"], problems = duty, []
            notes = (f"duty.{joint} is the servo's own register, which the column `torque` holds",)
    if "input_volts" in entries[0]:
        channels["voltage"] = _column(source, entries, "input_volts", False)
        problems += _supply_problems(content.get("vin"), channels["voltage"])
    enabled = np.ones(len(time))
    if "torque_enable" in entries[0]:
        enabled = channels[f"enabled.{joint}"] = _column(source, entries, "torque_enable", False)
    goals = channels[f"goal.{joint}"]
    return Recording(source=source, kind="bam_log", version="", time=time, frames=np.arange(len(time)), rate=rate_of(time),
                     units="radians", channels=channels, metadata=metadata, problems=tuple(problems), notes=notes, nameless=True,
                     commands=commands_of_rows(time, (joint,), goals[:, None], enabled[:, None] != 0))


def _supply_problems(stated: Any, measured: Array) -> list[str]:
    """A line if the supply stated in the header differs from the one that the servo measured (N,) [V]."""
    seen = measured[np.isfinite(measured) & (measured > 0)]
    if isinstance(stated, bool) or not isinstance(stated, (int, float)) or not len(seen):
        return []
    volts = float(np.median(seen))
    if abs(stated - volts) <= max(_SUPPLY * volts, _LEAST_VOLTS):
        return []
    return [f"vin says {stated:g} V, but the servo measured {volts:.4g} V (input_volts, {seen.min():.4g} to {seen.max():.4g}): "
            f"give the "
            "supply that was there as the servo's supply_voltage"]


def _column(source: str, entries: list[Any], key: str, required: bool) -> Array:
    out = np.full(len(entries), np.nan)
    for i, entry in enumerate(entries):
        value = entry.get(key) if isinstance(entry, dict) else None
        if value is None and required:
            raise InputError(source, f"entries[{i}]: key '{key}' is missing")
        if value is not None and (not isinstance(value, (int, float)) or math.isinf(value)):
            raise InputError(source, f"entries[{i}].{key}: expected a number, got {str(value)[:40]}")
        if value is not None:
            out[i] = value
    if required and not np.isfinite(out).all():
        raise InputError(source, f"entries[{int(np.argmin(np.isfinite(out)))}].{key}: expected a finite number")
    return out


def matches(head: bytes) -> bool:
    """Whether the file begins like JSON."""
    return head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith((b"{", b"["))


FORMAT = RecordingFormat("bam_log", "a BAM log", matches, read_bam_log)
