"""The truth, sealed: enciphered with a seed that nobody chose, its hash published before anything is diagnosed.

A folder holds plan.json (the seed, drawn by the operating system at the first run, and how many sessions it makes; readable by
its owner alone), and for each session NAME.sealed, a zip of the hidden truth, and NAME.sha256 of that zip. Opening
checks the hash. The cipher is SHAKE-256's output, keyed by seed and name, over the zip: enough to keep a reader, or a diagnosis
that looks around in its folders, from seeing the truth by accident; the hash proves that it was not changed afterwards.
A zip depends on the seed alone, so that whoever learns the seed, at the end, can make all sessions again and compare.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path

from workbench.files import InputError
from workbench.files.reading import read_text, write_whole

COUNT = 100
PLAN = "plan.json"
OTHER_PROCESSOR = "processors add up otherwise: OPENBLAS_CORETYPE=Haswell or SkylakeX may make the same"
"""A walk makes centimetres of a last bit: of the seventh trial's sessions a Zen 5 made half, and all with SkylakeX's kernels."""


def write_plan(folder: Path, plan: Mapping[str, int | str]) -> None:
    """A new plan, readable by its owner alone."""
    handle = os.open(folder / PLAN, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(handle, "w") as f:
        f.write(json.dumps(plan, indent=1) + "\n")


class Vault:
    """Sealed answers in a folder."""

    def __init__(self, folder: Path, count: int | None = None, seed: int | None = None) -> None:
        """Continues the existing plan, or writes a new one; ValueError if the request differs from the existing plan.
        count: of sessions (default: 100). seed: for tests and development; a trial leaves it to the operating system."""
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / PLAN
        if not path.exists():
            plan = {"seed": int.from_bytes(os.urandom(16), "big") if seed is None else seed,
                    "drawn_by": "os.urandom" if seed is None else "hand", "count": COUNT if count is None else count}
            write_plan(folder, plan)
        plan = json.loads(read_text(path))
        self.seed, self.count, self.drawn_by = int(plan["seed"]), int(plan["count"]), str(plan["drawn_by"])
        if count not in (None, self.count) or seed not in (None, self.seed):
            raise ValueError(f"{path}: another trial is under way here, of {self.count} sessions; take another folder")

    @property
    def commitments(self) -> dict[str, str]:
        """Session -> SHA-256 of its zip, of those sealed so far, in the order of names."""
        return {p.stem: p.read_text().strip() for p in sorted(self.folder.glob("*.sha256"))}

    def digest(self) -> str:
        """SHA-256 over all commitments, in the order of names: the one line that a report publishes."""
        return hashlib.sha256(json.dumps(self.commitments, sort_keys=True).encode()).hexdigest()

    def seal(self, name: str, files: Mapping[str, str | bytes]) -> str:
        """Seals files by their names; returns the SHA-256, which is then committed. A name can be sealed only once, and a name
        committed on another machine only with the same content; else ValueError."""
        if self.holds(name):
            raise ValueError(f"{name}: sealed already")
        plain = self.packed(name, files)
        committed = hashlib.sha256(plain).hexdigest()
        if self.commitments.get(name, committed) != committed:
            raise ValueError(
                f"{name}: this machine makes another session of the seed than was committed to; {OTHER_PROCESSOR}")
        write_whole(self.folder / f"{name}.sealed", self._cipher(name, plain))
        write_whole(self.folder / f"{name}.sha256", committed + "\n")
        return committed

    def holds(self, name: str) -> bool:
        """Whether a name is sealed here."""
        return (self.folder / f"{name}.sealed").exists()

    def packed(self, name: str, files: Mapping[str, str | bytes]) -> bytes:
        """The zip that is hashed; a salt out of the seed keeps the hash from being matched by trying truths."""
        salt = hashlib.sha256(f"{self.seed}/{name}/salt".encode()).hexdigest()
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as z:
            for file, content in {"salt": salt, **files}.items():
                z.writestr(zipfile.ZipInfo(file, (1980, 1, 1, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)
        return buffer.getvalue()

    def open(self, name: str) -> dict[str, bytes]:
        """The files of a session; InputError if they differ from the commitment."""
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
