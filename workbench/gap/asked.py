"""What is worth asking of which takes: effects that could make what is ill so, the likely ones first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.gap.candidates import Candidate, heavy_links
from workbench.gap.evidence import BODY, joint_of
from workbench.gap.ledger import channel_gaps
from workbench.gap.search import SEEN_ELSEWHERE, Fit, Search

TIERS = 3
ALIKE = 0.25
"""Joints that are this share as ill as the worst are asked about."""
FEW = 2
"""Joints that may be ill on the ground, with the body as the model has it, without anything but these being asked about."""
MOVED = 0.1
"""Angle [rad] beyond which a joint has moved enough to show what it lacks."""


def asked(search: Search, pool: Sequence[Candidate], current: Fit, beyond: dict[str, float], takes: tuple[int, ...],
            held: tuple[int, ...], tier: int) -> tuple[list[list[Candidate]], dict[int, tuple[int, ...]]]:
    """Groups to try, and on which takes each: effects of joints at the joints with a gap, with the base held all joints at once,
    as on the ground one bad joint moves all; others one by one. tier: what is likely comes first, as there is so much."""
    worst = max((s for c, s in beyond.items() if c not in BODY), default=0.0)
    joints = {joint_of(c) for c, s in beyond.items() if c not in BODY and (s >= ALIKE * worst)}
    grounded = tuple(i for i in takes if i not in held)
    moves_all = bool(grounded) and (len(joints) > FEW or any(c in BODY for c in beyond))
    well, ill = _when_held(search, current, held)

    def settled(c: Candidate) -> bool:
        """What servos lack at any load, and what hangs on their links, would show with the base held, too."""
        if c.effect.layer == "inertia":
            carrying = search.nominal.kinematics.joint_of(c.where[0])
            return carrying in well
        if c.effect.under_load or c.name in SEEN_ELSEWHERE or (c.where and c.joint is None) or c.effect.layer == "ground":
            return False
        return c.joint in well if c.joint else bool(well) and not ill

    used, heavy = {c.key for c in current.effects}, heavy_links(search.nominal)
    groups: dict[object, list[Candidate]] = {}
    on: list[tuple[int, ...]] = []
    for c in pool:
        if c.name == "com_shift" and ("payload", c.where) in used:
            continue  # a point mass has that freedom
        if c.key in used or _tier(c, bool(grounded), heavy) != tier:
            continue
        if c.effect.layer == "measurement":
            groups[c.key] = [c]
        elif c.joint is not None:
            if c.name in SEEN_ELSEWHERE:
                if moves_all or (grounded and c.joint in joints):
                    groups[c.key] = [c]
            elif c.joint in joints and not (grounded and settled(c)):
                groups.setdefault(c.key if c.read_off or grounded else (c.name, "joint"), []).append(c)
        elif c.effect.layer == "ground" and c.name != "ground_tilt" and not grounded:
            continue
        elif (grounded and not settled(c)) or (not grounded and _could_show(search, c, joints)):
            groups[c.key] = [c]
    for group in groups.values():
        c = group[0]
        alone = grounded and (c.effect.layer in ("ground", "inertia") or c.name in ("zero_offset", "link_length"))
        on.append(grounded if alone or (c.joint and grounded) else takes)
    return list(groups.values()), dict(enumerate(on))


def _when_held(search: Search, current: Fit, held: tuple[int, ...]) -> tuple[set[str], set[str]]:
    """Joints that moved while the base was held and went as the model has it; those that did not go so."""
    evidence = search.jury.evidence
    ill = {joint_of(c) for i in held for c in channel_gaps(evidence[i], current.residuals[i])}
    moved = {j for i in held for j in evidence[i].joints
             if np.nanmax(np.abs(evidence[i].recorded[:, evidence[i].channels.index(j)]), initial=0.0) > MOVED}
    return moved - ill, ill


def _tier(c: Candidate, grounded: bool, heavy: Sequence[str]) -> int:
    """With the base held, joints and the whole robot come first, then links. On the ground,
    what moves the robot as a whole, then joints, then zero offsets and what is in lighter links."""
    if not grounded:
        return 1 if "link" in c.effect.places else 0
    if c.name == "link_length" or (c.name == "payload" and c.where[0] not in heavy):
        return 2
    if c.name in SEEN_ELSEWHERE:
        return 2
    return 1 if c.joint is not None else 0


def _could_show(search: Search, c: Candidate, joints: set[str]) -> bool:
    """Whether an effect could make these joints err and no others, or with the base held: one of the whole robot errs in several,
    one of a link in the joints that carry it, the floor in none."""
    if c.effect.layer == "ground" and c.name != "ground_tilt":
        return False
    k = search.nominal.kinematics
    if not c.where:
        return len(joints) > 1 or len(search.nominal.joints) < 3
    carrying = {k.joint_of(link) for link in (*k.ancestors(c.where[0]), c.where[0])}
    return bool(carrying & joints)
