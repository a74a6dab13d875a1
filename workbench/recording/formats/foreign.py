"""Files that are not recordings of a known format: their columns, the required ones, and how to convert them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from workbench.files import InputError
from workbench.files.kinds import kind_of_file, lfs_pointer
from workbench.files.listing import list_names
from workbench.files.numerals import number_of
from workbench.files.tables import is_binary
from workbench.recording.formats.odd_tables import long_table, odd_table
from workbench.recording.formats.registry import known_formats
from workbench.recording.formats.table_header import table_header

_SHOWN = 6
"""Maximum number of columns named in one line."""
_UNIT = re.compile(r"(?i)[\s_./]*[\[(]\s*(rad|deg|degrees?|radians?|°|s|sec|seconds?|ms|us|ns|rad/s|deg/s|counts?|ticks?|v|a|nm)"
                   r"\s*[\])]$|[\s_]+(rad|deg|degrees|radians|counts|ticks|sec|secs|seconds|s|ms)$")
"""Matches the unit after a column's name, in brackets or after an underscore."""
_TIME = re.compile(r"(?i)%?_*(time|timestamp|t|stamp|secs?|seconds?|elapsed)(_?(since|from)_?(start|boot))?(_?stamp)?")
_GOAL = (r"(?:action|actions|command|commanded|cmd|target|goal|desired|reference|setpoint|set_point|ref|des|input|"
         r"soll)")
_JOINT = r"(?:joint[._])?(?:pos(?:ition)?s?[._/ ])?"
_SEEN = (r"(?:observation[._/]state|state|present|measured|actual|feedback|position|pos|angle|q|meas|motor_position|"
         r"/?joint_states|joint_pos|joint_position|joint_positions|pos_estimate|ist)")
_PLACE = r"(?:[._/](?:pos|position|angle|q))?"
_NAMED = (
    ("velocity", re.compile(r"(?i)(?:.*/)?(.+?)[._/ ](?:velocity|vel|speed)")),
    ("goal", re.compile(rf"(?i){_GOAL}[._/ ](?!pos$|position$){_JOINT}(.+?){_PLACE}")),
    ("goal", re.compile(rf"(?i)(.+?)[._/ ](?:{_GOAL}(?:_position|_pos)?|(?:position|pos)_{_GOAL})")),
    ("position", re.compile(rf"(?i){_SEEN}[._/ ](.+?){_PLACE}")),
    ("position", re.compile(r"(?i)(.+?)[._/ ](?:position|pos|present_position|angle|actual|measured|q)")),
)
"""Names that other tools give to columns of a joint log: the quantity, and the joint."""
_BARE = {"goal": re.compile(rf"(?i)(?:motor|servo|joint)?[._/ ]?{_GOAL}[._/ ]?(?:pos|position|angle|q)?"),
         "position": re.compile(rf"(?i)(?:motor|servo|joint)?[._/ ]?{_SEEN}[._/ ]?(?:pos|position|angle|q)?")}
"""Columns of a log of one servo, which name no joint."""
_OTHER = re.compile(r"(?i).*(vel|speed|torque|tau|effort|current|load|volt|temp|duty|pwm|error|mode|status|id)\w*")
"""Columns that are neither goal nor position."""


@dataclass(frozen=True)
class _Column:
    """A column's name as given, without its unit, and the unit."""

    called: str
    plain: str
    unit: str


def refusal(path: Path, head: bytes) -> InputError:
    """The error for a file of unknown format, with its apparent kind and the expected one."""
    wanted = ", ".join(f.called for f in known_formats() if f.called)
    if (pointer := lfs_pointer(head)) is not None:
        return InputError(path, pointer)
    if (kind := kind_of_file(head, path.suffix)) is not None:
        return InputError(path, f"{kind} (expected a recording: {wanted})")
    if (odd := odd_table(head)) is not None:
        return InputError(path, odd)
    if is_binary(head):
        return InputError(path, f"a binary file of no known kind; expected a recording ({wanted})")
    header = table_header(head)
    cells = list(header.names)
    if len(cells) < 2:
        return InputError(path, f"line 1: not a recording; expected one of {wanted}")
    if all(number_of(c) is not None for c in cells if c):
        return InputError(path, f"line 1: {len(cells)} columns of numbers without names; expected a header (of a joint log: "
                                "time, goal.J and position.J of each joint J in degrees; of a Motive export: its own)")
    columns = list_names([c[:40] for c in cells], _SHOWN)
    text = f"line {header.lines}: not a recording; columns {columns}; expected " \
           f"time [s], goal.J and position.J [deg] of each joint J of a joint log, or one of {wanted}"
    return InputError(path, text + _hint([_column(c) for c in cells]))


