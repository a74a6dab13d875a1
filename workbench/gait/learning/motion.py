"""A learned policy as a motion: the cycle that it settles into becomes a gait, which is certified like any other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench.files import InputError
from workbench.gait.learning.episode import Domains, Episode
from workbench.gait.shape import GaitShape
from workbench.types import Array

Policy = Callable[[Array], Array]
"""The action of an observation, without exploration."""
SETTLES = 4
"""Cycles after which a walk is its limit cycle: the demo's gait is back in its cycle two after a push."""


def walk_episode(policy: Policy, domains: Domains, which: int) -> tuple[Episode, Array]:
    """A whole episode on one robot, and its actions (K, size), fewer where it fell."""
    episode, actions = Episode(domains, which), []
    while not (episode.fell or episode.over):
        episode.step(policy(episode.seen))
        actions.append(episode.before)
    return episode, np.array(actions)


def learned_shape(policy: Policy, domains: Domains) -> GaitShape:
    """The gait that repeats the mean actions of the policy's cycles on the first robot, without the first SETTLES. Its reactions
    to disturbances are lost, as a table has none. InputError where the robot falls, or has too few cycles."""
    episode, actions = walk_episode(policy, domains, 0)
    if episode.fell:
        raise InputError(None, "the robot falls under the learned policy; it is no motion")
    cycles = actions.reshape(-1, domains.actions.in_cycle, domains.actions.size)[SETTLES:]
    if not len(cycles):
        raise InputError(None, f"expected episodes of more than {SETTLES} cycles, from which a motion is averaged")
    return domains.actions.shape(cycles.mean(axis=0))
