"""The log of a run, written beside its results: OUT/workbench.log."""

from __future__ import annotations

import logging
import platform
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import workbench

NAME = "workbench.log"
LOGGER = logging.getLogger("workbench.run")
"""Logger to which verbs report their progress. Silent on the terminal, except with --verbose."""


class RunLog(logging.Handler):
    """Keeps the lines of one run; `write` puts them into its results' folder."""

    def __init__(self, arguments: Sequence[str]) -> None:
        super().__init__(logging.DEBUG)
        self.lines = [f"workbench {workbench.__version__}, Python {platform.python_version()}, {platform.platform()}",
                      f"{time.strftime('%Y-%m-%d %H:%M:%S %z')}  workbench {' '.join(arguments)}"]
        self._began = time.monotonic()

    def emit(self, record: logging.LogRecord) -> None:
        """Keeps a line with its time [s] since the run began."""
        self.lines.append(f"{time.monotonic() - self._began:9.1f} s  {record.getMessage()}")

    def write(self, folder: Path | None, code: int) -> None:
        """Appends this run to the folder's log; does nothing if the run has no folder, or wrote nothing into it (`code` is not
        0)."""
        if code != 0 or folder is None or not folder.is_dir():
            return
        self.lines.append(f"{time.monotonic() - self._began:9.1f} s  exit code {code}")
        try:
            with (folder / NAME).open("a", encoding="utf-8") as f:
                f.write("\n".join(self.lines) + "\n\n")
        except OSError as e:  # the results are complete; a missing log is no reason to fail
            print(f"workbench: warning: {folder / NAME}: cannot be written ({e.strerror})", file=sys.stderr)


def speak_up(verbose: bool, quiet: bool) -> logging.Handler | None:
    """Sets the verbosity on stderr: `quiet` no progress, `verbose` each step with its time. Returns the handler it added."""
    LOGGER.setLevel(logging.DEBUG)
    LOGGER.propagate = False
    if not verbose or quiet:
        return None
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
    LOGGER.addHandler(handler)
    return handler
