"""Where gaits are searched for: a box of shapes for each request, and shapes as points of a unit cube."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.gait.machine import GaitMachine
from workbench.gait.request import Request
from workbench.gait.shape import FAMILIES, KNEES, GaitShape
from workbench.gait.table import Paths, paths_of
from workbench.types import Array

LENGTHS: Mapping[str, tuple[float, float]] = {
    "lift": (0.03, 0.28), "crouch": (0.05, 0.45), "nose": (-0.12, 0.12), "front": (-0.25, 0.25), "hind": (-0.25, 0.25),
    "spread": (-0.08, 0.25), "sway": (-0.15, 0.15), "push": (-0.03, 0.12), "difference": (-0.2, 0.2)}
"""Ranges by leg length; a leg of the puppy has 0.184 m."""
SHARES: Mapping[str, tuple[float, float]] = {
    "duty": (0.40, 0.80), "sway_phase": (0.0, 1.0), "apex": (-0.25, 0.25), "lag": (-0.12, 0.12), "lead": (0.0, 1.3),
    "hurry": (0.8, 2.0)}
TRIM = 0.06
"""Turn in a stance [rad] by which a straight gait steers against its own drift: robots are not exactly symmetric."""
SHORTEST = 0.08
"""Stride along the way, by leg length; strides across it, and those of a turn in place, are no longer."""
MOST_TURN = 1.2
"""Of the body in one stance [rad]."""
POSES = (2.0, 8.0)
"""Half the poses in a cycle."""
FREQUENCY = (0.7, 4.6)
"""[Hz] of a robot with a leg of 0.184 m; others swing with the root of gravity by length."""
PUPPY_LEG = 0.1835
WEIGHTS: Mapping[str, float] = {"trot": 0.5, "walk": 0.15, "crawl": 0.1, "bound": 0.125, "pace": 0.125}
"""How often a seed is of each family."""
MOST_BATCHES = 10
"""After so many batches of twice the requested number, a robot whose legs reach next to nothing gets fewer seeds."""


@dataclass(frozen=True)
class Space:
    """Names and ranges (n,) of the search variables, in SI. poses are halves of their number and whole."""

    names: tuple[str, ...]
    low: Array
    high: Array

    @property
    def whole(self) -> list[int]:
        """Indices of what takes whole numbers only."""
        return [self.names.index("poses")]

    def shape(self, x: Array, family: str, knees: tuple[int, int]) -> GaitShape:
        """The shape at a point x (n,) of the unit cube."""
        values = dict(zip(self.names, (self.low + np.clip(x, 0, 1) * (self.high - self.low)).tolist()))
        values["poses"] = 2 * round(values["poses"])
        if family == "crawl":
            values["duty"] = max(values["duty"], 0.75)
        return GaitShape(family=family, knees=knees, **values)

    def point(self, shape: GaitShape) -> Array:
        """The point (n,) of a shape, moved into the cube."""
        values = np.array([getattr(shape, n) / (2 if n == "poses" else 1) for n in self.names])
        return np.clip((values - self.low) / (self.high - self.low), 0.0, 1.0)


def space_of(machine: GaitMachine, request: Request) -> Space:
    """The box for a request on one robot."""
    length = machine.leg_length
    pace = np.sqrt(PUPPY_LEG / length)
    box = {"poses": POSES, "frequency": (FREQUENCY[0] * pace, FREQUENCY[1] * pace)}
    box |= {k: (a * length, b * length) for k, (a, b) in LENGTHS.items()}
    box |= dict(SHARES)
    box |= {k: (a, b) for k, (a, b) in _strides(request, length).items() if b > a}
    if request.way == "sideways":
        del box["difference"]
    names = tuple(box)
    low, high = (np.array([box[n][i] for n in names]) for i in (0, 1))
    return Space(names, low, high)


def tightest_arc(machine: GaitMachine) -> float:
    """Least radius [m] of an arc within every box: the shortest stride at the greatest turn in a stance."""
    return SHORTEST * machine.leg_length / MOST_TURN


def _strides(request: Request, length: float) -> dict[str, tuple[float, float]]:
    """Ranges of stride, side [m] and turn [rad]."""
    along, trim = (SHORTEST * length, 0.95 * length), (-TRIM, TRIM)
    little = (-SHORTEST * length, SHORTEST * length)
    if request.way == "backward":
        return {"stride": (-along[1], -along[0]), "turn": trim}
    if request.way == "sideways":
        return {"stride": little, "side": _mirror(request, 0.05 * length, 0.55 * length), "turn": (-0.1, 0.1)}
    if request.way == "turn":
        return {"stride": little, "turn": _mirror(request, 0.1, MOST_TURN)}
    if request.radius is not None:
        return {"stride": along, "turn": _mirror(request, 0.0, min(MOST_TURN, 2 * along[1] / request.radius))}
    return {"stride": along, "turn": trim}


def _mirror(request: Request, least: float, most: float) -> tuple[float, float]:
    """A range to the left, or its mirror image."""
    return (-most, -least) if request.right else (least, most)


def seeds(machine: GaitMachine, request: Request, space: Space, count: int, seed: int) -> list[GaitShape]:
    """Random shapes of every family and knee direction that legs can reach, the same for the same seed."""
    rng = np.random.default_rng([seed, 10])
    out: list[GaitShape] = []
    for _ in range(MOST_BATCHES):
        drawn = [random_shape(rng, request, space) for _ in range(max(2 * count, 20))]
        out += [p.shape for p in paths_of(machine, drawn) if p.off.max() <= request.limits.reach and in_range(machine, p)]
        if len(out) >= count:
            break
    return out[:count]


def in_range(machine: GaitMachine, paths: Paths) -> bool:
    """Whether no joint of a path turns farther than it can."""
    lower, upper = machine.bounds
    return all(bool((q >= lower).all() and (q <= upper).all()) for q in (paths.q, paths.small, paths.stand))


def random_shape(rng: np.random.Generator, request: Request, space: Space) -> GaitShape:
    """Anywhere in the space, of any family."""
    families, weights = list(WEIGHTS), np.array(list(WEIGHTS.values()))
    assert set(families) == set(FAMILIES)
    knees = KNEES[:1] if request.built_knees else KNEES
    family = str(rng.choice(families, p=weights / weights.sum()))
    x = rng.uniform(size=len(space.names))
    x[space.names.index("poses")] = rng.choice([0.33, 0.5, 0.67])  # 6, 8 and 12: extremes come by search
    return space.shape(x, family, knees[rng.integers(len(knees))])
