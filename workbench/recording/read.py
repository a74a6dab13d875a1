"""Any recording, told apart by its content."""

from __future__ import annotations

from pathlib import Path

from workbench.recording.bam_log import read_bam_log
from workbench.recording.joint_log import looks_like_joint_log, read_joint_log
from workbench.recording.motive import read_motive
from workbench.recording.motive_header import looks_like_motive
from workbench.recording.recording import Recording
from workbench.recording.sage import read_sage_npz, read_sage_raw
from workbench.robot import InputError

_HEAD = 1 << 16


def read_recording(path: str | Path) -> Recording:
    """Reads a Motive CSV, a joint log, a BAM log, or a SAGE programme (npz, folder of raw CSV, or one file of it).

    One programme of an npz of several is called FILE#PROGRAMME. InputError where the content is none of these or is damaged.
    """
    path = Path(path)
    programme = None
    if not path.exists() and "#" in path.name:
        name, _, programme = path.name.partition("#")
        path = path.with_name(name)
    if path.is_dir():
        if (path / "state_motor.csv").is_file():
            return read_sage_raw(path)
        raise InputError(path, "expected a recording, found a folder without state_motor.csv")
    try:
        with open(path, "rb") as file:
            head = file.read(_HEAD)
    except OSError as e:
        raise InputError(path, f"cannot be read ({e.strerror})") from None
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if head.startswith(b"PK"):
        return read_sage_npz(path, programme)
    if programme is not None:
        raise InputError(path, f"'#{programme}' chooses a programme of an npz; this is none")
    if text.startswith((b"{", b"[")):
        return read_bam_log(path)
    if looks_like_motive(head):
        return read_motive(path)
    if looks_like_joint_log(head):
        return read_joint_log(path)
    if text.startswith((b"type,timestamp,", b'"type","timestamp"')):
        return read_sage_raw(path)
    if not head:
        raise InputError(path, "the file is empty; expected a recording")
    raise InputError(path, "line 1: not a recording; expected a Motive CSV, a joint log, a BAM log or a SAGE programme")
