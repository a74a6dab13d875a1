"""Reads any recording; its format is recognised by its content."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from pathlib import Path

from workbench.files import InputError
from workbench.files.errors import UnknownFolderError
from workbench.files.listing import list_names
from workbench.files.tables import plain_head
from workbench.recording.formats.foreign import refusal
from workbench.recording.formats.registry import RecordingFormat, format_of, format_of_folder, known_formats
from workbench.recording.recording import Recording
from workbench.recording.servo_log.plausibility import check_log

KEPT = 64 << 20
"""Size of the cache of recordings [bytes], as a verb checks a session before it uses it; a minute of 14 bodies is 3 MB."""
_read_before: OrderedDict[tuple[str, str | None, bytes], Recording] = OrderedDict()


def recording_of_take(path: Path, take: str) -> Path:
    """Path that `read_recording` reads for a session's take: `path` itself, a file or a folder of a format, or FILE#PART; of
    several recordings in one file the one with the take's name. InputError says which is missing."""
    file, part = split_part(path)
    if not file.exists():
        raise InputError(None, f"file not found: {file}")
    known: tuple[str, ...] = ()
    try:
        known = _format(file).parts(file)
    except InputError as e:
        if file.is_dir():
            raise InputError(None, f"{e.problem}: {file}") from None
        # a damaged file is reported when it is read
    if part is not None and part not in known:
        raise InputError(None, f"no programme '{part}' in {file}; expected one of {_list(known) or 'a file of several'}")
    if part is None and len(known) > 1:
        if take not in known:
            raise InputError(None, f"{file} holds {len(known)} programmes ({_list(known)}); expected FILE#PROGRAMME, or a take "
                                   "called like one")
        return file.with_name(f"{file.name}#{take}")
    return path


def split_part(path: Path) -> tuple[Path, str | None]:
    """The file or folder, and which of its recordings FILE#PART names."""
    if "#" not in path.name or path.exists():
        return path, None
    name, _, part = path.name.partition("#")
    return path.with_name(name), part


def read_recording(path: str | Path) -> Recording:
    """Reads a recording of any known format, recognised by its content; its joints' channels are checked, and repaired if the
    repair is certain.

    One recording of a file of several is called FILE#PART. InputError where the content is of no format or is damaged. Reading an
    unchanged file again returns the same object, as long as it is among the last `KEPT` bytes that were read.
    """
    path, part = split_part(Path(path))
    known = _format(path)
    key = (str(path), part, _digest(path))
    found = _read_before.pop(key, None) if key[2] else None
    if found is None:
        found = _read(path, part, known)
    if key[2]:
        _read_before[key] = found  # most recently used: dropped last
    while len(_read_before) > 1 and sum(map(_size, _read_before.values())) > KEPT:
        _read_before.popitem(last=False)
    return found


def _digest(path: Path) -> bytes:
    """Digest of a file's content; empty for a folder."""
    if path.is_dir():
        return b""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").digest()


def _size(r: Recording) -> int:
    """Size of a recording's arrays [bytes]."""
    bodies = sum(b.p.nbytes + b.quat.nbytes for b in r.rigid_bodies.values())
    return bodies + sum(a.nbytes for a in (*r.channels.values(), *r.markers.values()))


def _read(path: Path, part: str | None, known: RecordingFormat) -> Recording:
    if part is None:
        return check_log(known.read(path))
    names = known.parts(path)
    if known.read_part is None or part not in names:
        raise InputError(path, f"no programme '{part}'; expected one of {_list(names)}" if names
                         else f"'#{part}' is not allowed: the file holds a single recording")
    return check_log(known.read_part(path, part))


def _format(path: Path) -> RecordingFormat:
    if path.is_dir():
        found = format_of_folder(path)
        if found is None:
            marks = " or ".join(f.marks for f in known_formats() if f.marks)
            raise UnknownFolderError(path, f"expected a recording, found a folder without {marks}")
        return found
    head = plain_head(path)
    if not head:
        raise InputError(path, "the file is empty; expected a recording")
    found = format_of(head)
    if found is None:
        raise refusal(path, head)
    return found


def _list(names: tuple[str, ...]) -> str:
    return list_names(names, 12)
