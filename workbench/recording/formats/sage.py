"""SAGE programmes (isaac-sim2real/sage): motions of an arm of position servos, as npz or as the folder of raw CSV files."""

from __future__ import annotations

import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv as arrow_csv

from workbench.files import InputError
from workbench.files.reading import parse_json, read_text, regular_file
from workbench.files.tables import plain_head
from workbench.recording.formats.log_commands import commands_of_rows, out_of_order
from workbench.recording.formats.numbers import map_file, rate_of
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.joint_names import SO101_JOINTS as JOINTS
from workbench.recording.joint_names import URDF_JOINTS
from workbench.recording.recording import Recording
from workbench.types import Array

_FIELDS = {"t_cmd": 1, "q_cmd": 2, "t_meas": 1, "q_meas": 2}
MOST_UNPACKED = 256 << 20
"""Largest size of the arrays in one file [bytes]: hours of an arm's log."""
_DAMAGED = (OSError, ValueError, zipfile.BadZipFile, zlib.error, EOFError, AttributeError, NotImplementedError, RuntimeError,
            KeyError, TypeError, OverflowError, MemoryError, SyntaxError, struct.error, tokenize.TokenError)
"""What numpy and zipfile raise on damaged archives."""
_MORE = {"v_meas": "velocity", "tau_abs": "torque_magnitude"}


def sage_programmes(path: str | Path) -> tuple[str, ...]:
    """Names of the programmes in an npz, without reading them; empty if it is not such a file."""
    try:
        with zipfile.ZipFile(regular_file(path)) as content:
            names = [n.removesuffix(".npy") for n in content.namelist() if n.endswith(".npy")]
            return tuple(dict.fromkeys(n.rpartition("/")[0] for n in names))
    except _DAMAGED:
        return ()


def read_sage_npz(path: str | Path, programme: str | None = None) -> Recording:
    """Reads one programme of an npz with keys `<programme>/<field>` (seconds, radians).

    Without `programme`, an npz of several gives all of them one after the other, each on its own clock; that can be inspected but
    not used as a take. Channels goal, position, velocity and torque_magnitude (from the current register, without sign) of each
    joint.
    """
    source = str(path)
    try:
        _check_size(path)
        with regular_file(path).open("rb") as file, np.load(file, allow_pickle=False) as content:
            names = list(dict.fromkeys(key.rpartition("/")[0] for key in content.files))
            wanted = [k for k in content.files if programme is None or k.rpartition("/")[0] == programme]
            fields = {key: _real(source, key, content[key]) for key in wanted}
    except InputError:
        raise
    except _DAMAGED as e:
        raise InputError(source, f"damaged, or not an npz of number arrays: {str(e)[:200]}") from None
    if programme is not None and programme not in names:
        raise InputError(source, f"no programme '{programme}'; expected one of {', '.join(names)}")
    parts = [_npz_programme(source, fields, n) for n in ([programme] if programme is not None else names)]
    if not parts:
        raise InputError(source, "expected arrays '<programme>/<field>', found none")
    return parts[0] if len(parts) == 1 else _all_of(source, names, parts)


def _check_size(path: str | Path) -> None:
    """InputError if the unpacked content would fill the memory; the archive states the size of each array."""
    with zipfile.ZipFile(path) as content:
        total = sum(entry.file_size for entry in content.infolist())
    if total > MOST_UNPACKED:
        raise InputError(path, f"unpacks to {total / 2**20:.0f} MB; expected at most {MOST_UNPACKED >> 20} MB")


def _real(source: str, key: str, values: Any) -> Array:
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        raise InputError(source, f"'{key}': expected real numbers, found {getattr(values, 'dtype', type(values).__name__)}")
    return np.asarray(values, dtype=float)


def _npz_programme(source: str, fields: dict[str, Array], name: str) -> Recording:
    prefix = f"{name}/" if name else ""
    for field, dimensions in _FIELDS.items():
        array = fields.get(prefix + field)
        if array is None:
            found = ", ".join(list(fields)[:8])
            raise InputError(source, f"no array '{prefix}{field}' (found {found}); expected a SAGE programme with "
                                     f"{', '.join(_FIELDS)}, or a table as CSV")
        if array.ndim != dimensions:
            raise InputError(source, f"'{prefix}{field}': expected an array of {dimensions} dimension(s)")
    width = fields[prefix + "q_meas"].shape[1]
    joints = JOINTS if width == len(JOINTS) else tuple(f"joint_{i + 1}" for i in range(width))
    more = {channel: fields[prefix + field] for field, channel in _MORE.items() if prefix + field in fields}
    return _recording(source, name, joints, fields[prefix + "t_cmd"], fields[prefix + "q_cmd"], fields[prefix + "t_meas"],
                      {"position": fields[prefix + "q_meas"], **more})


def read_sage_raw(path: str | Path) -> Recording:
    """Reads the folder of a programme, or one of its files: control.csv, state_motor.csv (microseconds, radians) and
    joint_list.txt."""
    folder = Path(path) if Path(path).is_dir() else Path(path).parent
    joints = tuple(line.strip() for line in read_text(folder / "joint_list.txt").splitlines() if line.strip())
    t_cmd, goals = _vectors(folder / "control.csv", ("positions",), len(joints))
    t_meas, measured = _vectors(folder / "state_motor.csv", ("positions", "velocities", "torques"), len(joints))
    channels = {"position": measured["positions"], "velocity": measured["velocities"], "torque_magnitude": measured["torques"]}
    return _recording(str(path), folder.resolve().name, joints, t_cmd, goals["positions"], t_meas, channels)


