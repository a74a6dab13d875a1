"""Problems of a file: text with a kind."""

from __future__ import annotations


class RoutineProblem(str):
    """A problem that most recordings have, such as gaps in motion capture: `inspect` lists it, other verbs do not warn."""

    __slots__ = ()
