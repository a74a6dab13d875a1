"""A whole recording, from the server's first answer to the take on the disk; alone, or while a motion plays."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from workbench.device.capture.finish import FEWEST, Capture, finish
from workbench.device.capture.journal import Journal
from workbench.device.capture.recorder import Recorder
from workbench.files import InputError
from workbench.types import Progress

PATIENCE = 10.0
"""Time until the first frame must have arrived [s]: three times the recorder's own time-out for it."""


def record_take(recorder: Recorder, take: Path, until: Callable[[], bool], seconds: float | None = None, motive_too: bool = True,
                progress: Progress | None = None,
                until_time: Callable[[], float | None] = lambda: None) -> Capture:
    """Records until `until()` or so many seconds [s], and has Motive record it too (`motive_too`): its own file lacks no frame
    that the network lost. until_time(): asked at the end, the time on this machine's monotonic clock [s]
    after which frames are left out. The journal is there before the server is asked for anything, and goes when the take is on
    the disk, or no take can be made of it. InputError where no disk, no server or no frame is there."""
    try:
        with Journal(take.with_suffix(".natnet")) as journal:
            try:
                refusal = _record(recorder, journal, take.stem, until, seconds, motive_too, progress)
            except BaseException:
                if recorder.counts.received < FEWEST:
                    journal.discard()
                raise
    finally:
        recorder.link.close()
    motive_state = None if not motive_too else refusal or f"recorded as '{take.stem}'"
    ended = recorder.problem or (f"Motive itself did not record: {refusal}" if refusal else "")
    capture = finish(journal.path, take, ended, motive_state, until_time())
    journal.path.unlink()
    return capture


def _record(recorder: Recorder, journal: Journal, name: str, until: Callable[[], bool], seconds: float | None, motive_too: bool,
            progress: Progress | None) -> str:
    """Fills the journal; why Motive did not record the take as well, "" where it did or was not asked to."""
    recorder.connect()
    refusal = recorder.request_recording(name) if motive_too else ""
    try:
        received = recorder.listen(journal, until, progress, seconds).received
    finally:
        if motive_too and not refusal:
            recorder.stop_recording()
    if received < FEWEST:
        raise InputError(None, f"{recorder.link.description}: stopped after {received} whole frames; expected {FEWEST} or more")
    return refusal


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
