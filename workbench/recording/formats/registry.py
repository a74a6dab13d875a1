"""The formats of recordings: those in this folder, one file each, and those of other packages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from workbench.files.plug_ins import of_folder, with_plug_ins
from workbench.recording.formats.of_packages import answering_for
from workbench.recording.recording import Recording

ENTRY_POINT_GROUP = "workbench.formats"


@dataclass(frozen=True)
class RecordingFormat:
    """One format. A package adds its own as an entry point of the group `workbench.formats` that names such an object.

    name: of recordings' `kind`. called: its name in messages, empty if it is only refused. matches: whether a file that begins
    with these bytes (64 kB, or all; a text made plain as by `plain_table`: `;` and tabs between cells are commas there) is of the
    format. read: the whole file as it is on disk, InputError where it is damaged. marks: the file by which a folder is
    recognised as a recording of the format. parts: names of the recordings in a file or folder, empty if it holds just one;
    read_part: reads one of them. Formats are tried in order of `priority`, then of name.
    """

    name: str
    called: str
    matches: Callable[[bytes], bool]
    read: Callable[[Path], Recording]
    marks: str = ""
    parts: Callable[[Path], tuple[str, ...]] = lambda path: ()
    read_part: Callable[[Path, str], Recording] | None = None
    priority: int = 0


@cache
def known_formats() -> tuple[RecordingFormat, ...]:
    """All formats, in the order in which they are tried; a plug-in may not take the name of another format."""
    import workbench.recording.formats as room

    own = {known.name: known for known in of_folder(room, "FORMAT", RecordingFormat)}
    found = with_plug_ins(own, ENTRY_POINT_GROUP, RecordingFormat, "format",
                          lambda known, at: (known.name, answering_for(known, at)))
    return tuple(sorted(found.values(), key=lambda f: (f.priority, f.name)))


def format_of(head: bytes) -> RecordingFormat | None:
    """The format of a file that begins with `head` (made plain); None if no format matches."""
    return next((f for f in known_formats() if f.matches(head)), None)


def format_of_folder(folder: Path) -> RecordingFormat | None:
    """The format in which a folder is a recording, if any."""
    return next((f for f in known_formats() if f.marks and (folder / f.marks).is_file()), None)
