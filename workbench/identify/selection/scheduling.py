"""Scheduling of candidates: which are evaluated on which takes, the likely ones first."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.compare.channels import BODY, joint_of
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.parameters import Candidate
from workbench.identify.problem import channel_gaps
from workbench.identify.proposals import heavy_links
from workbench.identify.selection.options import SCHEDULING


def groups_to_try(search: Search, pool: Sequence[Candidate], current: Fit, beyond: dict[str, float], takes: tuple[int, ...],
            tier: int) -> tuple[list[list[Candidate]], dict[int, tuple[int, ...]]]:
    """Groups to try, and the takes for each: effects of joints at the joints with a gap, on a fixed base all joints at once,
    since on the ground one bad joint moves all; others one by one. tier: likely effects come first, to limit the work."""
    worst = max((s for c, s in beyond.items() if c not in BODY), default=0.0)
    joints = {joint_of(c) for c, s in beyond.items() if c not in BODY and s >= SCHEDULING.ill * worst}
    floating_base = search.floating_base(takes)
    many = len(joints) > SCHEDULING.few
    moves_all = bool(floating_base) and (many or any(c in BODY for c in beyond))
    well, ill = well_on_fixed_base(search, current)
    outstanding = standing_out(search, current, takes)

    stand = _Stand(search, well, ill, heavy_links(search.nominal))
    zeroed = all(search.evaluator.evidence[i].take.recorded.zeroed for i in takes)
    used = {c.key for c in current.effects}
    groups: dict[object, list[Candidate]] = {}
    for c in pool:
        likely = _tier(c, bool(floating_base), many, stand.heavy, outstanding, stand.carried_by(c) in well)
        if c.key in used or _is_covered(c, current.effects) or likely != tier:
            continue
        if c.effect.layer == "measurement":
            groups[c.key] = [c]
        elif c.joint is not None:
            if c.effect.hidden_by_zeroing:
                if moves_all or (c.joint in joints and (floating_base or not zeroed)):
                    groups[c.key] = [c]
            elif c.joint in joints and not (floating_base and stand.shows(c)):
                groups.setdefault(c.key if c.read_off or floating_base else (c.name, "joint"), []).append(c)
        elif (not stand.shows(c)) if floating_base else _could_show(search, c, joints):
            groups[c.key] = [c]

    return list(groups.values()), {n: search.telling(group, takes) for n, group in enumerate(groups.values())}


@dataclass(frozen=True)
class _Stand:
    """What fixed-base takes showed: joints that went as the model has it, those that did not; heavy: links that are."""

    search: Search
    well: Collection[str]
    ill: Collection[str]
    heavy: Sequence[str]

    def shows(self, c: Candidate) -> bool:
        """Whether an effect would be observable there: servo effects at any load, and masses on their links; not a stop that
        is not reached there, nor a loose mount that gravity holds on one side (these are estimated directly); nor a load of a
        heavy link along its axis."""
        if c.read_off:
            return False
        if c.effect.layer == "inertia":
            return c.where[0] not in self.heavy and self.carried_by(c) in self.well
        if c.effect.under_load or c.effect.hidden_by_zeroing or c.effect.layer == "ground":
            return False
        if not c.where:
            return bool(self.well) and not self.ill
        return c.joint in self.well

    def carried_by(self, c: Candidate) -> str | None:
        """The joint that carries the link of a mass."""
        return self.search.nominal.kinematics.joint_of(c.where[0]) if c.effect.layer == "inertia" else None


def _is_covered(c: Candidate, there: Sequence[Candidate]) -> bool:
    """Whether an effect that is there has a candidate's freedom, or pulls the base as it would."""
    return any((c.where == e.where and c.name in e.effect.includes) or (c.effect.steady_pull and e.effect.steady_pull)
               for e in there)


def standing_out(search: Search, current: Fit, takes: tuple[int, ...]) -> set[str]:
    """Joints that err far more than all else on some take on the ground."""
    out: set[str] = set()
    for i in search.floating_base(takes):
        beyond: dict[str, float] = {}
        for channel, size in channel_gaps(search.evaluator.evidence[i], current.residuals[i]).items():
            beyond[joint_of(channel)] = max(beyond.get(joint_of(channel), 0.0), size**2 - 1)
        *others, worst = sorted(beyond.items(), key=lambda b: b[1]) or [("", 0.0)]
        if worst[0] in search.nominal.joints and worst[1] > SCHEDULING.stands_out * max((b for _, b in others), default=0.0):
            out.add(worst[0])
    return out


def well_on_fixed_base(search: Search, current: Fit) -> tuple[set[str], set[str]]:
    """Joints that moved while the base was fixed and went as the model has it; those that did not go so."""
    evidence = search.evaluator.evidence
    ill = {joint_of(c) for i in search.fixed_base for c in channel_gaps(evidence[i], current.residuals[i])}
    moved = {j for i in search.fixed_base for j in evidence[i].joints
             if np.nanmax(np.abs(evidence[i].recorded[:, evidence[i].channels.index(j)]), initial=0.0) > SCHEDULING.moved}
    return moved - ill, ill


def _tier(c: Candidate, floating_base: bool, many: bool, heavy: Sequence[str], outstanding: Collection[str], well: bool) -> int:
    """The order of trials. First direct estimates: camera frames, stops, loose mounts. On a fixed base: the whole robot, if many
    joints have a gap; then joints; then links. On the ground: joints that stand out and their feet; effects of the whole robot
    with one parameter; positions of feet; effects with several parameters, which need a search around the current model; links
    whose joint has no gap except about its own axis; then joints and loads on links."""
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
    """Whether an effect could make these joints err on a fixed base, and no others: one of the whole robot errs in several,
    one of a link in the joints that carry it, the floor in none."""
    if not c.effect.observable_when_fixed:
        return False
    k = search.nominal.kinematics
    if not c.where:
        return len(joints) > 1 or len(search.nominal.joints) < 3
    carrying = {k.joint_of(link) for link in (*k.ancestors(c.where[0]), c.where[0])}
    return bool(carrying & joints)
