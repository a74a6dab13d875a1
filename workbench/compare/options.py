"""Every number that takes are compared with: unit, meaning and reason in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CompareOptions:
    """Takes beside each other."""

    gain_span: float = 0.25
    """Span over which path and heading are compared [s]: about half a cycle of a gait."""
    lead: float = 0.3
    """Rest before the first command of each rollout [s]: what registration takes for the resting pose."""
    lift: float = 0.005
    """A foot is off the ground above this share of the height at which the base rests: 1 mm for a puppy, five times what capture
    noise makes of a foot's height (0.2 mm in the practice sessions). On simulated walks the duty factor then lies within 0.04
    above that from contact forces."""
    shortest: float = 0.03
    """Stance or swing shorter than this is chatter, not a step [s]."""


COMPARE = CompareOptions()