def _vectors(path: Path, columns: tuple[str, ...], width: int) -> tuple[Array, dict[str, Array]]:
    """Times (N,) [s], and (N, width) of each column whose cells are JSON vectors."""
    source = str(path)
    content = map_file(path)
    try:
        table = arrow_csv.read_csv(pa.BufferReader(pa.py_buffer(memoryview(content))), convert_options=arrow_csv.ConvertOptions(
            column_types={"timestamp": pa.float64(), **dict.fromkeys(columns, pa.string())}))
        names = table.column_names
    except (pa.ArrowInvalid, UnicodeDecodeError) as e:
        raise InputError(source, f"{e}") from None
    for wanted in ("timestamp", *columns):
        if names.count(wanted) != 1:
            raise InputError(source, f"line 1: column '{wanted}' {'is given twice' if wanted in names else 'is missing'}")
    out = {}
    for name in columns:
        try:
            cells = table.column(name).to_pylist()
        except UnicodeDecodeError as e:
            raise InputError(source, f"column '{name}': not a text in UTF-8 ({e.reason})") from None
        try:
            rows = parse_json(source, "[" + ",".join(cells) + "]")
            out[name] = np.array(rows, dtype=float).reshape(len(cells), width)
        except (ValueError, TypeError):
            n = next(i for i, c in enumerate(cells) if not _is_vector(c, width))
            got = str(cells[n])[:60]
            raise InputError(source, f"line {n + 2}, {name}: expected {width} numbers in brackets, got '{got}'") from None
    return np.asarray(table.column("timestamp").to_numpy(), dtype=float) * 1e-6, out


def _is_vector(cell: str | None, width: int) -> bool:
    try:
        return len(np.array(parse_json("", cell or ""), dtype=float).reshape(-1)) == width
    except (ValueError, TypeError):
        return False


def _recording(source: str, name: str, joints: tuple[str, ...], t_cmd: Array, goals: Array, time: Array,
               measured: dict[str, Array]) -> Recording:
    of = f"{name}: " if name else ""
    for what, t in (("command", t_cmd), ("measurement", time)):
        if len(t) == 0:
            raise InputError(source, f"{of}expected {what} times, found none")
        bad = out_of_order(t)
        if bad.any():
            n = int(np.argmax(bad))
            raise InputError(source, f"{of}{what} {n + 1} of {len(t)}: time {t[n]:.10g} s does not follow; expected increasing "
                                     "times")
    for what, values in {"goal": goals, **measured}.items():
        rows = len(t_cmd) if what == "goal" else len(time)
        if values.shape != (rows, len(joints)):
            raise InputError(source, f"{of}{what} has shape {values.shape}; expected {(rows, len(joints))}")
    for what, values in {"goal": goals, **measured}.items():
        if np.isinf(values).any() or (what in ("goal", "position") and not np.isfinite(values).any()):
            raise InputError(source, f"{of}{what} holds no finite number" if not np.isfinite(values).any()
                             else f"{of}{what}: expected finite numbers")
    commands = commands_of_rows(t_cmd, joints, goals, np.ones(goals.shape, dtype=bool))
    latest = np.maximum(np.searchsorted(t_cmd, time, side="right") - 1, 0)
    channels = {f"goal.{j}": goals[latest, i] for i, j in enumerate(joints)}
    channels |= {f"{what}.{j}": values[:, i] for what, values in measured.items() for i, j in enumerate(joints)}
    return Recording(source=source, kind="sage", version="", time=time, frames=np.arange(len(time)), rate=rate_of(time),
                     units="radians", channels=channels, commands=commands,
                     metadata={"programme": name, "first command": repr(float(t_cmd[0]))}, aliases=_aliases(joints))


def _aliases(joints: tuple[str, ...]) -> dict[str, str]:
    return URDF_JOINTS if set(joints) == set(URDF_JOINTS) else {}


def _all_of(source: str, names: list[str], parts: list[Recording]) -> Recording:
    time = np.concatenate([p.time for p in parts])
    common = [c for c in parts[0].channels if all(c in p.channels for p in parts)]
    return Recording(
        source=source, kind="sage", version="", time=time, frames=np.arange(len(time)),
        rate=float(np.median([p.rate for p in parts])), units="radians",
        channels={c: np.concatenate([p.channels[c] for p in parts]) for c in common},
        metadata={"programmes": ", ".join(names)}, aliases=parts[0].aliases,
        problems=(f"holds {len(names)} programmes, each on its own clock; choose one as FILE#PROGRAMME",))


def _npz(head: bytes) -> bool:
    return head.startswith(b"PK") and head[30:30 + int.from_bytes(head[26:28], "little")].endswith(b".npy")


def _raw(head: bytes) -> bool:
    return head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith((b"type,timestamp,", b'"type","timestamp"'))


FORMAT = RecordingFormat(
    "sage", "a SAGE programme (npz, or a folder with state_motor.csv)", lambda head: _npz(head) or _raw(head),
    lambda path: read_sage_raw(path) if path.is_dir() or _raw(plain_head(path)) else read_sage_npz(path),
    marks="state_motor.csv",
    parts=lambda path: () if path.is_dir() else sage_programmes(path), read_part=read_sage_npz)
