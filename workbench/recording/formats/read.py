"""Any recording, told apart by its content."""

from __future__ import annotations

from pathlib import Path

from workbench.recording.formats.bam_log import read_bam_log
from workbench.recording.formats.joint_log import looks_like_joint_log, read_joint_log
from workbench.recording.formats.motive import read_motive
from workbench.recording.formats.motive_header import looks_like_motive
from workbench.recording.formats.sage import read_sage_npz, read_sage_raw, sage_programmes
from workbench.recording.recording import Recording
from workbench.robot import InputError

_HEAD = 1 << 16


def recording_of_take(path: Path, take: str) -> Path:
    """What `read_recording` is to read for a session's take: `path` itself, a file, the folder of a SAGE programme or
    FILE#PROGRAMME; of an npz of several programmes the one that is called as the take is. InputError says what is missing."""
    file, programme = _programme_of(path)
    if path.is_dir():
        if not (path / "state_motor.csv").is_file():
            raise InputError(None, f"expected a recording, found a folder without state_motor.csv: {path}")
        return path
    if not file.is_file():
        raise InputError(None, f"file not found: {file}")
    known = sage_programmes(file) if programme is not None or file.suffix == ".npz" else ()
    if programme is not None and programme not in known:
        raise InputError(None, f"no programme '{programme}' in {file}; expected one of {', '.join(known) or 'an npz of them'}")
    if programme is None and len(known) > 1:
        if take not in known:
            raise InputError(None, f"{file} holds {len(known)} programmes; expected FILE#PROGRAMME, or a take called like one")
        return file.with_name(f"{file.name}#{take}")
    return path


def _programme_of(path: Path) -> tuple[Path, str | None]:
    if path.exists() or "#" not in path.name:
        return path, None
    name, _, programme = path.name.partition("#")
    return path.with_name(name), programme


def read_recording(path: str | Path) -> Recording:
    """Reads a Motive CSV, a joint log, a BAM log, or a SAGE programme (npz, folder of raw CSV, or one file of it).

    One programme of an npz of several is called FILE#PROGRAMME. InputError where the content is none of these or is damaged.
    """
    path, programme = _programme_of(Path(path))
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
