"""What is no recording that we read: which columns it has, which are wanted, and how to get there."""

from __future__ import annotations

import re
from pathlib import Path

from workbench.files import InputError
from workbench.files.numerals import number_of
from workbench.files.tables import is_binary, split_row
from workbench.recording.formats.registry import known_formats

_SHOWN = 6
"""Columns named in one line."""
_RENAMES = (
    (r"(?i)time|timestamp|t|stamp|__time|%time|secs|time[ _]?\[?\(?s\)?\]?", "time"),
    (r"(?i)(?:.*/)?(.+?)[._/](?:velocity|vel|speed)", "velocity."),
    (r"(?i)(?:action|command|cmd|target|goal|desired|reference|setpoint|ref)[._/ ](.+?)(?:[._/](?:pos|position|q))?", "goal."),
    (r"(?i)(.+?)[._/](?:goal|target|command|cmd|desired|reference|goal_position|position_cmd|pos_cmd)", "goal."),
    (r"(?i)(?:observation[._/]state|state|present|measured|actual|feedback|position|pos|q|/?joint_states)[._/ ](.+?)"
     r"(?:[._/](?:pos|position|q))?", "position."),
    (r"(?i)(.+?)[._/](?:position|pos|present_position|angle|q)", "position."),
)
"""Names that other tools give to columns of a joint log, and ours, to which the joint's name is added."""


def refusal(path: Path, head: bytes) -> InputError:
    """The error that says what a file of no known format is, and what was expected of it."""
    wanted = ", ".join(f.called for f in known_formats() if f.called)
    if is_binary(head):
        return InputError(path, f"a binary file of no known kind; expected a recording ({wanted})")
    lines = [line for line in head.decode("utf-8-sig", "replace").splitlines() if line.strip() and not line.startswith("#")]
    cells = split_row(lines[0]) if lines else []
    if len(cells) < 2:
        return InputError(path, f"line 1: not a recording; expected one of {wanted}")
    if all(number_of(c) is not None for c in cells if c):
        return InputError(path, f"line 1: {len(cells)} columns of numbers without names; expected a header (of a joint log: "
                                "time, goal.J and position.J of each joint J in degrees; of a Motive export: its own)")
    more = f" and {len(cells) - _SHOWN} more" if len(cells) > _SHOWN else ""
    text = f"line 1: not a recording; columns {', '.join(c[:40] for c in cells[:_SHOWN])}{more}; expected time [s], " \
           f"goal.J and position.J [deg] of each joint J of a joint log, or one of {wanted}"
    renames = [f"{c[:40]} to {new[:50]}" for c in cells if (new := _renamed(c)) and new != c]
    if renames:
        rest = f" and so on ({len(renames) - 3} more)" if len(renames) > 3 else ""
        text += f"; rename {', '.join(renames[:3])}{rest}, in seconds and degrees"
    return InputError(path, text)


def _renamed(name: str) -> str | None:
    for pattern, new in _RENAMES:
        found = re.fullmatch(pattern, name)
        if found:
            return new + (found.group(1).replace("/", "_").strip("_") if found.groups() else "")
    return None
