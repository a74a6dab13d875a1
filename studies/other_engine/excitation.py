"""Motions that bring a robot's physics to light: on the stand, swaying on its feet, and walking; each from a seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.types import Array


@dataclass(frozen=True)
class MotionRows:
    """A motion table: times (K,) [s], angles (K, n) [deg] by joint, zero = servo centre; the first row is its start."""

    joints: tuple[str, ...]
    times: Array
    angles: Array

    def to_csv(self) -> str:
        """Text of the contract's motion table."""
        rows = [",".join(["time", *self.joints])]
        rows += [",".join(f"{x:.12g}" for x in (t, *a)) for t, a in zip(self.times, self.angles)]
        return "\n".join(rows) + "\n"


def stand_motion(walk: MotionRows, rng: np.random.Generator, amplitude: float = 1.0) -> MotionRows:
    """Feet in the air: knees and tail, then hips and neck, then the tops and the head, each slowly and then fast.

    Joints turn to the side to which they are bent in the walk.
    """
    side = np.where(walk.angles.mean(axis=0) < 0, -1.0, 1.0)
    groups = [{"b": 40.0, "tail": 8.0}, {"m": 20.0, "neck": 15.0}, {"t": 10.0, "head": 10.0}]
    times, poses = [0.0], [np.zeros(len(walk.joints))]
    for dwell in (0.55, 0.28):
        for group in groups:
            size = np.array([group.get(j, group.get(j[2:], 0.0) if _is_leg(j) else 0.0) for j in walk.joints])
            for share in (1.0, -1.0, 0.5, 0.0):
                times.append(times[-1] + dwell + rng.uniform(-0.05, 0.05) * dwell / 0.28)
                poses.append(amplitude * share * side * size)
    return MotionRows(walk.joints, np.array(times), np.array(poses))


def sway_motion(walk: MotionRows, rng: np.random.Generator) -> MotionRows:
    """Feet on the ground: down into the walk's mean crouch and beyond, with small steps of hips and tops, and up."""
    legs = np.array([_is_leg(j) and not j.endswith("t") for j in walk.joints])
    crouch = np.where(legs, walk.angles[1:].mean(axis=0), 0.0)
    hips = np.array([_is_leg(j) and j.endswith("m") for j in walk.joints]) * np.sign(crouch)
    tops = np.array([_is_leg(j) and j.endswith("t") for j in walk.joints], dtype=float)
    steps = [(0.7, 0, 0), (1.2, 0, 0), (1.2, 4, 0), (1.2, -3, 0), (1.2, 0, 3), (1.2, 0, -3), (0.6, 0, 2), (1.0, -2, -2),
             (1.3, 0, 0), (0.4, 0, 0), (1.3, 3, 2), (1.3, -3, -2), (0.7, 0, 0), (0.0, 0, 0)]
    poses = np.array([np.zeros(len(walk.joints)), *(depth * crouch + h * hips + t * tops for depth, h, t in steps)])
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.36, 0.48, len(steps)))])
    return MotionRows(walk.joints, times, poses)


def varied_walk(walk: MotionRows, slower: float = 1.15, smaller: float = 0.85) -> MotionRows:
    """Another walk than the recorded one: slower, with smaller strokes about the same mean."""
    mean = walk.angles[1:].mean(axis=0)
    return MotionRows(walk.joints, walk.times * slower, mean + smaller * (walk.angles - mean))


def _is_leg(joint: str) -> bool:
    return len(joint) == 3 and joint[0] in "bf" and joint[1] in "lr"
