"""Checks the axes and lengths of a capture against the robot: export settings can change them without a word in the header."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np

from workbench.recording.mocap.tracks import Tracks, capture_axes, model_axes
from workbench.robot import RobotModel
from workbench.types import Array

_FIRST = 10  # frames that give a body's first position
_LEAST = 4  # least number of bodies
_NEAR = 0.2
"""Largest difference, in the decimal logarithm, of a ratio of lengths from a power of ten: pivots can be anywhere on their
links."""
_SHARE = 0.25
"""Least misfit with y up, as a share of the robot's size, at which z up is tried; that must leave less than twice this share of
the misfit."""

_NAMES = "XYZ"
_ODD = 0.1
"""Least misfit, as a share of the robot's size, at which mirrored or exchanged bodies are considered."""
_BETTER = 0.4
"""Largest misfit of a mirrored or exchanged arrangement, as a share of the original one's."""


def conventional(tracks: Tracks, model: RobotModel) -> Tracks:
    """Tracks in metres, with z up, in the model's axes. If the robot's links show that the file's header is wrong, this is
    corrected and reported."""
    found = _laid_out(tracks, model)
    if found is None:
        return tracks
    names, places, links = found
    problems = list(tracks.problems)
    factor = _power_of_ten(places, links)
    if factor != 1:
        problems.append(f"distances between bodies are {1 / factor:g} times those of the robot's links: the header's Length "
                        f"Units are wrong, and lengths are taken {factor:g} times as large")
    p, q = tracks.p * factor, tracks.q
    places = places * factor
    size = float(np.sqrt(np.mean(np.sum((links - links.mean(axis=0)) ** 2, axis=1))))
    as_said, turned_up = _misfit(places, links), _misfit(_z_up(places), links)
    if as_said > _SHARE * size and turned_up < 2 * _SHARE * as_said:
        problems.append("heights and links say that z is up in this export, not y; turned")
        p, q = _z_up(p), np.concatenate([q[..., :1], _z_up(q[..., 1:])], axis=-1)
    elif as_said > _ODD * size and (text := _arrangement(names, places, links)) is not None:
        problems.append(text)
    return replace(tracks, p=p, q=q, problems=tuple(problems)) if problems != list(tracks.problems) else tracks


def layout_yaw(tracks: Tracks, model: RobotModel) -> float | None:
    """The yaw [rad] of the robot's first heading in the capture's axes, from its bodies' first positions, to a few degrees; None
    if the bodies are too few or lie above each other."""
    found = _laid_out(tracks, model)
    if found is None:
        return None
    places, links = (p - p.mean(axis=0) for p in found[1:])
    spread = float(np.sqrt(np.mean(np.sum(links[:, :2] ** 2, axis=1))))
    return -_turn(places, links) if spread > 0.02 else None


def _arrangement(names: Sequence[str], places: Array, links: Array) -> str | None:
    """A line if first positions (A, 3) fit the links (A, 3) far better when mirrored, with two bodies exchanged, or with their
    columns in another order."""
    now = _misfit(places, links)
    mirrored = _misfit(places * np.array([1.0, -1.0, 1.0]), links)
    pairs = {}
    for a, b in combinations(range(len(places)), 2):
        order = np.arange(len(places))
        order[[a, b]] = b, a
        pairs[a, b] = _misfit(places[order], links)
    (a, b), exchanged = min(pairs.items(), key=lambda pair: pair[1])
    in_file = capture_axes(places)
    orders = {order: _misfit(model_axes(in_file[:, [order.index(name) for name in _NAMES]]), links)
              for order in map("".join, permutations(_NAMES)) if order != _NAMES}
    held, moved = min(orders.items(), key=lambda pair: pair[1])
    if min(mirrored, exchanged, moved) > _BETTER * now:
        return None
    if moved < _BETTER * min(mirrored, exchanged):
        return (f"the bodies' first places fit the robot's links if the file's X,Y,Z hold {','.join(held)}: are the columns of "
                "the positions exchanged?")
    if mirrored <= exchanged:
        return ("the bodies' first places are the mirror image of the robot's links: are the capture's axes left-handed, or are "
                "all bodies of the left and the right exchanged? Export again with right-handed axes, or correct `rigid_bodies`")
    return (f"bodies '{names[a]}' and '{names[b]}' begin in each other's places: are their names exchanged? Correct "
            "`rigid_bodies` in the session, or the names in the capture")


def _laid_out(tracks: Tracks, model: RobotModel) -> tuple[tuple[str, ...], Array, Array] | None:
    """Names of bodies (A), their first positions, and their links' centres of mass in the neutral pose, (A, 3) each; None if
    there are too few."""
    at = _first_places(tracks)
    if len(at) < _LEAST or any(tracks.assets[i] not in model.rigid_bodies for i in at):
        return None
    poses = model.kinematics.forward(np.zeros((1, len(model.joints))))
    nominal = []
    for i in at:
        link = model.rigid_bodies[tracks.assets[i]]
        if link not in poses:
            return None
        p, R = poses[link]
        nominal.append(p[0] + R[0] @ model.kinematics.centers.get(link, np.zeros(3)))
    return tuple(tracks.assets[i] for i in at), np.array(list(at.values())), np.array(nominal)


def _turn(a: Array, b: Array) -> float:
    """Angle about z [rad] that best aligns centred positions a (A, 3) with b."""
    cosine, sine = float(np.sum(a[:, :2] * b[:, :2])), float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    return float(np.arctan2(sine, cosine))


def _first_places(tracks: Tracks) -> dict[int, Array]:
    out = {}
    for i in range(len(tracks.assets)):
        rows = np.flatnonzero(tracks.seen[i])[:_FIRST]
        if len(rows):
            out[i] = np.median(tracks.p[i, rows], axis=0)
    return out


def _z_up(v: Array) -> Array:
    """(..., 3) of x, -z, y of the capture's x, y, z as x, y, z."""
    return np.stack([v[..., 0], v[..., 2], -v[..., 1]], axis=-1)


def _power_of_ten(places: Array, links: Array) -> float:
    """Factor by which distances between positions (A, 3) must be multiplied to match those of links (A, 3); 1 unless it is near a
    power of ten."""
    pairs = [(np.linalg.norm(places[a] - places[b]), np.linalg.norm(links[a] - links[b]))
             for a, b in combinations(range(len(places)), 2)]
    ratios = [d / nominal for d, nominal in pairs if nominal > 0.02 and d > 0]
    if len(ratios) < _LEAST:
        return 1.0
    exponent = float(np.log10(np.median(ratios)))
    nearest = round(exponent)
    return 10.0 ** -nearest if nearest and abs(exponent - nearest) < _NEAR else 1.0


def _misfit(places: Array, links: Array) -> float:
    """RMS distance [m] of positions from links (A, 3), after alignment by a shift and a turn about z."""
    a, b = places - places.mean(axis=0), links - links.mean(axis=0)
    yaw = _turn(a, b)
    c, s = np.cos(yaw), np.sin(yaw)
    turned = np.column_stack([c * a[:, 0] - s * a[:, 1], s * a[:, 0] + c * a[:, 1], a[:, 2]])
    return float(np.sqrt(np.mean(np.sum((turned - b) ** 2, axis=1))))
