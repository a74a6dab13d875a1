"""What a long run has worked out already, kept beside its results until it ends, so that a killed run resumes."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

from workbench.gap.session import Session

STAYS = 16
"""Letters of the digest in the folder's name."""


@contextmanager
def rollout_memory(out: Path, session: Session) -> Iterator[Path]:
    """A folder beside `out` for rollouts of this session, the same for the same files and versions; gone once the block ends
    well, left where it is interrupted or fails."""
    folder = Path(os.path.abspath(out)).parent / f".{Path(os.path.abspath(out)).name}.resume-{_digest(session)}"
    folder.mkdir(parents=True, exist_ok=True)
    yield folder
    shutil.rmtree(folder, ignore_errors=True)


def _digest(session: Session) -> str:
    digest = hashlib.sha256(f"{version('drake-workbench')} {version('drake')} {session.model.sha256}".encode())
    for path in (session.path, *(p for t in session.takes for p in (t.recording, t.motion) if p is not None)):
        if Path(str(path).partition("#")[0]).exists():
            digest.update(Path(str(path).partition("#")[0]).read_bytes())
    for source in sorted(Path(__file__).parents[1].rglob("*.py")):  # another version of the code may simulate otherwise
        digest.update(source.read_bytes())
    return digest.hexdigest()[:STAYS]
