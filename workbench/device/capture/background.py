"""A recording that runs during the motion that it sees."""

from __future__ import annotations

import threading
from pathlib import Path

from workbench.device.capture.finish import Capture
from workbench.device.capture.recorder import Recorder
from workbench.device.capture.take import record_take
from workbench.files import InputError

PATIENCE = 10.0
"""Time until the first frame must have arrived [s]: three times the recorder's own time-out for it."""


class BackgroundRecording:
    """Records from the block's beginning to `stop`; what went wrong is raised where the motion has not begun, else in `stop`."""

    def __init__(self, recorder: Recorder, take: Path) -> None:
        self._recorder, self._take = recorder, take
        self._ended = threading.Event()
        self._capture: Capture | None = None
        self._error: BaseException | None = None
        self._until: float | None = None
        self._thread = threading.Thread(target=self._record, name="record", daemon=True)

    def start(self) -> None:
        """Begins, and waits until frames come; InputError where none do."""
        self._thread.start()
        waited = 0.0
        while not self._recorder.counts_received and self._thread.is_alive() and waited < PATIENCE:
            self._ended.wait(0.05)
            waited += 0.05
        if self._error is not None:
            raise self._error
        if not self._recorder.counts_received:
            self._ended.set()
            raise InputError(None, f"no frame from Motive in {PATIENCE:g} s")

    def stop(self, until: float | None = None) -> Capture:
        """Ends it, and makes the take, of frames up to a time on this machine's monotonic clock [s]."""
        self._until = until
        self._ended.set()
        self._thread.join()
        if self._error is not None:
            raise self._error
        assert self._capture is not None
        return self._capture

    def _record(self) -> None:
        try:
            self._capture = record_take(self._recorder, self._take, self._ended.is_set, until_time=lambda: self._until)
        except BaseException as e:  # it is the other thread's to raise
            self._error = e
