"""Physics hidden in the robot: this engine's own implementation of the effects of docs/formats.md, section 7, and of some beyond
it.

Written from the contract's words alone; no code of the workbench's effects, station or servo law is used, only `EffectSpec`, so
that a diagnosis which finds these effects has not found its own formulas. Details that the words leave open are decided in the
functions' docstrings.
"""

from studies.other_engine.hidden.apply import KNOWN, OUTSIDE, VOCABULARY, Hidden, hide, turned_frames

__all__ = ["KNOWN", "OUTSIDE", "VOCABULARY", "Hidden", "hide", "turned_frames"]
