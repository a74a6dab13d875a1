"""A table of short sessions: what is hidden in each, and what a diagnosis has to say of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from tests.diagnose.sessions import arm_session
from workbench.identify.diagnosis import diagnose_session
from workbench.identify.results.findings import Diagnosis
from workbench.robot import EffectSpec


@dataclass(frozen=True)
class Case:
    """hidden: in the robot. names: the findings, each by the names that may stand for it, the hidden one first; where: their
    places, in that order."""

    hidden: tuple[EffectSpec, ...] = ()
    verdict: str = "explained"
    names: tuple[tuple[str, ...], ...] = ()
    where: tuple[tuple[str, ...], ...] = field(default=())


CASES = {
    "nothing": Case(verdict="no_gap"),
    "a stiff joint": Case((EffectSpec("coulomb_friction", ("three",), {"torque": 0.1}),),
                          names=(("coulomb_friction", "dead_band"),), where=(("three",),)),  # one short take leaves a tie
    "play": Case((EffectSpec("backlash", ("two",), {"gap": 4.0}),), names=(("backlash",),), where=(("two",),)),
}


@pytest.mark.parametrize("name", CASES)
def test_a_session_of_the_arm_is_diagnosed(name, tmp_path):
    case = CASES[name]
    said = diagnose_session(arm_session(tmp_path, case.hidden), n_jobs=1).diagnosis
    assert said.verdict == case.verdict
    assert [f.where for f in said.findings] == list(case.where)
    for finding, names in zip(said.findings, case.names, strict=True):
        named = [finding.effect, *(a.effect for a in finding.alternatives)]
        assert set(named) == set(names)
    assert said.gap == () if not case.hidden else said.gap[0].where == case.where[0]
    _truth_lies_within_its_interval(case, said)


def _truth_lies_within_its_interval(case: Case, said: Diagnosis) -> None:
    """Of every hidden effect that was named as itself; what was found leaves next to nothing on stretches that nothing saw."""
    for finding, hidden in zip(said.findings, case.hidden, strict=True):
        assert finding.validation.after < 0.4 * finding.validation.before
        if finding.effect == hidden.effect:
            for name, value in hidden.parameters.items():
                estimate = finding.parameters[name]
                slack = 0.5 * (estimate.high - estimate.low)  # of a 90 % interval: the truth lies outside of it now and then
                assert estimate.low - slack < value < estimate.high + slack
