"""Curves of a take's joints in a page, with a cursor and zoom: small, drawn by a script inside the page."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from workbench.compare.comparison import align
from workbench.recording.take import Take
from workbench.types import Array
from workbench.view.playback import since_start

_ROWS = 1500
"""Maximum number of rows drawn per take; longer takes are thinned."""


@dataclass(frozen=True)
class Curves:
    """Command, measured and simulated angle of one joint at a time, chosen from a list, and their difference. joints: in the
    order of the list. caption: a sentence below."""

    simulated: Take
    recorded: Take
    joints: Sequence[str]
    caption: str = ""


def curves_html(curves: Curves) -> str:
    """The figure; the page must hold assets/curves.js."""
    recorded = curves.recorded
    simulated = align(curves.simulated, recorded)
    time = since_start(recorded)
    rows = slice(None, None, -(-len(time) // _ROWS))
    content: dict[str, object] = {"time": [round(float(t), 4) for t in time[rows]]}
    angles, errors = {}, {}
    for joint in curves.joints:
        q = {"measured": recorded.q[:, recorded.column(joint)], "simulated": simulated.q[:, simulated.column(joint)]}
        if (command := _command(recorded, joint, time)) is not None:
            q = {"command": command, **q}
        angles[joint] = {name: _numbers(values[rows]) for name, values in q.items()}
        errors[joint] = _numbers((q["simulated"] - q["measured"])[rows])
    packed = json.dumps(content | {"joints": angles, "errors": errors}, separators=(",", ":")).replace("<", "\\u003c")
    names = "".join(f"<option>{escape(j)}</option>" for j in curves.joints)
    keys = "".join(f'<span class="key {name}">{name}</span>' for name in next(iter(angles.values())))
    buttons = "".join(f'<button type="button" data-do="{do}" title="{title}">{sign}</button>' for do, title, sign in (
        ("in", "zoom in", "+"), ("out", "zoom out", "&minus;"), ("all", "show all", "all")))
    return (f'<figure class="curves"><div class="controls"><label>joint <select>{names}</select></label>{keys}{buttons}</div>'
            f'<canvas role="img" aria-label="{escape(curves.caption)}"></canvas><output></output>'
            f'<script type="application/json">{packed}</script><figcaption>{escape(curves.caption)}</figcaption></figure>')


def _numbers(radians: Array) -> list[float | None]:
    """In degrees to a thousandth; None for a gap."""
    return [None if not np.isfinite(v) else round(float(v), 3) for v in np.rad2deg(radians)]


def _command(take: Take, joint: str, time: Array) -> Array | None:
    """The goal (N,) [rad] that holds at each time since the first command (N,) [s]; None where the take has no commands."""
    sent = take.commands
    if sent is None or joint not in sent.joints or not len(sent.times):
        return None
    at = np.searchsorted(sent.times, time + 1e-9, side="right") - 1
    goals = sent.goals[:, sent.joints.index(joint)]
    return np.where(at >= 0, goals[np.maximum(at, 0)], np.nan)
