"""LeRobot data sets (huggingface/lerobot, versions 2 and 3): parquet files of goals (`action`) and positions
(`observation.state`).

Positions are degrees, or -100 to 100 of each joint's calibrated range, which the file does not contain. But the data show the
sensor's count, 1/4096 of a turn: if all steps of a joint are whole multiples of one number, that number is a count, which gives
the joint's scale.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from workbench.files import InputError
from workbench.files.reading import read_json, regular_file
from workbench.recording.formats.log_commands import commands_of_rows, out_of_order
from workbench.recording.formats.numbers import rate_of
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.recording import Recording
from workbench.recording.servo_log.state import count_of
from workbench.types import Array

COUNT = 360 / 4096
"""One count of the sensors of the servos that LeRobot drives (STS3215, XL-330, XL-430) [deg]."""
MOST = 512 << 20
"""Largest file [bytes]."""
_ACTION, _STATE, _TIME, _EPISODE = "action", "observation.state", "timestamp", "episode_index"
_RATE = 0.05
"""Allowed difference between the rate of time stamps and that in info.json, as a share."""
_CLEAN = 0.02
"""Allowed difference of a count from 360/4096 deg, as a share, for angles in degrees."""


def read_lerobot(path: Path, episode: str | None = None) -> Recording:
    """One episode of a data set's folder or of one of its parquet files; without `episode` the only one.

    Joints are named by meta/info.json, where the file lies in a data set, else joint_1 and so on. InputError where columns are
    missing, episodes are several, or rows are cut.
    """
    source = str(path)
    table = _table(path)
    episodes = _episodes(path, table)
    if episode is None and len(episodes) > 1:
        raise InputError(source, f"holds {len(episodes)} episodes; choose one as FILE#EPISODE, of {', '.join(episodes[:12])}")
    chosen = episode if episode is not None else (episodes or ("0",))[0]
    if episodes:
        table = table.filter(pa.compute.equal(table.column(_EPISODE), int(chosen)))
    time = _numbers(source, table, _TIME)
    goals, positions = _vectors(source, table, _ACTION), _vectors(source, table, _STATE)
    if goals.shape != positions.shape:
        raise InputError(source, f"action has {goals.shape[1]} joints, observation.state {positions.shape[1]}; expected the same")
    if len(time) < 2 or out_of_order(time).any():
        raise InputError(source, f"episode {chosen}: expected increasing timestamps")
    joints = _names(path, goals.shape[1])
    scales, problems = _scales(joints, positions)
    goals, positions = np.deg2rad(goals * scales), np.deg2rad(positions * scales)
    channels = {f"goal.{j}": goals[:, i] for i, j in enumerate(joints)}
    channels |= {f"position.{j}": positions[:, i] for i, j in enumerate(joints)}
    info = _info(path)
    problems += _rate_problems(info.get("fps"), time)
    return Recording(source=source, kind="lerobot", version=str(info.get("codebase_version", "")), time=time,
                     frames=np.arange(len(time)), rate=rate_of(time), units="degrees", channels=channels,
                     problems=tuple(problems), metadata={"episode": chosen, "robot_type": str(info.get("robot_type") or "")},
                     commands=commands_of_rows(time, joints, goals, np.ones(goals.shape, dtype=bool)))


def _rate_problems(fps: Any, time: Array) -> list[str]:
    """A line if the frame rate in info.json differs from that of the time stamps (N,) [s]."""
    step = float(np.median(np.diff(time)))
    if isinstance(fps, bool) or not isinstance(fps, (int, float)) or fps <= 0 or abs(fps * step - 1) <= _RATE:
        return []
    return [f"meta/info.json says {fps:g} fps, the time stamps say {1 / step:.4g}: the time stamps are used; was the data set "
            "resampled, or recorded at another rate than asked?"]


def episodes(path: Path) -> tuple[str, ...]:
    """Numbers of the episodes that a file or data set holds."""
    return _episodes(path, _table(path))


def _files(path: Path) -> list[Path]:
    return sorted((path / "data").rglob("*.parquet")) if path.is_dir() else [path]


def _table(path: Path) -> pa.Table:
    from pyarrow import parquet

    files = _files(path)
    if not files:
        raise InputError(path, "expected data/**/*.parquet in the data set's folder, found none")
    parts = []
    for file in files:
        try:
            known = parquet.read_schema(regular_file(file, MOST)).names
            missing = [name for name in (_TIME, _ACTION, _STATE) if name not in known]
            if missing:
                log = any(name.startswith("goal.") for name in known)
                how = "; of a joint log in parquet, write CSV: pandas.read_parquet(FILE).to_csv('log.csv', index=False)" if log \
                    else ""
                raise InputError(file, f"column '{missing[0]}' is missing (found {', '.join(known[:8])}); expected a LeRobot "
                                       f"data set with {_TIME}, {_ACTION} and {_STATE}{how}")
            parts.append(parquet.read_table(file, columns=[_TIME, _ACTION, _STATE, *([_EPISODE] if _EPISODE in known else [])]))
        except (pa.ArrowException, OSError, ValueError) as e:
            if isinstance(e, InputError):
                raise
            raise InputError(file, f"not a whole parquet file: {str(e)[:200]}") from None
    try:
        return pa.concat_tables(parts)
    except pa.ArrowException as e:
        raise InputError(path, f"files of one data set differ: {str(e)[:200]}") from None


def _numbers(source: str, table: pa.Table, name: str) -> Array:
    kind = table.column(name).type
    if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
        raise InputError(source, f"column '{name}': expected numbers, found {kind}")
    return np.asarray(table.column(name).to_numpy(zero_copy_only=False), dtype=float)


def _episodes(path: Path, table: pa.Table) -> tuple[str, ...]:
    if _EPISODE not in table.column_names:
        return ()
    if not pa.types.is_integer(table.column(_EPISODE).type):
        raise InputError(path, f"column '{_EPISODE}': expected whole numbers, found {table.column(_EPISODE).type}")
    return tuple(str(e) for e in dict.fromkeys(table.column(_EPISODE).to_pylist()) if e is not None)


def _vectors(source: str, table: pa.Table, name: str) -> Array:
    kind = table.column(name).type
    inner = getattr(kind, "value_type", None)
    if inner is None or not (pa.types.is_floating(inner) or pa.types.is_integer(inner)):
        raise InputError(source, f"column '{name}': expected a vector of numbers in each row, found {kind}")
    try:
        rows = np.array(table.column(name).to_pylist(), dtype=float)
    except (ValueError, TypeError):
        raise InputError(source, f"column '{name}': expected as many numbers in each row") from None
    if rows.ndim != 2 or not rows.shape[1] or not np.isfinite(rows).all():
        raise InputError(source, f"column '{name}': expected a vector of finite numbers in each row")
    return rows


def _info(path: Path) -> dict[str, Any]:
    """meta/info.json of the data set in which a file lies; empty where there is none."""
    for folder in (path, *list(path.parents)[:4]):
        if (folder / "meta" / "info.json").is_file():
            content = read_json(folder / "meta" / "info.json")
            return content if isinstance(content, dict) else {}
    return {}


def _names(path: Path, count: int) -> tuple[str, ...]:
    features = _info(path).get("features")
    feature = features.get(_STATE) if isinstance(features, dict) else None
    names = feature.get("names") if isinstance(feature, dict) else None
    if isinstance(names, dict):
        names = next(iter(names.values()), None)
    if isinstance(names, list) and len(names) == count and all(isinstance(n, str) for n in names) and len(set(names)) == count:
        return tuple(n.removesuffix(".pos") for n in names)
    return tuple(f"joint_{i + 1}" for i in range(count))


def _scales(joints: tuple[str, ...], positions: Array) -> tuple[Array, list[str]]:
    """Degrees per unit (n,) from each joint's count, and remarks on them."""
    counts = np.array([count_of(np.round(p, 5)) for p in positions.T])
    known = np.isfinite(counts)
    if not known.any():
        return np.ones(len(joints)), ["the file does not say the unit of angles, and shows no sensor's count; taken as degrees"]
    if np.all(np.abs(counts[known] - COUNT) < _CLEAN * COUNT):
        return np.ones(len(joints)), []
    if np.all(np.abs(np.rad2deg(counts[known]) - COUNT) < _CLEAN * COUNT):
        note = "angles are in radians, as their steps show (one count of 4096 a turn); converted"
        return np.full(len(joints), 180 / np.pi), [note]
    shown = ", ".join(f"{j} {c:.4g}" for j, c in zip(joints, counts) if np.isfinite(c))
    out = [f"angles are of each joint's range, not degrees: their steps ({shown}) differ; scaled so that a step is one count of "
           "4096 a turn, zero at the middle of the range"]
    if not known.all():
        lost = ", ".join(j for j, k in zip(joints, known) if not k)
        out.append(f"{lost}: no sensor's count is seen; taken as degrees")
    return np.where(known, COUNT / np.where(known, counts, 1.0), 1.0), out


def matches(head: bytes) -> bool:
    """Whether a file begins as parquet does."""
    return head.startswith(b"PAR1")


FORMAT = RecordingFormat("lerobot", "a LeRobot data set (parquet)", matches, read_lerobot, marks="meta/info.json", parts=episodes,
                         read_part=read_lerobot)
"""A data set of one episode is one recording."""
