"""Names of the puppy that stay the same everywhere (thesis, chapters 3.1 and 5)."""

from __future__ import annotations

from types import MappingProxyType

JOINTS: tuple[str, ...] = (
    "blb", "blm", "blt", "brb", "brm", "brt", "flb", "flm", "flt", "frb", "frm", "frt", "head", "neck", "tail",
)
"""The thesis's alphabetical order, of every table that has columns without a header."""

HIGHEST_ID = MappingProxyType({1: 253, 2: 252})
"""Highest ID of a servo by its protocol: 254 addresses all servos of a bus at once, and protocol 2 reserves 253 and 255, too."""
HIGHEST_BUS_ID = max(HIGHEST_ID.values())
"""Of a servo of any protocol."""
BUS_IDS = MappingProxyType(
    dict(zip(JOINTS, (15, 13, 11, 14, 12, 10, 9, 7, 5, 8, 6, 4, 17, 16, 1)))
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
