"""Which effects are asked about, where, on which takes and in which order."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.identify.small import fit_of, leaving, search_on
from workbench.compare.channels import ACROSS
from workbench.effects.registry import known_effects
from workbench.identify.fitting.fits import Search
from workbench.identify.parameters import Candidate
from workbench.identify.proposals import candidates, heavy_links
from workbench.identify.selection import forward, scheduling
from workbench.identify.selection.options import SCHEDULING
from workbench.identify.selection.record import CandidateFit
from workbench.robot import puppy_model


@pytest.mark.parametrize(("gaps", "expected"), [
    ({"one": 6.7, "two": 2.6, "pitch": 1.5}, {"one"}),
    ({"one": 6.7, "two": 4.0}, set()),
    ({"one": 6.7, "pitch": 5.0}, set()),
    ({"pitch": 6.7, "one": 2.0}, set()),
    ({"one across x": 6.7, "two": 2.0}, {"one"}),
    ({}, set()),
])
def test_a_joint_stands_out_where_nothing_else_errs_a_quarter_as_much(monkeypatch, gaps, expected):
    named = {c.replace(" across ", ACROSS): s for c, s in gaps.items()}
    monkeypatch.setattr(scheduling, "channel_gaps", lambda e, residual: named)
    model = SimpleNamespace(joints=("one", "two"))
    walking, held = (Search(search_on(base).evaluator, model) for base in ("free", "fixed"))
    assert scheduling.standing_out(walking, fit_of((), {0: leaving(0.0)}), (0,)) == expected
    assert scheduling.standing_out(held, fit_of((), {0: leaving(0.0)}), (0,)) == set()


@pytest.mark.parametrize(("base", "tier", "said"),
                         [("fixed", 2, False), ("free", 2, False), ("free", SCHEDULING.tiers_of_all, True)])
def test_what_closes_most_of_a_joint_does_not_keep_links_from_being_asked_with_the_base_held(base, tier, said):
    """A load on the hand looks like a weak shoulder."""
    search = search_on(base)
    shoulder = Candidate.of(known_effects()["servo_gain"], ("one",), (1.0,))
    for closed, enough in ((0.7, said), (0.98, True), (0.5, False)):
        trial = CandidateFit(shoulder, np.ones(1), {"fit": 9e3, "choose": 5e3}, "one", closed=closed)
        assert forward._says_it(search, None, trial, (0,), tier) is enough


@pytest.mark.parametrize(("name", "tier", "base", "tips"), [("com_shift", 4, "free", True), ("payload", 4, "free", True),
    ("payload", 5, "free", False), ("soft_ground", 4, "free", False), ("payload", 3, "fixed", False)])
def test_a_load_that_closes_all_of_a_walk_does_not_keep_other_centres_of_mass_from_being_asked(name, tier, base, tips):
    """A tail's, moved, looked like a load on the body."""
    effect = known_effects()[name]
    heard = Candidate.of(effect, () if name == "soft_ground" else ("body",), effect.neutral(None))
    trial = CandidateFit(heard, np.ones(heard.size), {"fit": 2e3, "choose": 1e3}, None, closed=1.0)
    search = search_on(base)
    assert forward._tips(search, trial, (0,), tier) is tips


@pytest.mark.parametrize(("spring", "stop", "chosen"), [(5.6e7, 3.9e7, ["joint_stop"]), (5.6e7, 2.0e7, ["parallel_spring"]),
                                                        (3.0e7, 3.9e7, ["joint_stop"])])
def test_a_stop_that_recordings_show_goes_before_a_stiff_spring_that_imitates_it(spring, stop, chosen):
    """With a load and a weak elbow, a spring closed more of a shoulder's gap than the stop at which all recordings end."""
    known = known_effects()
    at_stop = Candidate.of(known["joint_stop"], ("one",), (-180.0, 57.0), (-180.0, 6.0), (True, False))
    stiff = Candidate.of(known["parallel_spring"], ("one",), (0.0,))
    trials = [
        CandidateFit(c, np.ones(1), {"fit": 2 * g, "choose": g}, "one", closed=0.6) for c, g in ((stiff, spring), (at_stop, stop))
    ]
    choices = forward._accept(sorted(trials, key=lambda t: -t.gain["choose"]))
    assert [[t.candidate.name for t in c] for c in choices] == [chosen]


