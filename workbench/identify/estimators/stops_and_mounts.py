"""Candidates that no search from neutral finds, read off the recordings: stops, loose mounts, turned marker frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.compare.channels import ACROSS
from workbench.effects.base import Effect
from workbench.effects.registry import estimated_by
from workbench.identify.options import READ_OFF
from workbench.identify.parameters import Candidate
from workbench.identify.problem import TakeEvidence, channel_gaps, running_means
from workbench.robot import RobotModel
from workbench.types import Array


def read_off_candidates(model: RobotModel, evidence: Sequence[TakeEvidence], residuals: Mapping[int, Array]) -> list[Candidate]:
    """Those that these takes suggest; residuals: of the nominal robot, by take."""
    ill = [channel_gaps(e, residuals[i]) for i, e in enumerate(evidence)]
    out: list[Candidate] = []
    for joint in dict.fromkeys(j for e in evidence for j in e.joints):
        for stop in estimated_by("end of travel"):
            out += stops(stop, joint, evidence, residuals)
        for mount in estimated_by("play across the axis"):
            out += mounts(mount, joint, model, evidence, residuals, ill)
    return out + [c for turned in estimated_by("turn of an asset at rest") for c in _frames(turned, model, evidence)]


@dataclass(frozen=True)
class _Travel:
    """Where a take's joint ended on one side, counted as positive from its servo's centre [rad]. base: of the take; reach: how
    far the model moved while the joint was at rest there; None: it did not rest at an end."""

    base: str
    end: float
    reach: float | None


@dataclass(frozen=True)
class _Stop:
    """Counted likewise [rad]. end: where the recordings say it is; reach: how far the model went; passed: below this it cannot
    be, as some take went further."""

    end: float
    reach: float
    passed: float


def stops(stop: Effect, joint: str, evidence: Sequence[TakeEvidence], residuals: Mapping[int, Array]) -> list[Candidate]:
    """A stop on either side, where the recording rests at its end while the model moves further, and that no take passed."""
    travels = {side: [t for i, e in enumerate(evidence) if joint in e.joints
                      for t in _travel(e, e.joints.index(joint), residuals[i], side)] for side in (1, -1)}
    met = {side: _stop_met(of) for side, of in travels.items()}
    found = {side: s for side, s in met.items() if s is not None}
    if not found:
        return []
    far = [stop.parameters[0].low, stop.parameters[1].high]
    neutral, typical, fixed = list(far), list(far), [True, True]
    for side, s in found.items():
        k = 1 if side > 0 else 0
        neutral[k], typical[k], fixed[k] = float(np.rad2deg(s.reach)) * side, float(np.rad2deg(s.end)) * side, False
    # its ends do not change sides
    apart = sum(found[side].reach if side in found else max(t.end for t in travels[side]) for side in travels) / len(found)
    furthest = min(apart - READ_OFF.least_cut, max(s.reach - s.passed for s in found.values()))
    return [replace(Candidate.of(stop, (joint,), neutral, typical, fixed), reach=float(np.rad2deg(furthest)))]


def _travel(e: TakeEvidence, column: int, residual: Array, side: int) -> list[_Travel]:
    """Of the joint in this column; none where it was hardly seen."""
    seen = e.recorded[:, column]
    said = seen - residual[:, column] * e.sigma[column]
    mean = running_means(seen[:, None], 5)[:, 0] / np.sqrt(5) * side
    good = np.isfinite(mean) & np.isfinite(said)
    if good.sum() < 20:
        return []
    rest = e.zero(e.joints[column]) * side
    end, reach = float(np.quantile(mean[good], 0.995)), float(np.max(said[good] * side))
    beyond = good & (said * side > end + READ_OFF.least_cut / 3)
    stands = (reach - end > READ_OFF.least_cut and beyond.sum() > 5 and float(np.median(end - mean[beyond])) < READ_OFF.at_stop
              and float(np.nanmax(((said - seen) * side)[beyond])) > READ_OFF.least_cut)
    return [_Travel(e.take.spec.base, end + rest, reach + rest if stands else None)]


def _stop_met(travels: Sequence[_Travel]) -> _Stop | None:
    """Where some takes rest at an end that no other take passes. Takes of one base are zeroed in the same way, so that they
    differ by noise and by how hard the stop was hit; between bases the model's droop may be wrong, too."""
    met = [t for t in travels if t.reach is not None]
    if not met:
        return None
    end, alike = min(t.end for t in met), {t.base for t in met}
    passed = max(t.end - (READ_OFF.at_stop if t.base in alike else READ_OFF.least_cut) for t in travels)
    return None if passed > end else _Stop(end, max(t.reach for t in met if t.reach is not None), passed)


