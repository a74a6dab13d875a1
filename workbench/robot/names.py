"""Names of the puppy that stay the same everywhere (thesis, chapters 3.1 and 5)."""

from __future__ import annotations

from types import MappingProxyType

JOINTS: tuple[str, ...] = tuple("blb blm blt brb brm brt flb flm flt frb frm frt head neck tail".split())
"""The thesis's alphabetical order, of every table that has columns without a header."""

BUS_IDS = MappingProxyType(
    dict(blb=15, blm=13, blt=11, brb=14, brm=12, brt=10, flb=9, flm=7, flt=5, frb=8, frm=6, frt=4, head=17, neck=16, tail=1)
)

RIGID_BODIES = MappingProxyType(
    {"body": "body_link", "tail": "tail_link"}
    | {
        f"{side}{part}": f"{side.lower()}{part[0]}_link"
        for side in ("BL", "BR", "FL", "FR")
        for part in ("btm", "mid", "top")
    }
)
"""Motive asset -> link. Neck and head were not tracked."""

FEET: tuple[str, ...] = ("blb", "brb", "flb", "frb")
"""A foot is named by its knee's joint."""
