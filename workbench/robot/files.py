"""Reading and writing files so that a failure is one readable line and never half a file."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import lru_cache, wraps
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar

from workbench.robot.errors import InputError

P = ParamSpec("P")
T = TypeVar("T")


def cached_by_content(maxsize: int) -> Callable[[Callable[Concatenate[Path, P], T]], Callable[Concatenate[Path, P], T]]:
    """`lru_cache` for functions of a file (its path comes first): one that was written anew is read anew."""

    def decorate(read: Callable[Concatenate[Path, P], T]) -> Callable[Concatenate[Path, P], T]:
        @lru_cache(maxsize=maxsize)
        def known(path: Path, content: bytes | None, *args: P.args, **kwargs: P.kwargs) -> T:
            return read(path, *args, **kwargs)

        @wraps(read)
        def cached(path: Path, *args: P.args, **kwargs: P.kwargs) -> T:
            content = None
            with suppress(OSError):  # `read` says what is wrong
                content = path.read_bytes()
            return known(path, content, *args, **kwargs)  # type: ignore[arg-type]  # as every lru_cache, of what can be hashed

        return cached

    return decorate


def read_text(path: str | Path) -> str:
    """The text of a UTF-8 file, with or without byte order mark; InputError where it cannot be read."""
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except OSError as e:
        raise InputError(path, f"cannot be read ({e.strerror})") from None
    except UnicodeDecodeError as e:
        raise InputError(path, f"byte {e.start}: not a text file in UTF-8") from None


def write_whole(path: str | Path, content: str | bytes) -> Path:
    """Writes one file, whole or not at all, and makes its folder; InputError where it cannot be written."""
    path = Path(path)
    write_together(path.parent, {path.name: content})
    return path


def write_together(folder: str | Path, contents: Mapping[str, str | bytes]) -> list[Path]:
    """Writes files that belong together: all of them, or none. Returns their paths, in the order given.

    What can fail on a full or protected disk is done on temporary names. Old files of these names go before the first
    new one appears, so that even a power cut leaves no mixture of old and new. InputError names the file.
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
