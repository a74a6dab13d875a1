"""Suggestions for misspelled names."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """"; did you mean KNOWN?" for the known name closest to `name`, whatever its case; an empty text where none is close."""
    by_lower = {k.lower(): k for k in known}
    near = get_close_matches(name.lower(), list(by_lower), 1)
    return f"; did you mean {by_lower[near[0]]}?" if near else ""
