"""The truth, sealed: enciphered with the seed that nobody chose, its hash published before anything is diagnosed.

A folder holds `seed` (drawn by the operating system at the first run, readable by its owner alone) and NAME.sealed for each
session: a zip of what the session does not show. Its SHA-256 stands in `commitments.json` from the moment it is sealed; opening
checks it. The cipher is SHAKE-256's output, keyed by seed and name, over the zip: enough to keep a reader, or a diagnosis that
looks around in its folders, from seeing the truth by accident; the hash is what proves that it was not changed afterwards.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import secrets
import zipfile
from collections.abc import Mapping
from pathlib import Path

from workbench.robot import InputError
from workbench.robot.files import read_text, write_whole


class Vault:
    """Sealed answers in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    @property
    def seed(self) -> int:
        """Of the whole trial; drawn once, and kept."""
        path = self.folder / "seed"
        if not path.exists():
            handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(handle, "w") as f:
                f.write(str(secrets.randbits(128)))
        return int(read_text(path))

    @property
    def commitments(self) -> dict[str, str]:
        """Session -> SHA-256 of its zip."""
        path = self.folder / "commitments.json"
        return dict(json.loads(read_text(path))) if path.exists() else {}

    def digest(self) -> str:
        """SHA-256 over all commitments, in the order of names: the one line that a report publishes."""
        return hashlib.sha256(json.dumps(self.commitments, sort_keys=True).encode()).hexdigest()

    def seal(self, name: str, files: Mapping[str, str | bytes]) -> str:
        """Seals files by their names; returns the SHA-256 that is now committed to. A name can be sealed once."""
        known = self.commitments
        if name in known:
            raise ValueError(f"{name}: sealed already")
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as z:
            z.writestr("salt", secrets.token_hex(32))  # so that the hash cannot be matched by trying truths
            for file, content in files.items():
                z.writestr(file, content)
        plain = buffer.getvalue()
        write_whole(self.folder / f"{name}.sealed", self._cipher(name, plain))
        known[name] = hashlib.sha256(plain).hexdigest()
        write_whole(self.folder / "commitments.json", json.dumps(known, indent=1, sort_keys=True) + "\n")
        return known[name]

    def open(self, name: str) -> dict[str, bytes]:
        """The files of a session; InputError where they are not what was committed to."""
        path = self.folder / f"{name}.sealed"
        try:
            plain = self._cipher(name, path.read_bytes())
        except OSError as e:
            raise InputError(path, f"cannot be read ({e.strerror})") from None
        if hashlib.sha256(plain).hexdigest() != self.commitments.get(name):
            raise InputError(path, f"expected the SHA-256 that was committed to, {self.commitments.get(name)}")
        with zipfile.ZipFile(io.BytesIO(plain)) as z:
            return {n: z.read(n) for n in z.namelist() if n != "salt"}

    def _cipher(self, name: str, content: bytes) -> bytes:
        stream = hashlib.shake_256(f"{self.seed}/{name}".encode()).digest(len(content))
        return (int.from_bytes(content, "big") ^ int.from_bytes(stream, "big")).to_bytes(len(content), "big")
