"""Scheduling of candidates: which are evaluated on which takes, the likely ones first."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from workbench.compare.channels import BODY, joint_of
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.parameters import Candidate
from workbench.identify.problem import channel_gaps
from workbench.identify.proposals import heavy_links

TIERS, TIERS_OF_ALL = 8, 6
"""On the ground the first are what moves the robot as a whole, and joints that stand out."""
LONE = 2
"""The last tier of a lone joint that is held: its links move nothing else, and what they carry looks like what it lacks."""
STANDS_OUT = 4.0
"""Times the next worst of what is beyond noise on a take on the ground, of chi squared, that a joint's own is from which on it
lacks something, not the robot as a whole."""
ILL = 0.25
"""Joints whose gap is this share of the worst joint's are asked about."""
FEW = 2
"""Joints that may be ill without the robot as a whole being asked about before them and, on the ground, with the body as the
model has it, without zero offsets of others being asked about."""
MOVED = 0.1
"""Angle [rad] beyond which a joint has moved enough to show what it lacks."""


def asked(search: Search, pool: Sequence[Candidate], current: Fit, beyond: dict[str, float], takes: tuple[int, ...],
            tier: int) -> tuple[list[list[Candidate]], dict[int, tuple[int, ...]]]:
    """Groups to try, and on which takes each: effects of joints at the joints with a gap, with the base held all joints at once,
    as on the ground one bad joint moves all; others one by one. tier: what is likely comes first, as there is so much."""
    worst = max((s for c, s in beyond.items() if c not in BODY), default=0.0)
    joints = {joint_of(c) for c, s in beyond.items() if c not in BODY and s >= ILL * worst}
    floating_base = search.floating_base(takes)
    many = len(joints) > FEW
    moves_all = bool(floating_base) and (many or any(c in BODY for c in beyond))
    well, ill = _when_held(search, current)
    outstanding = standing_out(search, current, takes)

    def settled(c: Candidate) -> bool:
        """What servos lack at any load, and what hangs on their links, would show with the base held, too; not a stop that is not
        reached there, nor a loose mount that gravity leaves on one side: these were read off the recordings; nor what a heavy
        link carries on its axis."""
        if c.read_off:
            return False
        if c.effect.layer == "inertia":
            return c.where[0] not in heavy and carried(c) in well
        if c.effect.under_load or c.effect.hidden_by_zeroing or c.effect.layer == "ground":
            return False
        if not c.where:
            return bool(well) and not ill
        return c.joint in well

    def carried(c: Candidate) -> str | None:
        return search.nominal.kinematics.joint_of(c.where[0]) if c.effect.layer == "inertia" else None

    zeroed = all(search.evaluator.evidence[i].take.recorded.zeroed for i in takes)
    used, heavy = {c.key for c in current.effects}, heavy_links(search.nominal)
    single_joint = search.single_joint and not floating_base
    groups: dict[object, list[Candidate]] = {}
    for c in pool:
        if any(c.where == e.where and c.name in e.effect.includes for e in current.effects):
            continue
        if c.effect.steady_pull and any(e.effect.steady_pull for e in current.effects):
            continue
        likely = _tier(c, bool(floating_base), many, heavy, outstanding, carried(c) in well)
        if c.key in used or (min(likely, LONE) if single_joint else likely) != tier:
            continue
        if c.effect.layer == "measurement":
            groups[c.key] = [c]
        elif c.joint is not None:
            if c.effect.hidden_by_zeroing:
                if moves_all or (c.joint in joints and (floating_base or not zeroed)):
                    groups[c.key] = [c]
            elif c.joint in joints and not (floating_base and settled(c)):
                groups.setdefault(c.key if c.read_off or floating_base else (c.name, "joint"), []).append(c)
        elif (not settled(c)) if floating_base else _could_show(search, c, joints):
            groups[c.key] = [c]

    return list(groups.values()), {n: search.telling(group, takes) for n, group in enumerate(groups.values())}


def standing_out(search: Search, current: Fit, takes: tuple[int, ...]) -> set[str]:
    """Joints that err far more than all else on some take on the ground."""
    out: set[str] = set()
    for i in search.floating_base(takes):
        beyond: dict[str, float] = {}
        for channel, size in channel_gaps(search.evaluator.evidence[i], current.residuals[i]).items():
            beyond[joint_of(channel)] = max(beyond.get(joint_of(channel), 0.0), size**2 - 1)
        *others, worst = sorted(beyond.items(), key=lambda b: b[1]) or [("", 0.0)]
        if worst[0] in search.nominal.joints and worst[1] > STANDS_OUT * max((b for _, b in others), default=0.0):
            out.add(worst[0])
    return out


def _when_held(search: Search, current: Fit) -> tuple[set[str], set[str]]:
    """Joints that moved while the base was held and went as the model has it; those that did not go so."""
    evidence = search.evaluator.evidence
    ill = {joint_of(c) for i in search.held for c in channel_gaps(evidence[i], current.residuals[i])}
    moved = {j for i in search.held for j in evidence[i].joints
             if np.nanmax(np.abs(evidence[i].recorded[:, evidence[i].channels.index(j)]), initial=0.0) > MOVED}
    return moved - ill, ill


def _tier(c: Candidate, floating_base: bool, many: bool, heavy: Sequence[str], outstanding: Collection[str], well: bool) -> int:
    """First what was read off: how cameras saw the robot, stops, loose mounts. With the base held, the whole robot, if many
    joints are ill, joints, links. On the ground, joints that stand out and their feet, what moves the robot as a whole by one
    number, by where feet stand, by several (for which a walk has to be looked at all around), of links that their joint carried
    well in all axes but its own last, then joints, what links carry."""
    if c.effect.layer == "measurement" or c.read_off:
        return 0
    if not floating_base:
        if not c.where:
            return 1 if many else 2
        return 2 if c.joint is not None else 3
    if c.effect.moves_feet:
        return 3  # feet stand elsewhere: much like a centre of mass that does
    if c.effect.point_mass and c.where[0] not in heavy:
        return 7
    if c.where and c.where[0] in outstanding:
        return 1
    if c.joint is not None:
        return 6
    if c.size > 1:
        return 5 if well else 4
    return 2


def _could_show(search: Search, c: Candidate, joints: set[str]) -> bool:
    """Whether an effect could make these joints err with the base held, and no others: one of the whole robot errs in several,
    one of a link in the joints that carry it, the floor in none."""
    if not c.effect.observable_when_fixed:
        return False
    k = search.nominal.kinematics
    if not c.where:
        return len(joints) > 1 or len(search.nominal.joints) < 3
    carrying = {k.joint_of(link) for link in (*k.ancestors(c.where[0]), c.where[0])}
    return bool(carrying & joints)
