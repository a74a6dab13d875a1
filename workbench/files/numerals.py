"""Parses numbers as written in files: Python's own `float` and `int` accept more (1_0, digits of other scripts)."""

from __future__ import annotations

import re

_DECIMAL = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?", re.ASCII)
_WHOLE = re.compile(r"[+-]?[0-9]{1,18}", re.ASCII)


def number_of(text: str) -> float | None:
    """The finite number written in `text` in ASCII digits, with or without an exponent; None if it is not one."""
    text = text.strip()
    if len(text) > 400 or not _DECIMAL.fullmatch(text):
        return None
    value = float(text)
    return value if abs(value) < float("inf") else None


def whole_of(text: str) -> int | None:
    """The whole number written in `text` in at most 18 ASCII digits; None if it is not one."""
    text = text.strip()
    return int(text) if _WHOLE.fullmatch(text) else None
