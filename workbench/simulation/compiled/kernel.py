"""How the compiled station's functions are compiled: by numba, without the GIL, kept on disk under a digest of their sources.

numba asks of a kept function only whether its own file has changed, not those of the functions it calls. So the folder of kept
code is named after the content of all files that functions and constants come from.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])
_OPTIONS: dict[str, Any] = {"nogil": True, "_nrt": False, "fastmath": {"contract"}, "error_model": "numpy"}
"""No GIL; nothing is allocated, so nothing is counted; a product and a sum may be one instruction, with one rounding, but nothing
is taken to be finite; 1/0 is infinity."""
_SOURCES = ("arrays", "contact", "cost", "kernel", "links", "number", "put", "rows", "run", "servo", "solve", "tree", "vectors",
            "../steady", "../../servo/tabled", "../../servo/term_bank", *(f"lanes/{name}" for name in (
                "arrays", "links", "play", "servo", "solve")))


@cache
def cache_folder() -> Path:
    """Where compiled code is kept; in the user's cache folder, or under NUMBA_CACHE_DIR."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for name in _SOURCES:
        digest.update((Path(__file__).parent / f"{name}.py").read_bytes())
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "drake-workbench"
    return Path(os.environ.get("NUMBA_CACHE_DIR") or user) / f"compiled-{digest.hexdigest()[:16]}"


_found: set[object] = set()


def is_compiled(kernel: Any) -> bool:
    """Whether a kernel of this checkout was compiled on this machine before: else its first run takes a minute longer. numba
    keeps code by the path of its source, so that another checkout of the same code does not count."""
    if kernel in _found:
        return True
    folder = kernel.stats.cache_path
    if folder is not None and any(Path(folder).glob(f"*.{kernel.__name__}-*.nbc")):
        _found.add(kernel)
    return kernel in _found


def part(function: F) -> F:
    """A piece of a kernel; Python does not call it. Always inlined: a call hands over each number of each array of its tuples,
    and half of a step went into that."""
    return numba.njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=True, **_OPTIONS)(function)  # type: ignore[no-any-return]


def rare(function: F) -> F:
    """A piece of a kernel that is needed so rarely that the others are better off without its instructions among theirs: a call.
    """
    return numba.njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **_OPTIONS)(function)  # type: ignore[no-any-return]


def kernel(function: F) -> F:
    """A function that Python calls; compiled at its first call and kept on disk."""
    before = numba.config.CACHE_DIR
    try:
        numba.config.CACHE_DIR = str(cache_folder())
        return numba.njit(cache=True, **_OPTIONS)(function)  # type: ignore[no-any-return]
    except RuntimeError:  # no folder to write to: compiled in each process
        return numba.njit(**_OPTIONS)(function)  # type: ignore[no-any-return]
    finally:
        numba.config.CACHE_DIR = before