def _column(name: str) -> _Column:
    found = _UNIT.search(name)
    if found is None or found.start() == 0:
        return _Column(name, name, "")
    return _Column(name, name[:found.start()].strip(), (found.group(1) or found.group(2)).lower())


def joint_columns(names: Sequence[str]) -> bool:
    """Whether a table's columns are, by other names, goals and positions of joints, or angles and torques: no motion."""
    columns = [_column(name) for name in names]
    if long_table(names):
        return True
    if _pairs(columns) or _bare_pair(columns):
        return True
    torques = [c for c in columns if re.fullmatch(r"(?i)(.*[._/ ])?(tau|torque|effort)([._/ \[].*)?", c.plain)]
    return bool(torques) and "time" in names


def _hint(columns: list[_Column]) -> str:
    """How to turn the columns into a joint log or a motion; empty if they are neither."""
    time = next((c for c in columns if _TIME.fullmatch(c.plain)), None)
    renames = _pairs(columns) or _bare_pair(columns)
    unit = next((c.unit for c in columns if c.unit.startswith(("rad", "deg", "count", "tick"))), "")
    into = ", and turn radians into degrees" if unit.startswith("rad") else \
        ", and turn counts into degrees" if unit.startswith(("count", "tick")) else ""
    if renames:
        if time is not None and time.called != "time":
            renames.insert(0, (time.called, "time"))
        shown = ", ".join(f"{a[:40]} to {b[:50]}" for a, b in renames[:3])
        rest = f" and so on ({len(renames) - 3} more)" if len(renames) > 3 else ""
        return f"; rename {shown}{rest}, in seconds and degrees{into}"
    others = [c for c in columns if c is not time and c.plain and not _OTHER.fullmatch(c.plain)]
    if time is None or not others or any(_kind_of(c) == "goal" for c in others):
        return ""
    joints = ", ".join(_joint_of(c)[:30] for c in others[:3])
    more = " and so on" if len(others) > 3 else ""
    return ("; a column for each joint and no goals is nearly a motion table: to play it as a motion, rename them to time, "
            f"{joints}{more}, poses in degrees{into}; as a recording it lacks the goals")


def _kind_of(column: _Column) -> str | None:
    return next((kind for kind, pattern in _NAMED if pattern.fullmatch(column.plain)), None) \
        or next((kind for kind, pattern in _BARE.items() if pattern.fullmatch(column.plain)), None)


def _joint_of(column: _Column) -> str:
    for _, pattern in _NAMED:
        if (found := pattern.fullmatch(column.plain)) is not None:
            return _plain(found.group(1))
    return column.plain


def _plain(joint: str) -> str:
    return joint.replace("/", "_").strip("_ .")


def _pairs(columns: list[_Column]) -> list[tuple[str, str]]:
    """New names for the columns of joints that have both a goal and a position."""
    found: dict[str, dict[str, _Column]] = {}
    for column in columns:
        for kind, pattern in _NAMED:
            if (match := pattern.fullmatch(column.plain)) is not None:
                found.setdefault(_plain(match.group(1)), {}).setdefault(kind, column)
                break
    whole = {joint: kinds for joint, kinds in found.items() if {"goal", "position"} <= set(kinds)}
    return [(c.called, f"{kind}.{joint}") for joint, kinds in whole.items() for kind, c in kinds.items()
            if c.called != f"{kind}.{joint}"]


def _bare_pair(columns: list[_Column]) -> list[tuple[str, str]]:
    """New names for the single goal and the single position of a log that names no joint."""
    found = {kind: [c for c in columns if pattern.fullmatch(c.plain)] for kind, pattern in _BARE.items()}
    if any(len(of) != 1 for of in found.values()):
        return []
    return [(of[0].called, f"{kind}.J (J is the joint's name)" if kind == "goal" else f"{kind}.J") for kind, of in found.items()]
