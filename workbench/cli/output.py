"""Atomic output: results appear complete or not at all."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from workbench.files import InputError
from workbench.files.numerals import whole_of

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""No room on the disk, in the user's quota, or in a file (ulimit -f)."""


LEFT = ".workbench-"
"""Prefix of folders that are being filled; the number of the process that fills them follows."""


@contextmanager
def output_directory(out: Path, need: int = 1 << 20) -> Iterator[Path]:
    """A folder to fill, on the same disk as `out`; when the block succeeds its files, if there are any,
    appear in `out`, complete.

    Whether `out` can be written, and `need` bytes are free there, is checked on entry, before the long work; remains of killed
    runs are deleted. If the block raises, nothing remains. Files that are already in `out` are kept, except those of the
    same name. InputError, with the user's own path, where `out` cannot be written or the disk is full.
    """
    out = Path(os.path.abspath(out))
    anchor = out
    while not anchor.exists() and anchor != anchor.parent:
        anchor = anchor.parent
    if not anchor.is_dir():
        raise InputError(out, f"expected a directory, but {anchor} is a file")
    _clear(anchor)
    try:
        partial = Path(tempfile.mkdtemp(prefix=f"{LEFT}{os.getpid()}-", dir=anchor))
        free = shutil.disk_usage(anchor).free
    except OSError as e:
        raise InputError(out, f"cannot be written ({anchor}: {e.strerror})") from None
    if free < need:
        partial.rmdir()
        raise InputError(out, f"cannot be written ({free / 1e6:.1f} MB are free on the disk; expected {need / 1e6:.0f} MB)")
    try:
        partial.chmod(0o777 & ~_umask())
        yield partial
        if any(partial.iterdir()):
            _publish(partial, out)
    except InputError as e:
        if e.source is None or not Path(e.source).is_relative_to(partial):
            raise
        raise InputError(out / Path(e.source).relative_to(partial), e.problem) from None
    except OSError as e:
        if e.errno in _FULL or (e.filename is not None and str(e.filename).startswith(str(partial))):
            raise InputError(out, f"cannot be written ({e.strerror})") from None
        raise
    finally:
        shutil.rmtree(partial, ignore_errors=True)


@contextmanager
def memory_folder(out: Path) -> Iterator[None]:
    """Makes `out` for the memory of a run that may be killed and continued; removes it where nothing was put into it."""
    out.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        with suppress(OSError):  # not empty
            out.rmdir()


def _clear(folder: Path) -> None:
    """Removes unfinished output of killed runs from `folder`."""
    for left in folder.glob(f"{LEFT}[0-9]*-*"):
        process = whole_of(left.name.removeprefix(LEFT).partition("-")[0])
        if process is not None and not runs(process):
            shutil.rmtree(left, ignore_errors=True)


def runs(process: int) -> bool:
    """Whether a process with this number exists."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it belongs to another user
        return True
    return True


def _publish(partial: Path, out: Path) -> None:
    if not out.exists():
        out.parent.mkdir(parents=True, exist_ok=True)
        partial.rename(out)
        return
    moves = {p: out / p.relative_to(partial) for p in sorted(partial.rglob("*")) if not p.is_dir()}
    for target in moves.values():  # all before the first is moved
        if target.is_dir():
            raise InputError(target, "cannot be written (a folder has this name)")
        blocked = next((p for p in target.parents if p.is_relative_to(out) and p.exists() and not p.is_dir()), None)
        if blocked is not None:
            raise InputError(target, f"cannot be written ({blocked} is a file)")
    for source, target in moves.items():
        target.parent.mkdir(parents=True, exist_ok=True)
        source.replace(target)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
