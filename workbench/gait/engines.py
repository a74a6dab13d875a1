"""Another engine in which a certified table is played, if one is installed."""

from __future__ import annotations

from importlib.metadata import entry_points

from workbench.gait.certify import OtherEngine

ENTRY_POINT_GROUP = "workbench.engines"
"""Entry points of this group name functions that play commands for so many seconds on a robot and give the take."""


def other_engine() -> tuple[str, OtherEngine] | None:
    """The first engine that can be loaded, with its name; None where none is installed, or its requirements are missing."""
    for entry in sorted(entry_points(group=ENTRY_POINT_GROUP), key=lambda e: e.name):
        try:
            engine: OtherEngine = entry.load()
        except ModuleNotFoundError:
            continue
        return entry.name, engine
    return None
