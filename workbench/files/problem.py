"""Problems of a file: text with a kind."""

from __future__ import annotations


class RoutineProblem(str):
    """A problem that most recordings have, such as gaps in motion capture: `inspect` lists it, other verbs do not warn."""

    __slots__ = ()


class CorrectedProblem(str):
    """A problem that was corrected, or whose readings were excluded from the evidence: findings.json lists it as set aside."""

    __slots__ = ()


class RemovedReadings(CorrectedProblem):
    """Single readings that were removed; the others are as good as without them, so that further checks apply."""

    __slots__ = ()


def name_problem(name: str, problem: str) -> str:
    """A problem after the name of what has it, of the same kind."""
    return type(problem)(f"{name}: {problem}")