def mounts(mount: Effect, joint: str, model: RobotModel, evidence: Sequence[TakeEvidence], residuals: Mapping[int, Array],
           ill: Sequence[Mapping[str, float]]) -> list[Candidate]:
    """A loose mount where the link turns across its servo's axis: about the link's axis along which it does so most, by as
    far as cameras see it rock in a take: when it does is chance, so that a fit would tell too little."""
    rows, sigma = [], 1.0
    tree = model.kinematics
    neutral, frame = tree.forward(np.zeros((1, len(tree.joints)))), tree.frames[joint]
    servo = neutral[frame.parent][1][0] @ frame.axis_of_parent
    for i, e in enumerate(evidence):
        columns = [k for k, c in enumerate(e.channels) if c.startswith(joint + ACROSS)]
        if len(columns) == 2 and any(e.channels[k] in ill[i] for k in columns):
            three = np.zeros((len(e.recorded), 3))
            for k in columns:
                three[:, "xyz".index(e.channels[k][-1])] = residuals[i][:, k] * e.sigma[k]
            angle = e.recorded[:, e.channels.index(joint)]
            good = np.isfinite(three).all(axis=1) & np.isfinite(angle)
            rows.append(Rotation.from_rotvec(-angle[good, None] * servo).apply(three[good]))  # the servo carries it round
            sigma = float(e.sigma[columns[0]])
    if not rows:
        return []
    off = np.vstack(rows)
    axis = np.linalg.svd(off - off.mean(axis=0), full_matrices=False)[2][0]
    # each take by itself: one may have been zeroed at the one end, another at the other
    rocks = max(float(np.ptp(np.quantile(take @ axis, [READ_OFF.rare, 1 - READ_OFF.rare]))) for take in rows)
    play = max(rocks - READ_OFF.rocking_noise * sigma, 0.5 * sigma)
    in_link = neutral[frame.child][1][0].T @ axis
    in_link = in_link * np.sign(in_link[np.argmax(np.abs(in_link))])
    found = Candidate.of(mount, (joint,), (0.0, *in_link), (float(np.rad2deg(play)), *in_link), (True,) * 4)
    return [replace(found, spread=(float(np.rad2deg(sigma)), 0.0, 0.0, 0.0))]


def _frames(turned: Effect, model: RobotModel, evidence: Sequence[TakeEvidence]) -> list[Candidate]:
    """Assets that stand turned at rest, where all frames are parallel to the capture's axes."""
    out = []
    for asset in model.rigid_bodies:
        turns = [Rotation.from_quat(e.take.measurement.rest[asset][1], scalar_first=True).as_rotvec() for e in evidence
                 if asset in e.take.measurement.rest]
        if not turns or min(np.linalg.norm(t) for t in turns) < READ_OFF.least_asset_turn:
            continue
        turn = np.rad2deg(np.mean(turns, axis=0))
        typical = np.where(np.abs(turn) < 0.2, 1.0, turn)
        out.append(Candidate.of(turned, (asset,), (0.0, 0.0, 0.0), typical.tolist()))
    return out
