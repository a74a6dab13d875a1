"""Candidates that no search from neutral finds, read off the recordings: stops, loose mounts, turned marker frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from workbench.compare.channels import ACROSS
from workbench.effects.base import Effect
from workbench.effects.registry import estimated_by
from workbench.identify.options import READ_OFF
from workbench.identify.parameters import Candidate
from workbench.identify.problem import TakeEvidence, channel_gaps, smoothed
from workbench.robot import RobotModel

Array = NDArray[np.float64]


def read_off_candidates(model: RobotModel, evidence: Sequence[TakeEvidence], residuals: Mapping[int, Array]) -> list[Candidate]:
    """Those that these takes suggest; residuals: of the nominal robot, by take."""
    ill = [channel_gaps(e, residuals[i]) for i, e in enumerate(evidence)]
    out: list[Candidate] = []
    for joint in dict.fromkeys(j for e in evidence for j in e.joints):
        for stop in estimated_by("end of travel"):
            out += stops(stop, joint, evidence, residuals)
        for mount in estimated_by("play across the axis"):
            out += _mount(mount, joint, model, evidence, residuals, ill)
    return out + [c for turned in estimated_by("turn of an asset at rest") for c in _frames(turned, model, evidence)]


def stops(stop: Effect, joint: str, evidence: Sequence[TakeEvidence], residuals: Mapping[int, Array]) -> list[Candidate]:
    """A stop at either side where the recording stands at its end while the model goes on."""
    ends: dict[int, list[tuple[float, float]]] = {1: [], -1: []}
    went: dict[int, float] = {1: -np.inf, -1: -np.inf}
    for i, e in enumerate(evidence):
        if joint not in e.joints:
            continue
        column = e.joints.index(joint)
        seen = e.recorded[:, column]
        said = seen - residuals[i][:, column] * e.sigma[column]
        rest = e.zero(joint)
        for side in ends:
            mean = smoothed(seen[:, None], 5)[:, 0] / np.sqrt(5) * side
            good = np.isfinite(mean) & np.isfinite(said)
            if good.sum() < 20:
                continue
            end = float(np.quantile(mean[good], 0.995))
            went[side] = max(went[side], end + rest * side)
            beyond = good & (said * side > end + READ_OFF.least_cut / 3)
            if float(np.max(said[good] * side)) - end > READ_OFF.least_cut and beyond.sum() > 5 \
                    and float(np.median(end - mean[beyond])) < READ_OFF.at_stop \
                    and float(np.nanmax(((said - seen) * side)[beyond])) > READ_OFF.least_cut:
                ends[side].append((end + rest * side, float(np.max(said[good] * side)) + rest * side))
    found = {side: (min(e for e, _ in limits), max(m for _, m in limits)) for side, limits in ends.items() if limits}
    # what it passed is no stop
    found = {side: limits for side, limits in found.items() if went[side] - limits[0] < READ_OFF.least_cut}
    if not found:
        return []
    far = [stop.parameters[0].low, stop.parameters[1].high]
    neutral, typical, fixed = list(far), list(far), [True, True]
    for side, (end, reach) in found.items():
        k = 1 if side > 0 else 0
        neutral[k], typical[k], fixed[k] = float(np.rad2deg(reach)) * side, float(np.rad2deg(end)) * side, False
    # its ends do not change sides
    apart = sum(found[side][1] if side in found else went[side] for side in ends) / len(found)
    furthest = min(apart - READ_OFF.least_cut, READ_OFF.furthest_stop * max(reach - end for end, reach in found.values()))
    return [replace(Candidate.of(stop, (joint,), neutral, typical, fixed), reach=float(np.rad2deg(furthest)))]


def _mount(mount: Effect, joint: str, model: RobotModel, evidence: Sequence[TakeEvidence], residuals: Mapping[int, Array],
           ill: Sequence[Mapping[str, float]]) -> list[Candidate]:
    """A loose mount where the link turns across its servo's axis: about the link's axis along which it does so most, as far as
    that."""
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
    along = (off - off.mean(axis=0)) @ axis
    play = float(np.rad2deg(max(np.ptp(np.quantile(along, [0.05, 0.95])) - 2 * sigma, 0.5 * sigma)))
    in_link = neutral[frame.child][1][0].T @ axis
    in_link = in_link * np.sign(in_link[np.argmax(np.abs(in_link))])
    return [Candidate.of(mount, (joint,), (0.0, *in_link), (play, *in_link), (False, True, True, True))]


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