@pytest.mark.parametrize(("closed", "gain", "chosen"), [
    ((0.16, 0.97), 514.0, ["com_shift"]), ((0.6, 0.97), 514.0, ["soft_ground", "com_shift"]),
    ((0.16, 0.85), 514.0, ["soft_ground", "com_shift"]), ((0.16, 0.97), 300.0, ["soft_ground"])])
def test_on_the_ground_what_leaves_half_gives_way_to_what_closes_nearly_all_for_about_the_same(closed, gain, chosen):
    """Soft ground gained a tenth more than a displaced centre of mass, by one parameter and not three, and closed a sixth."""
    known = known_effects()
    soft = Candidate.of(known["soft_ground"], (), (1e5,))
    shifted = Candidate.of(known["com_shift"], ("body",), (0.0, 0.0, 0.0))
    trials = [CandidateFit(c, np.ones(c.size), {"fit": 2 * g, "choose": g}, None, closed=share)
              for c, g, share in zip((soft, shifted), (565.0, gain), closed)]
    assert [[t.candidate.name for t in c] for c in forward._accept(trials)] == [[name] for name in chosen]


@pytest.mark.parametrize(("base", "shares", "of_all"), [
    ("fixed", (0.1, 0.97, 0.99), True), ("fixed", (0.1, 0.5, 0.99), False), ("fixed", (0.97, 0.99), False),
    ("free", (0.1, 0.97, 0.99), False)])
def test_what_most_joints_of_a_held_robot_lack_in_common_is_the_robots_whatever_more_one_lacks(monkeypatch, base, shares, of_all):
    """Beside another clock rate, play in one joint kept joints and sets of effects being asked until the limit of work."""
    joints, search = [f"joint{n}" for n in range(len(shares))], search_on(base)
    monkeypatch.setattr(forward, "_closed_at", lambda search, current, t, takes, joint: shares[joints.index(joint)])
    for name, where, expected in (("clock_rate", (), of_all), ("servo_gain", ("joint0",), False)):
        trial = CandidateFit(Candidate.of(known_effects()[name], where, (1.0,)), np.ones(1), {"fit": 9e3, "choose": 5e3}, None)
        beyond = dict.fromkeys([*joints, "heading"], 9.0)
        assert forward._is_of_all(search, None, trial, (0,), beyond) is expected


def test_beside_a_pull_no_tilt_is_asked(worn):
    _, search, nominal = worn
    tilt = Candidate.of(known_effects()["ground_tilt"], (), (0.0, 0.0))
    pull = Candidate.of(known_effects()["tether_force"], (), (0.0, 0.0, 0.0))
    pulled = fit_of([pull], nominal.residuals)
    for current, groups in ((nominal, [[[tilt]]]), (pulled, [])):
        asked_of = [scheduling.groups_to_try(search, [tilt], current, {"one": 3.0, "two": 3.0}, search.fixed_base, tier)[0]
                    for tier in range(SCHEDULING.tiers)]
        assert [g for g in asked_of if g] == groups


def test_on_the_ground_what_was_read_off_is_asked_of_joints_that_were_well_while_held(worn, monkeypatch):
    """A stop may lie outside the range of those motions, and gravity may have held a loose mount on one side."""
    _, search, nominal = worn
    well = next(iter(scheduling.well_on_fixed_base(search, nominal)[0]))
    monkeypatch.setattr(search, "floating_base", lambda takes: takes)
    mount = Candidate.of(known_effects()["loose_mount"], (well,), (0.0, 1.0, 0.0, 0.0), (1.0, 1.0, 0.0, 0.0),
                         (False, True, True, True))
    band = Candidate.of(known_effects()["dead_band"], (well,), (0.0,))
    groups = [g for tier in range(SCHEDULING.tiers)
              for g in scheduling.groups_to_try(search, [mount, band], nominal, {well: 3.0}, search.fixed_base, tier)[0]]
    assert groups == [[mount]]


