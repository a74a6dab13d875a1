"""Rollouts of a long run, cached beside its results until it ends, so that an interrupted run resumes."""

from __future__ import annotations

import errno
import glob
import hashlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

from workbench.compare.session import Session
from workbench.files import InputError
from workbench.identify.rollouts.key import rollout_code

STAYS = 16
"""Letters of the digest in the folder's name."""


@contextmanager
def rollout_memory(out: Path, session: Session, kept_in: Path | None = None) -> Iterator[Path]:
    """A folder beside `out` for rollouts of this session, the same for the same files and versions. It is kept if the block is
    interrupted or fails with an internal error, and deleted, with those of other versions, once it succeeds or its input is
    refused. kept_in: a folder to use instead, which is never deleted."""
    if kept_in is not None:
        try:
            kept_in.mkdir(parents=True, exist_ok=True)
        except OSError as e:
            raise InputError(kept_in, f"cannot be written ({e.strerror})") from None
        yield kept_in
        return
    beside = Path(os.path.abspath(out))
    kept = f".{beside.name}.resume-"
    folder = beside.parent / f"{kept}{_digest(session)}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(out, f"cannot be written ({e.strerror})") from None
    try:
        yield folder
    except InputError:
        shutil.rmtree(folder, ignore_errors=True)  # the same input would only be refused again
        raise
    except OSError as e:
        if e.filename is None and e.errno in (None, errno.ENOSPC, errno.EDQUOT):
            shutil.rmtree(folder, ignore_errors=True)  # keeping it would leave the disk full
            raise InputError(out, "the disk is full; the cached rollouts are deleted") from None
        raise
    for done in beside.parent.glob(f"{glob.escape(kept)}*"):
        shutil.rmtree(done, ignore_errors=True)


def _digest(session: Session) -> str:
    digest = hashlib.sha256(f"{version('drake-workbench')} {version('drake')} {session.model.sha256}".encode())
    for path in (session.path, *(p for t in session.takes for p in (t.recording, t.motion) if p is not None)):
        if Path(str(path).partition("#")[0]).exists():
            digest.update(Path(str(path).partition("#")[0]).read_bytes())
    digest.update(rollout_code().encode())  # another version of the code may simulate differently
    return digest.hexdigest()[:STAYS]
