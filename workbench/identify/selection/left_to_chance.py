"""The motion of a loose link within its play is random: once play is found, the sigma of its off-axis channels includes it.

No model can predict for long at which end of the gap the link lies. Two independently rattling links differ by a sixth of the
square of their play, in the mean square, which is far beyond noise: without this, any effect that happens to shake the model's
link at the right moment looks like the next cause, and hides a load on the body.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from workbench.compare.channels import ACROSS
from workbench.effects.base import si_values
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.parameters import Key
from workbench.identify.problem import TakeEvidence


def left_to_chance(search: Search, current: Fit, known: Collection[Key]) -> tuple[Search, Fit]:
    """The search in which loose links that are in the fit, and were not `known`, rock as they may, and the fit as it is then."""
    loose = {c.where[0]: si_values(c.effect, c.spec(x))[c.effect.free_play] for c, x in current.sizes()
             if c.key not in known and c.read_off and c.effect.free_play}
    if not loose:
        return search, current
    evaluator = search.evaluator.on([_wider(e, loose) for e in search.evaluator.evidence])
    search = Search(evaluator, search.nominal, search.settled)  # responses were looked at in other units
    there = search.evaluate(current.sizes())
    return search, replace(current, cost=there.cost, residuals=there.residuals)


def _wider(e: TakeEvidence, loose: dict[str, float]) -> TakeEvidence:
    """loose: play by joint [rad]."""
    chance = np.zeros(len(e.channels))
    for joint, play in loose.items():
        chance[[k for k, c in enumerate(e.channels) if c.startswith(joint + ACROSS)]] = play / np.sqrt(6.0)
    return replace(e, rough=np.sqrt(np.square(e.rough) + np.square(chance / e.sigma)))
