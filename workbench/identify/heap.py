"""Memory that a long recording's arrays leave behind."""

from __future__ import annotations

import ctypes


def give_back() -> None:
    """Gives freed memory back to the system, where the C library can (glibc): arrays of whole recordings leave holes between
    small objects, which stay with the process otherwise."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
