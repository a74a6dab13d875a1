"""Reads and writes files so that a failure gives one readable line and never half a file."""

from __future__ import annotations

import codecs
import json
import os
import stat
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import lru_cache, wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

from workbench.files.errors import InputError

P = ParamSpec("P")
T = TypeVar("T")
MOST_TEXT = 256 << 20
"""Largest file that is read as text at once [bytes]; a walk of a minute is 1 MB."""
MOST_JSON = 32 << 20
"""The same for JSON, which takes some ten times its size in memory; a log of 20 s is 0.2 MB."""


def cached_by_content(maxsize: int) -> Callable[[Callable[Concatenate[Path, P], T]], Callable[Concatenate[Path, P], T]]:
    """`lru_cache` for functions of a file (its path comes first): a file that has changed is read again."""

    def decorate(read: Callable[Concatenate[Path, P], T]) -> Callable[Concatenate[Path, P], T]:
        @lru_cache(maxsize=maxsize)
        def read_content(path: Path, content: bytes | None, *args: P.args, **kwargs: P.kwargs) -> T:
            return read(path, *args, **kwargs)

        @wraps(read)
        def read_again(path: Path, *args: P.args, **kwargs: P.kwargs) -> T:
            content = None
            with suppress(OSError, InputError):  # `read` reports the error
                content = regular_file(path, MOST_TEXT).read_bytes()
            return read_content(path, content, *args, **kwargs)  # type: ignore[arg-type]  # as every lru_cache, of what can be hashed

        return read_again

    return decorate


def regular_file(path: str | Path, most: int | None = None) -> Path:
    """The path of a file of at most `most` bytes; InputError for files that never end or that wait (devices, pipes), for a folder
    and for a missing file."""
    path = Path(path)
    try:
        found = path.stat()
    except (OSError, ValueError) as e:  # ValueError: a zero in the name
        raise InputError(path, f"cannot be read ({getattr(e, 'strerror', None) or e})") from None
    if not stat.S_ISREG(found.st_mode):
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a pipe, a device or a socket"
        raise InputError(path, f"cannot be read (is {kind}; expected a file)")
    if most is not None and found.st_size > most:
        raise InputError(path, f"has {found.st_size / 2**20:.0f} MB; expected at most {most / 2**20:g} MB of this kind")
    return path


def read_bytes(path: str | Path, most: int | None = None) -> bytes:
    """The content of a file of at most `most` bytes; InputError where it cannot be read."""
    try:
        return regular_file(path, most).read_bytes()
    except OSError as e:
        raise InputError(path, f"cannot be read ({e.strerror})") from None


def read_text(path: str | Path, most: int = MOST_TEXT) -> str:
    """The text of a UTF-8 file of at most `most` bytes, with or without byte order mark; InputError where it cannot be read."""
    try:
        return regular_file(path, most).read_text(encoding="utf-8-sig")
    except OSError as e:
        raise InputError(path, f"cannot be read ({e.strerror})") from None
    except UnicodeDecodeError as e:
        marked = e.object[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
        raise InputError(path, "text in UTF-16; save it as UTF-8" if marked else
                         f"byte {e.start}: not a text file in UTF-8") from None


def read_json(path: str | Path) -> Any:
    """The content of a JSON file; InputError names line and column, or says that it nests too deep or holds a giant number."""
    return parse_json(path, read_text(path, MOST_JSON))


def parse_json(path: str | Path, text: str, place: str = "") -> Any:
    """The same as `read_json`, for a text at `place` in the file."""
    try:
        return json.loads(text, parse_int=_bounded_int, parse_float=_finite_float, parse_constant=_finite_float)
    except json.JSONDecodeError as e:
        at = place or f"line {e.lineno}, "
        if e.msg == "Extra data" and not place and text[e.pos:e.pos + 1] == "{":
            raise InputError(path, f"line {e.lineno}: JSON lines, one object for each row: write CSV with pandas' "
                                   "read_json(FILE, lines=True).to_csv('log.csv', index=False)") from None
        raise InputError(path, f"{at}column {e.colno}: {e.msg}; expected whole JSON") from None
    except RecursionError:
        raise InputError(path, f"{place}nested too deep; expected JSON of a few levels") from None
    except OverflowError as e:
        raise InputError(path, f"{place}{e}") from None


def _finite_float(digits: str) -> float:
    value = float(digits)
    if abs(value) == float("inf"):
        raise OverflowError(f"a number beyond all bounds, '{digits[:40]}'; expected at most 1e308")
    return value


def _bounded_int(digits: str) -> int:
    if len(digits) > 18:
        raise OverflowError(f"a whole number of {len(digits)} digits; expected at most 18")
    return int(digits)


def write_whole(path: str | Path, content: str | bytes) -> Path:
    """Writes one file atomically, and creates its folder; InputError if it cannot be written."""
    path = Path(path)
    write_together(path.parent, {path.name: content})
    return path


def write_together(folder: str | Path, contents: Mapping[str, str | bytes]) -> list[Path]:
    """Writes files that belong together: all of them, or none. Returns their paths, in the order given.

    Everything that can fail on a full or protected disk is done under temporary names. Old files of these names are deleted
    before the first new one appears, so that even a power cut leaves no mixture of old and new. InputError names the file.
    """
    folder = Path(folder)
    paths = [folder / name for name in contents]
    parts = [folder / f".{name}.{os.getpid()}.part" for name in contents]
    at = folder
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for at, part, content in zip(paths, parts, contents.values()):
            if at.is_dir():
                raise IsADirectoryError(0, "a folder has this name")
            part.write_bytes(content.encode() if isinstance(content, str) else content)
        if len(paths) > 1:
            for at in paths:
                at.unlink(missing_ok=True)
        for at, part in zip(paths, parts):
            part.replace(at)
    except OSError as e:
        raise InputError(at, f"cannot be written ({e.strerror})") from None
    finally:
        for part in parts:
            with suppress(OSError):
                part.unlink()
    return paths
