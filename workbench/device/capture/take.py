"""A whole recording, from the server's first answer to the take on the disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from workbench.device.capture.finish import Capture, finish
from workbench.device.capture.journal import Journal
from workbench.device.capture.recorder import Recorder


def record_take(recorder: Recorder, take: Path, until: Callable[[], bool], seconds: float | None = None, motive_too: bool = True,
                progress: Callable[[str, float | None], None] | None = None,
                until_time: Callable[[], float | None] = lambda: None) -> Capture:
    """Records until `until()` or so many seconds [s], and has Motive record it too (`motive_too`): its own file lacks no frame
    that the network lost. until_time(): asked at the end, the time on this machine's monotonic clock [s]
    after which frames are left out. The journal goes when the take is on the disk. InputError where no server, no frame or no
    disk is there."""
    try:
        recorder.connect()
        with Journal(take.with_suffix(".natnet")) as journal:
            refusal = recorder.request_recording(take.stem) if motive_too else ""
            try:
                recorder.listen(journal, until, progress, seconds)
            except BaseException:
                if not recorder.counts_received:
                    journal.path.unlink(missing_ok=True)
                raise
            finally:
                if motive_too and not refusal:
                    recorder.stop_recording()
    finally:
        recorder.link.close()
    said = None if not motive_too else refusal or f"recorded as '{take.stem}'"
    ended = recorder.problem or (f"Motive itself did not record: {refusal}" if refusal else "")
    capture = finish(journal.path, take, ended, said, until_time())
    journal.path.unlink()
    return capture
