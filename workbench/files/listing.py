"""Names listed in one line of text."""

from __future__ import annotations

from collections.abc import Sequence


def list_names(names: Sequence[str], most: int, separator: str = ", ") -> str:
    """The first `most` names, and how many more there are; empty without names."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return separator.join(names[:most]) + more
