"""Effects of the whole robot beside those of its joints, on a robot that is linear in all numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from tests.evidence.linear import candidate, region
from tests.evidence.test_search import OPTIONS, waves
from workbench.identify.evidence.hypothesis import Hypothesis, start
from workbench.identify.evidence.robot_search import RobotFound, search_robot
from workbench.identify.evidence.robot_wide import Whole
from workbench.identify.evidence.rollouts import Rollouts
from workbench.identify.evidence.search import recalibrate_nominal

JOINTS, OWN, ALL = 3, ("coulomb_friction", "backlash", "parallel_spring"), ("supply_sag", "thermal_fade")
NOISE, FRAMES = 2e-3, 400


@dataclass(frozen=True)
class Robot(Rollouts):
    """Several joints, each a region. truth: residual of the nominal law in each; does: by joint and name, the residual that
    a unit removes."""

    truth: tuple[np.ndarray, ...] = ()
    does: Mapping[tuple[int, str], np.ndarray] = field(default_factory=dict)

    def around_here(self, step, horizon=None):
        return replace(self, step=step)

    def answers(self, wants):
        return [self.left(joint, h, self.shared) for joint, h in wants]

    def everywhere(self, states):
        return [tuple(self.left(joint, h, shared) for joint, h in enumerate(each)) for shared, each in states]

    def left(self, joint: int, h: Hypothesis, shared: Hypothesis) -> np.ndarray:
        r = self.truth[joint].copy()
        for number, z in zip(h.numbers, h.z):
            r = r - z * self.does[joint, number.name]
        for c, x in (*h.sizes(), *shared.sizes()):
            r = r - float(x[0]) * self.does[joint, c.name]
        return r


def robot(own: Mapping[tuple[int, str], float], of_all: Mapping[str, float], seed: int = 0) -> Robot:
    """own: sizes by joint and effect; of_all: by effect."""
    regions = tuple(region([candidate(n) for n in OWN], n=FRAMES, noise=NOISE) for _ in range(JOINTS))
    n, does, truth = len(regions[0].likelihood.known), {}, []
    for joint in range(JOINTS):
        for name, signal in zip((*OWN, *ALL, "number 0"), waves(100 * joint + seed, n, len(OWN) + len(ALL) + 1)):
            does[joint, name] = signal
        r = np.random.default_rng(seed + joint + 1).normal(size=n) * NOISE
        for name, size in (*((name, s) for (j, name), s in own.items() if j == joint), *of_all.items()):
            r = r + size * does[joint, name]
        truth.append(r)
    starts = tuple(start(r.numbers) for r in regions)
    return Robot(None, None, regions, starts, None, None, truth=tuple(truth), does=does)  # type: ignore[arg-type]


def found(rollouts: Robot) -> RobotFound:
    return search_robot(rollouts, [candidate(n) for n in ALL], OPTIONS, lambda what, share=None: None)


def named(f: RobotFound) -> list[set[str]]:
    return [{c.name for c in part.best.hypothesis.effects} for part in f.found]


def test_what_acts_in_all_joints_is_said_once_and_not_of_each():
    f = found(robot({}, {"supply_sag": 2.0}))
    assert {c.name: x[0] for c, x in f.together.shared.sizes()} == pytest.approx({"supply_sag": 2.0}, rel=0.05)
    assert f.sure > 0.9
    assert named(f) == [set(), set(), set()]
    assert abs(f.together.shared.theta[0] - 2.0) < 4 * np.sqrt(f.together.covariance[0, 0])


def test_it_is_found_beside_an_effect_of_one_joint_that_shows_more():
    f = found(robot({(1, "backlash"): 6.0}, {"supply_sag": 1.0}))
    assert {c.name: x[0] for c, x in f.together.shared.sizes()} == pytest.approx({"supply_sag": 1.0}, rel=0.1)
    assert named(f) == [set(), {"backlash"}, set()]
    assert f.sure > 0.9


@pytest.mark.parametrize("seed", range(3))
def test_joints_alone_and_quiet_robots_get_no_effect_of_all(seed):
    assert not found(robot({}, {}, seed=10 * seed)).together.shared.effects
    f = found(robot({(0, "coulomb_friction"): 3.0}, {}, seed=10 * seed))
    assert not f.together.shared.effects or f.sure < 0.5
    assert named(f)[0] == {"coulomb_friction"}


def test_two_effects_of_all_that_do_the_same_share_the_probability():
    r = robot({}, {"supply_sag": 2.0})
    f = found(replace(r, does={**r.does, **{(j, "thermal_fade"): r.does[j, "supply_sag"] for j in range(JOINTS)}}))
    assert f.sure == pytest.approx(0.5, abs=0.1)
    assert {c.name for c, _ in f.instead if c is not None} | {c.name for c in f.together.shared.effects} == set(ALL)


def test_evidence_of_all_together_is_that_of_one_region_with_all_numbers():
    """The Schur complement of the joints, compared with the determinant of the whole information matrix."""
    rollouts, states = recalibrate_nominal(robot({}, {"supply_sag": 2.0}), OPTIONS, lambda what, share=None: None)
    whole = Whole(rollouts, tuple(candidate(n) for n in ALL), OPTIONS)
    fit = whole.fit(whole.predict(whole.start([f.best for f in states])))
    parts = [(f, G, r.likelihood.precision(f.r, f.discrepancy)) for f, G, r in zip(fit.fits, fit.slopes, whole.regions)]
    k = len(parts[0][0].hypothesis.theta)
    H = np.zeros((JOINTS * k + 1, JOINTS * k + 1))
    for j, (f, G, precision) in enumerate(parts):
        J = np.zeros((len(f.r), len(H)))
        J[:, j * k:(j + 1) * k], J[:, -1:] = f.J, G
        H += (J.T * precision) @ J
    prior = [1.0] * (JOINTS * k) + [2.0 / (1 + (fit.shared.theta[0] / OPTIONS.width) ** 2) / OPTIONS.width**2]
    assert np.linalg.inv(H + np.diag(prior))[-1, -1] == pytest.approx(fit.covariance[0, 0], rel=1e-6)


def test_an_effect_of_all_that_does_the_same_as_a_joints_own_is_told_beside_it():
    """Like a tilted stand and the first joint's zero: its effect on the other joints is within noise."""
    r = robot({(0, "backlash"): 2.0}, {})
    none = {(j, "supply_sag"): 0.0 * r.does[j, "supply_sag"] for j in (1, 2)}
    f = found(replace(r, does={**r.does, **none, (0, "supply_sag"): r.does[0, "backlash"]}))
    if f.together.shared.effects:  # the one or the other, as likely
        assert named(f)[0] == set()
        assert f.sure < 0.7
    else:
        instead, nats = f.rivals["backlash", ("j",)]
        assert instead.name == "supply_sag"
        assert abs(nats) < 1.0
