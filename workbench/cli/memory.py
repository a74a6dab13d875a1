"""What a long run has worked out already, kept beside its results until it ends, so that a killed run resumes."""

from __future__ import annotations

import glob
import hashlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

from workbench.compare.session import Session

STAYS = 16
"""Letters of the digest in the folder's name."""


@contextmanager
def rollout_memory(out: Path, session: Session) -> Iterator[Path]:
    """A folder beside `out` for rollouts of this session, the same for the same files and versions; left where the block is
    interrupted or fails, gone once it ends well, and with it what other versions left there."""
    beside = Path(os.path.abspath(out))
    kept = f".{beside.name}.resume-"
    folder = beside.parent / f"{kept}{_digest(session)}"
    folder.mkdir(parents=True, exist_ok=True)
    yield folder
    for done in beside.parent.glob(f"{glob.escape(kept)}*"):
        shutil.rmtree(done, ignore_errors=True)


def _digest(session: Session) -> str:
    digest = hashlib.sha256(f"{version('drake-workbench')} {version('drake')} {session.model.sha256}".encode())
    for path in (session.path, *(p for t in session.takes for p in (t.recording, t.motion) if p is not None)):
        if Path(str(path).partition("#")[0]).exists():
            digest.update(Path(str(path).partition("#")[0]).read_bytes())
    for source in sorted(Path(__file__).parents[1].rglob("*.py")):  # another version of the code may simulate otherwise
        digest.update(source.read_bytes())
    return digest.hexdigest()[:STAYS]
