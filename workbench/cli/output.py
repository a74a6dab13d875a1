"""Results written whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from workbench.robot.errors import InputError


@contextmanager
def output_directory(out: Path) -> Iterator[Path]:
    """A folder to fill, on the same disk as `out`; when the block ends well its files appear in `out`, whole.

    Whether `out` can be written is found out on entry, before the long work. If the block raises, nothing remains.
    Files that already lie in `out` stay, except those of the same name. InputError where `out` cannot be written.
    """
    out = Path(os.path.abspath(out))
    anchor = out
    while not anchor.exists() and anchor != anchor.parent:
        anchor = anchor.parent
    if not anchor.is_dir():
        raise InputError(out, f"expected a directory, but {anchor} is a file")
    try:
        partial = Path(tempfile.mkdtemp(prefix=".workbench-", dir=anchor))
    except OSError as e:
        raise InputError(out, f"cannot be written ({anchor}: {e.strerror})") from None
    try:
        partial.chmod(0o777 & ~_umask())
        yield partial
        try:
            _publish(partial, out)
        except OSError as e:
            raise InputError(out, f"cannot be written ({e.strerror})") from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def _publish(partial: Path, out: Path) -> None:
    if not out.exists():
        out.parent.mkdir(parents=True, exist_ok=True)
        partial.rename(out)
        return
    for source in sorted(p for p in partial.rglob("*") if not p.is_dir()):
        target = out / source.relative_to(partial)
        target.parent.mkdir(parents=True, exist_ok=True)
        source.replace(target)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
