"""What effects say of themselves to the search, which knows none by its name."""

from types import SimpleNamespace

import pytest

from workbench.effects.base import Effect, Parameter
from workbench.effects.registry import estimated_by, known_effects
from workbench.identify import proposals
from workbench.identify.parameters import Candidate
from workbench.identify.point_mass import PointMass
from workbench.robot import puppy_model

KNOWN = known_effects()
HELD = SimpleNamespace(channels=("flm",), start_is_free=True, take=SimpleNamespace(
    commands=None, spec=SimpleNamespace(base="fixed"), recorded=SimpleNamespace(zeroed=True)))
"""A held take of one joint."""


class Plugged(Effect):
    """A plug-in with a name of its own."""

    name = "springy"
    layer = "structure"
    places = ("joint",)
    parameters = (Parameter("stiffness", "N m/rad", 0.0, 10.0, 1.0),)


def test_other_effects_that_one_names_are_there_and_equivalence_goes_both_ways():
    for e in KNOWN.values():
        for other in e.equivalent_to:
            assert e.name in KNOWN[other].equivalent_to
        for other in (*e.includes, *filter(None, [e.reduces_to])):
            assert sum(3 if p.vector else 1 for p in KNOWN[other].parameters) <= sum(3 if p.vector else 1 for p in e.parameters)
            assert set(KNOWN[other].places) == set(e.places)


def test_what_no_search_from_neutral_finds_is_read_off_and_only_the_floors_own_is_hidden_from_a_stand():
    assert all(e.estimator is not None for e in KNOWN.values() if not e.from_neutral)
    assert {e.name for e in estimated_by("end of travel")} == {"joint_stop"}
    hidden = {e.name for e in KNOWN.values() if not e.observable_when_fixed}
    assert hidden == {"ground_friction", "foot_friction", "soft_ground", "tether_force"}  # gravity leans on a stand, too


@pytest.mark.parametrize(("family", "members"), [
    ("electrical", {"supply_voltage", "supply_sag", "thermal_fade", "torque_ceiling", "servo_gain"}),
    ("mass", {"payload", "com_shift"}), ("ground pull", {"ground_tilt", "tether_force"}),
    ("timing", {"command_delay", "timing_drift", "clock_rate"})])
def test_effects_that_do_nearly_the_same_are_of_one_family(family, members):
    assert members <= {e.name for e in KNOWN.values() if e.family == family}


@pytest.mark.parametrize(("said", "proposed"), [
    ({}, True), ({"from_neutral": False}, False), ({"observable_when_fixed": False}, False),
    ({"could_act": lambda self, model, sent: False}, False)])
def test_a_plug_in_is_proposed_by_what_it_says_of_itself(said, proposed, monkeypatch):
    effect = type("Said", (Plugged,), said)()
    monkeypatch.setattr(proposals, "known_effects", lambda: {effect.name: effect})
    found = proposals.candidates(puppy_model(), [HELD])
    assert [c.where for c in found] == ([("flm",)] if proposed else [])
    assert all(c.reach == float("inf") for c in found)


def test_a_plug_in_that_is_a_point_mass_is_fitted_by_its_moments_and_within_its_reach(monkeypatch):
    mass = type("Ballast", (type(KNOWN["payload"]),), {"name": "ballast"})()
    short = type("Short", (Plugged,), {"reach": lambda self, sdf, model, where: 0.25})()
    monkeypatch.setattr(proposals, "known_effects", lambda: {mass.name: mass, short.name: short})
    found = proposals.candidates(puppy_model(), [HELD])
    assert {type(c) for c in found if c.name == "ballast"} >= {PointMass}
    assert [c.reach for c in found if type(c) is Candidate] == [0.25]
