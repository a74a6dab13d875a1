"""Runs `workbench diagnose` on one session as a user would, and measures its time and memory."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path

import workbench
from workbench.files.reading import read_text, write_whole

DIAGNOSE = (str(Path(sys.executable).with_name("workbench")), "diagnose")
"""The command that was installed beside this Python."""
LIMIT = 3600.0


class StoppedError(Exception):
    """The run was cancelled; nothing of the current diagnosis is kept."""


@dataclass(frozen=True)
class Asked:
    """How it went. exit: the command's code, below 0 the signal that ended it. seconds of wall and processor; memory: the most
    that one process held [bytes]. code: of the workbench that answered. complaint: its last word, if it failed."""

    exit: int
    seconds: float
    processor_seconds: float
    memory: float
    code: str
    complaint: str = ""


@dataclass
class Asker:
    """Asks; several threads may share one. limit: seconds after which a diagnosis counts as failed."""

    command: Sequence[str] = DIAGNOSE
    limit: float = LIMIT
    _running: set[int] = field(default_factory=set)
    _stopped: bool = False

    def ask(self, session: Path, results: Path) -> Asked:
        """Writes the results, said.txt and asked.json into `results`, complete; a session with a result is not asked again."""
        known = asked(results)
        if known is not None:
            return known
        part = results.with_name(f".{results.name}.part")
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        code = code_of_workbench()
        done = self._measured([*self.command, str(session), "--out", str(part)], part / "said.txt", code)
        if self._stopped:
            shutil.rmtree(part, ignore_errors=True)
            raise StoppedError(results.name)
        write_whole(part / "asked.json", json.dumps(asdict(done), indent=1) + "\n")
        shutil.rmtree(results, ignore_errors=True)
        os.replace(part, results)
        return done

    def stop(self) -> None:
        """Ends the current diagnosis."""
        self._stopped = True
        for pid in tuple(self._running):
            _end(pid)

    def _measured(self, command: Sequence[str], log: Path, code: str) -> Asked:
        began = time.monotonic()
        with log.open("wb") as said:
            process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=said, stderr=said, start_new_session=True)
        self._running.add(process.pid)
        if self._stopped:
            _end(process.pid)
        timer = threading.Timer(self.limit, _end, (process.pid,))
        timer.start()
        try:
            _, status, used = os.wait4(process.pid, 0)
        finally:
            timer.cancel()
            self._running.discard(process.pid)
        process.returncode = os.waitstatus_to_exitcode(status)
        seconds = time.monotonic() - began
        complaint = "" if process.returncode == 0 else f"took more than {self.limit:g} s" if seconds > self.limit else _last(log)
        processor = used.ru_utime + used.ru_stime
        return Asked(process.returncode, round(seconds, 2), round(processor, 2), 1024.0 * used.ru_maxrss, code, complaint)


def asked(results: Path) -> Asked | None:
    """How a session's diagnosis went; None where there was none."""
    path = results / "asked.json"
    return Asked(**json.loads(read_text(path))) if path.exists() else None


def code_of_workbench() -> str:
    """SHA-256 of the workbench's code as it is now, its first twelve digits."""
    root = Path(workbench.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(f"{path.relative_to(root)}\0".encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def _end(group: int) -> None:
    with suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


def _last(log: Path) -> str:
    """The error that it ended with, else its last line."""
    text = log.read_text(encoding="utf-8", errors="replace").replace("\r", "\n")
    lines = [line.strip() for line in reversed(text.splitlines()) if line.strip()]
    return next((line for line in lines if re.match(r"[\w.]+(Error|Exception): ", line)), next(iter(lines), "no word"))
