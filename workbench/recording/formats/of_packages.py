"""Formats of other packages: what their readers raise or get wrong becomes one line that names the package."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.files import InputError
from workbench.recording.recording import Recording

if TYPE_CHECKING:
    from workbench.recording.formats.registry import RecordingFormat

OF_JOINTS = ("goal", "speed", "position", "velocity", "duty", "current", "temperature", "enabled")
OF_ROBOT = ("voltage",)


def answering_for(known: RecordingFormat, at: str) -> RecordingFormat:
    """The same format, whose exceptions and malformed recordings are reported as those of `at`."""
    part = known.read_part
    return replace(known, matches=partial(_call, known.matches, f"{at}: matches"), read=partial(_read, known.read, f"{at}: read"),
                   read_part=None if part is None else partial(_read, part, f"{at}: read_part"))


def _read(read: Callable[..., Any], at: str, path: Path, *part: str) -> Recording:
    recording = _call(read, at, path, *part)
    wrong = next(_misshapen(recording), None)
    if wrong is not None:
        raise InputError(path, f"{at}: {wrong}")
    unknown = [c for c in recording.channels if not _is_known(c)]
    expected = f"expected voltage, or {', '.join(OF_JOINTS)}, a point and the joint"
    problems = tuple(f"channel '{c}' is unknown; {expected}" for c in unknown)
    return replace(recording, problems=(*recording.problems, *problems)) if problems else recording


def _call(function: Callable[..., Any], at: str, *args: Any) -> Any:
    try:
        return function(*args)
    except (InputError, MemoryError):
        raise
    except Exception as e:  # a plug-in may raise anything
        raise InputError(args[0] if isinstance(args[0], Path) else None, f"{at}: {type(e).__name__}: {e}") from e


def _misshapen(recording: Any) -> Iterator[str]:
    if not isinstance(recording, Recording):
        yield f"expected a Recording, got {type(recording).__name__}"
    count = len(recording.time)
    arrays = [("frames", recording.frames, (count,)), *((f"channel '{k}'", v, (count,)) for k, v in recording.channels.items()),
              *((f"marker '{k}'", v, (count, 3)) for k, v in recording.markers.items())]
    for name, body in recording.rigid_bodies.items():
        arrays += [(f"p of '{name}'", body.p, (count, 3)), (f"quat of '{name}'", body.quat, (count, 4))]
    for what, array, shape in arrays:
        if np.shape(array) != shape:
            yield f"{what} has shape {np.shape(array)}; expected {shape}, as `time` has {count} rows"


def _is_known(channel: str) -> bool:
    kind, _, joint = channel.partition(".")
    return channel in OF_ROBOT or (kind in OF_JOINTS and bool(joint))
