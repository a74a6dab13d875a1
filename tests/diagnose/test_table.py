"""A table of short sessions: what is hidden in each, and what a diagnosis has to say of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.diagnose.sessions import arm_session, puppy_session
from tests.quadruped import stand_csv
from workbench.compare.session import Session
from workbench.identify.diagnosis import diagnose_session
from workbench.identify.results.findings import Diagnosis
from workbench.motion import load_motion
from workbench.robot import EffectSpec, data_file, puppy_model


@dataclass(frozen=True)
class Case:
    """hidden: in the robot. cycles: by take of the puppy, "stand" on a fixed base and "walk" on the floor; empty: the arm in one
    take. names: the findings, each by all names that it gives, in any order; where: their places. left: joints that stay
    beyond noise on unseen stretches."""

    hidden: tuple[EffectSpec, ...] = ()
    cycles: Mapping[str, int] = field(default_factory=dict)
    verdict: str = "explained"
    names: tuple[tuple[str, ...], ...] = ()
    where: tuple[tuple[str, ...], ...] = ()
    left: tuple[str, ...] = ()


def one(effect: str, where: tuple[str, ...], *others: str, cycles: Mapping[str, int] | None = None,
        **parameters: float | tuple[float, float, float]) -> Case:
    """A case of one hidden effect that is named, beside `others` that these takes cannot tell from it."""
    return Case((EffectSpec(effect, where, parameters),), cycles or {}, names=((effect, *others),), where=(where,))


WALK = {"walk": 8}
QUICK = {
    "nothing": Case(verdict="no_gap"),
    "a stiff joint": one("coulomb_friction", ("three",), "dead_band", torque=0.1),  # one short take leaves a tie
    "play": one("backlash", ("two",), gap=4.0),
    "a weak gain": one("servo_gain", ("two",), ratio=0.5),
    "an asset that sits askew": one("marker_frame", ("Lower",), rotation=(0.0, 0.0, 8.0)),
    "a weak supply": one("supply_voltage", (), voltage=8.0),
    "a stop": one("joint_stop", ("three",), lower=-180.0, upper=8.0),
    "speeds in another order": one("speed_order", ()),
    "play and a stiff joint": Case(
        (EffectSpec("backlash", ("two",), {"gap": 4.0}), EffectSpec("coulomb_friction", ("three",), {"torque": 0.15})),
        verdict="partly_explained", names=(("backlash",), ("coulomb_friction", "dead_band")), where=(("two",), ("three",)),
        left=("two",)),
    "a walk, nothing": Case(cycles=WALK, verdict="no_gap"),
}
SLOW = {
    "a walk on a slippery floor": one("ground_friction", (), cycles=WALK, friction=0.2),
    "a walk on a tilted floor": one("ground_tilt", (), "tether_force", cycles=WALK, forward=3.0, left=0.0),
    "a stand and a walk with play": one("backlash", ("flm",), cycles={"stand": 1, "walk": 8}, gap=4.0),
    "a stand and a walk with a hip that rubs under load": one("load_friction", ("blm",), cycles={"stand": 1, "walk": 8},
                                                              coefficient=0.6),
}


@pytest.mark.parametrize("name", QUICK)
def test_a_short_session_is_diagnosed(name, tmp_path, remembered):
    check(QUICK[name], tmp_path, remembered)


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_a_walking_robot_is_diagnosed(name, tmp_path, remembered):
    check(SLOW[name], tmp_path, remembered)


def check(case: Case, folder: Path, remembered: Path) -> None:
    """Verdict, names, places, intervals, and where the gap is."""
    said = diagnose_session(_session(case, folder), n_jobs=1, memory=remembered).diagnosis
    assert said.verdict == case.verdict
    assert [f.where for f in said.findings] == list(case.where)
    for finding, names in zip(said.findings, case.names, strict=True):
        assert {finding.effect, *(a.effect for a in finding.alternatives)} == set(names)
    assert tuple(j for u in said.unexplained for j in u.where) == case.left
    assert bool(said.gap) is bool(case.hidden)
    assert said.provenance["engine"]["rollouts by"] == "the compiled station"
    _truth_lies_within_its_interval(case, said)


def _session(case: Case, folder: Path) -> Session:
    if not case.cycles:
        return arm_session(folder, case.hidden)
    motions = {"stand": stand_csv(), "walk": data_file("robotis_walk.csv")}
    model = puppy_model()
    played = {name: load_motion(motions[name], model) for name in case.cycles}
    return puppy_session(folder, case.hidden, played, dict(case.cycles))


def _truth_lies_within_its_interval(case: Case, said: Diagnosis) -> None:
    """Of every hidden effect that was named as itself; what was found leaves next to nothing on stretches that nothing saw."""
    for finding, hidden in zip(said.findings, case.hidden, strict=True):
        assert finding.validation.after < 0.4 * finding.validation.before
        if finding.effect != hidden.effect:
            continue
        for name, value in hidden.parameters.items():
            estimate = finding.parameters[name]
            parts = zip(*(x if isinstance(x, tuple) else (x,) for x in (estimate.low, value, estimate.high)))
            for low, true, high in parts:
                slack = 0.5 * (high - low)  # of a 90 % interval: the truth lies outside of it now and then
                assert low - slack <= true <= high + slack