def test_of_a_held_robot_what_acts_on_all_of_it_is_asked_before_many_joints(worn):
    session, search, nominal = worn
    pool = candidates(session.model, search.evaluator.evidence)

    def asked_of(*joints):
        beyond = dict.fromkeys(joints, 3.0)
        return [[c for g in scheduling.groups_to_try(search, pool, nominal, beyond, search.fixed_base, tier)[0] for c in g]
                for tier in range(SCHEDULING.tiers)]

    of_all, at_joints, *others = asked_of("one", "two", "three")[1:]
    assert {c.name for c in of_all} >= {"supply_voltage", "timing_drift"}
    assert all(not c.where for c in of_all)
    assert {c.joint for c in at_joints} == {"one", "two", "three"}
    assert all(c.joint is None and c.where for tier in others for c in tier)
    of_all, at_joints, *_ = asked_of("two", "three")[1:]
    assert not of_all
    assert {c.joint for c in at_joints} == {None, "two", "three"}


@pytest.mark.parametrize("zeroed", [True, False])
def test_zeros_of_a_held_robot_are_asked_about_where_the_recording_has_its_own(worn, zeroed):
    session, search, nominal = worn
    e = search.evaluator.evidence[0]
    seen = replace(e, take=replace(e.take, recorded=replace(e.take.recorded, zeroed=zeroed)))
    search = Search(search.evaluator.on([seen]), session.model)
    pool = [Candidate.of(known_effects()["zero_offset"], (j,), (0.0,)) for j in session.model.joints]
    groups = [g for tier in range(SCHEDULING.tiers)
              for g in scheduling.groups_to_try(search, pool, nominal, {"two": 3.0}, search.fixed_base, tier)[0]]
    assert [[c.where for c in g] for g in groups] == ([] if zeroed else [[("two",)]])


def test_what_a_heavy_link_carries_on_its_axis_is_asked_about_though_its_joint_carried_it_well(worn, monkeypatch):
    """A load on a rear body's axis moves nothing that its joint would feel, and all feet."""
    session, search, nominal = worn
    well = next(iter(scheduling.well_on_fixed_base(search, nominal)[0]))
    link = next(f.child for f in session.model.kinematics.frames.values() if f.name == well)
    shift = Candidate.of(known_effects()["com_shift"], (link,), (0.0, 0.0, 0.0))
    trunk = Candidate.of(known_effects()["com_shift"], (session.model.base,), (0.0, 0.0, 0.0))
    monkeypatch.setattr(search, "floating_base", lambda takes: takes)

    def tiers(heavy):
        monkeypatch.setattr(scheduling, "heavy_links", lambda model: heavy)
        return [tier for tier in range(SCHEDULING.tiers)
                for g in scheduling.groups_to_try(search, [trunk, shift], nominal, {well: 3.0, "roll": 3.0}, search.fixed_base,
                                                  tier)[0]
                for c in g if c is shift]

    assert tiers([link]) == [SCHEDULING.tiers_of_all - 1]
    assert tiers([]) == []


def test_a_rear_body_is_heavy_at_a_tenth_a_thigh_is_not(monkeypatch):
    """A load on a trunk's link tips the robot; a load on a leg is felt by that leg's joints."""
    model = puppy_model()
    masses = {"body_link": 0.4, "tail_link": 0.1, "flm_link": 0.1, "frm_link": 0.2, "head_link": 0.08, "neck_link": 0.12}
    kinematics = replace(model.kinematics, masses=dict.fromkeys(model.kinematics.links, 0.0) | masses)
    monkeypatch.setitem(vars(model), "kinematics", kinematics)
    assert set(heavy_links(model)) == {"body_link", "tail_link", "frm_link", "neck_link"}
