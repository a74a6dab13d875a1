"""Limits over the robots of an ensemble: nine in ten keep each, none falls, and counts come with the bound they leave."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.gait.draws import (
    FEWEST,
    Drawn,
    bound,
    describe_robot,
    draw_margins,
    foot_speed,
    record_draw,
    screened_count,
    slip_margin,
    summary,
)
from workbench.gait.ensemble import Ensemble
from workbench.gait.feet import FeetMeasure
from workbench.gait.limits import Margin, allowed_rms
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import GaitMeasure, fallen
from workbench.gait.request import Request
from workbench.gait.requirements import floor_margins, heading_spread, worse_half
from workbench.robot import EffectSpec, puppy_model

WALKED = GaitMeasure(False, (0.3, 0.0), 0.0, 1.0, 0.0, 0.0, np.radians(10), (0.3,) * 15, (0.5,) * 15, (0.5,) * 15, 1.0, 2.0, 20.0,
                     5.0, 100.0, clearance=0.006, slip=0.03)
FEET = FeetMeasure(slip=0.03, clearance=0.006, tipping=0.3)


@pytest.fixture(scope="module")
def machine():
    return GaitMachine(puppy_model())


def margins(machine, draws):
    return {m.name: m for m in draw_margins(machine, Request(), draws)}


def test_one_robot_in_ten_may_break_a_limit_and_no_more(machine):
    steep = replace(WALKED, tilt=np.radians(40))
    assert margins(machine, [WALKED] * 9 + [steep])["tilt over draws"].use == pytest.approx(1 / 3)
    broken = margins(machine, [WALKED] * 8 + [steep] * 2)["tilt over draws"]
    assert broken.use == pytest.approx(4 / 3)
    assert str(broken) == "tilt over draws, 9 of 10 robots: 40 of 30 deg"
    assert margins(machine, [WALKED] * 7 + [steep])["tilt over draws"].use > 1  # of eight, none


def test_a_screening_of_a_few_robots_refuses_only_what_contradicts_nine_in_ten(machine):
    steep = replace(WALKED, tilt=np.radians(40))

    def use(good, bad):
        draws = [WALKED] * good + [steep] * bad
        return {m.name: m.use for m in draw_margins(machine, Request(), draws, screen=True)}["tilt over draws"]

    assert use(7, 1) < 1 < use(6, 2)
    assert use(21, 3) < 1 < use(20, 4)
    assert screened_count(8) == 7


@pytest.mark.parametrize(("change", "name", "use"), [
    ({"slip": 0.24}, "slip over draws", 0.8 / 0.6), ({"clearance": 0.0015}, "foot clearance over draws", 1.5),
    ({"torque_use": (0.5,) * 14 + (1.2,)}, "torque-speed line over draws", 1.2),
    ({"rms": (0.3,) * 14 + (1.388,)}, "RMS torque over draws", 2.0), ({"touched": True}, "other contact over draws", 2.0)])
def test_each_limit_of_a_run_is_judged_on_draws(machine, change, name, use):
    assert margins(machine, [replace(WALKED, **change)] * 4)[name].use == pytest.approx(use, rel=1e-3)
    assert margins(machine, [WALKED] * 4)[name].use <= 1


def test_each_limit_names_the_worst_joint_its_value_and_its_unit(machine):
    joints, limits = machine.model.joints, Request().limits
    allowed = allowed_rms(machine, limits)
    rms = tuple(0.9 * a for a in allowed)
    loaded = replace(WALKED, rms=(*rms[:4], 1.1 * allowed[4], *rms[5:]), torque_use=(0.5,) * 6 + (0.8,) + (0.5,) * 8)
    by_name = margins(machine, [loaded] * 10)
    assert str(by_name["RMS torque over draws"]) == (
        f"RMS torque over draws, {joints[4]}, 9 of 10 robots: {1.1 * allowed[4]:.3g} of {allowed[4]:.3g} N m")
    line = by_name["torque-speed line over draws"]
    assert (line.where, line.unit) == (f"{joints[6]}, 9 of 10 robots", "% of the torque available")
    assert (line.value, line.limit) == pytest.approx((80.0, 100 * limits.torque))


def test_the_worst_joint_is_the_one_nearest_to_its_own_limit(machine, monkeypatch):
    """The strong joint has the larger torque, the weak one the larger share."""
    allowed = np.array([2.0, 0.5] + [10.0] * 13)
    monkeypatch.setattr("workbench.gait.draws.allowed_rms", lambda machine, limits: allowed)
    worst = margins(machine, [replace(WALKED, rms=(1.0, 0.4) + (0.1,) * 13)] * 10)["RMS torque over draws"]
    assert (worst.value, worst.limit) == (0.4, 0.5)
    assert worst.where.startswith(machine.model.joints[1])


@pytest.mark.parametrize(("touched", "use"), [(0, 0.0), (1, 0.5), (2, 1.0), (3, 1.0 + 3 / 20)])
def test_two_of_twenty_robots_may_touch_with_other_links(machine, touched, use):
    draws = [replace(WALKED, touched=True)] * touched + [WALKED] * (20 - touched)
    assert margins(machine, draws)["other contact over draws"] == Margin(
        "other contact over draws", "of 20 robots", float(touched), 2.0, "robots whose links touch", pytest.approx(use))


def test_robots_that_fell_do_not_hide_behind_a_share(machine):
    assert draw_margins(machine, Request(), [fallen(15)] * 3) == []
    assert set(margins(machine, [WALKED, fallen(15)])) == set(margins(machine, [WALKED]))


def test_a_count_leaves_a_bound():
    assert bound(0, 64) == pytest.approx(0.0457, abs=1e-4)
    assert bound(0, 64) == pytest.approx(1 - 0.05 ** (1 / 64))
    assert bound(1, 64) > bound(0, 64)
    assert bound(3, 3) == 1.0
    assert bound(1, 20) == pytest.approx(0.2161, abs=1e-4)  # Clopper and Pearson's table


def test_no_quantile_comes_from_fewer_than_twenty_draws():
    few = summary(Request(), [Drawn("r", WALKED, FEET)] * (FEWEST - 1))
    many = summary(Request(), [Drawn("r", WALKED, FEET)] * FEWEST)
    assert few["speed m/s"] == [0.3, None, 0.3, None, 0.3]
    assert many["speed m/s"] == pytest.approx([0.3] * 5)
    assert (few["count"], few["falls"]) == (FEWEST - 1, 0)
    assert few["falls at most"] == pytest.approx(1 - 0.05 ** (1 / (FEWEST - 1)))


def test_a_draw_is_named_with_what_happened():
    model = puppy_model().with_effects((EffectSpec("ground_friction", (), {"friction": 0.8}),
                                        EffectSpec("supply_voltage", (), {"voltage": 10.6})))
    assert describe_robot(model) == "friction 0.80, 10.6 V"
    fell = record_draw(model, replace(WALKED, fell=True, tilt=np.radians(141)), FEET, gave_up=True)
    touched = record_draw(model, WALKED, FEET, gave_up=True)
    told = summary(Request(), [record_draw(model, WALKED, FEET, gave_up=False), fell, touched])
    assert told["incidents"] == [
        {"draw": 2, "robot": "friction 0.80, 10.6 V", "what": "fell: tilt 141 deg"},
        {"draw": 3, "robot": "friction 0.80, 10.6 V",
         "what": "something other than a foot touched; it went on at 0.30 m/s, tilt 10 deg"}]
    assert touched.measure.touched
    assert not fell.measure.touched
    assert told["falls"] == 1


def test_slip_is_a_share_of_the_speed_at_which_feet_pass_under_the_body(machine):
    walk, turn, limits = Request(), Request(way="turn"), Request().limits
    assert slip_margin(machine, walk, WALKED) == Margin("slip", "robot", pytest.approx(10.0), 100 * limits.slip, "% of the speed",
                                                        pytest.approx(0.1 / limits.slip))
    assert slip_margin(machine, walk, WALKED, 0.5).limit == 50.0
    unseen = slip_margin(machine, walk, replace(WALKED, slip=np.nan))
    assert unseen == Margin("slip", "robot", 0.0, 100 * limits.slip, "% of the speed", 0.0)
    turning = replace(WALKED, velocity=(0.0, 0.0), turn_rate=-2.0)
    assert foot_speed(machine, turn, turning) == pytest.approx(2.0 * machine.arm)
    assert foot_speed(machine, walk, replace(WALKED, velocity=(0.3, -0.4))) == pytest.approx(0.5)
    assert slip_margin(machine, turn, turning).value == pytest.approx(100 * 0.03 / (2.0 * machine.arm))


def test_a_draw_has_the_clearance_and_slip_of_its_feet():
    feet = FeetMeasure(slip=0.07, clearance=0.002, tipping=0.3)
    kept = record_draw(puppy_model(), WALKED, feet, gave_up=False)
    assert (kept.measure.clearance, kept.measure.slip, kept.feet, kept.incident) == (0.002, 0.07, feet, "")
    assert kept.robot == "the nominal robot"


def test_a_robot_is_described_by_its_floor_and_supply_alone():
    model = puppy_model()
    sag = EffectSpec("supply_sag", (), {"drop": 0.25})
    one_foot = EffectSpec("coulomb_friction", (model.joints[0],), {"torque": 0.1})
    late = EffectSpec("timing_drift", (), {"per_pose": 0.003})
    assert describe_robot(model.with_effects((sag, one_foot, late))) == "0.25 V sag a servo"


def test_a_summary_has_these_numbers_of_robots_that_stand():
    """One of four robots fell: speeds and falls count all four, the other measures only those still standing."""
    turning = replace(WALKED, turn_rate=0.3 * np.radians(10.0))
    feet = FeetMeasure(slip=0.01, clearance=0.004, tipping=0.1)
    robots = [Drawn("r", WALKED, FEET), Drawn("r", turning, feet), Drawn("r", WALKED, FEET), Drawn("r", fallen(15), feet, "fell")]
    told = summary(Request(), robots)
    assert told["speed m/s"] == [0.0, None, pytest.approx(0.3), None, pytest.approx(0.3)]
    assert told["heading deg/m"] == [pytest.approx(0.0), None, pytest.approx(0.0), None, pytest.approx(10.0)]
    assert told["heading deg/m RMS"] == pytest.approx(10.0 / np.sqrt(3.0))
    assert told["worse half of speeds"] == pytest.approx(worse_half([0.3, 0.3, 0.3, 0.0]))
    assert told["slip m/s"][::2] == pytest.approx([0.01, 0.03, 0.03])
    assert told["foot clearance mm"][::2] == pytest.approx([4.0, 6.0, 6.0])
    assert told["tilt deg"][::2] == pytest.approx([10.0] * 3)
    assert told["tipping margin deg"][::2] == pytest.approx(np.degrees([0.1, 0.3, 0.3]))
    assert told["electrical power W"][::2] == [WALKED.power] * 3
    assert told["largest RMS torque N m"][::2] == pytest.approx([0.3] * 3)
    assert (told["count"], told["falls"], told["quantiles"]) == (4, 1, [0.0, 0.05, 0.5, 0.95, 1.0])
    assert told["incidents"] == [{"draw": 4, "robot": "r", "what": "fell"}]
    assert summary(Request(), []) == {"count": 0}


def test_where_all_fell_the_summary_is_of_these():
    told = summary(Request(), [Drawn("r", fallen(15), FEET)] * 2)
    assert (told["falls"], told["falls at most"], told["tilt deg"][0]) == (2, 1.0, pytest.approx(90.0))


def test_a_speed_has_to_be_kept_less_its_numerical_floor():
    asked = Request(speed=0.29)
    assert floor_margins(asked, WALKED, {"steps": 0.005})[0].use < 1
    assert floor_margins(asked, WALKED, {"steps": 0.02})[0].use > 1
    assert floor_margins(Request(), WALKED, {"steps": 0.02}) == []


def test_headings_are_compared_with_the_nominal_robots_which_is_trimmed():
    turns = replace(WALKED, turn_rate=0.3 * 0.5)
    assert heading_spread(Request(), turns, [turns, turns]) == pytest.approx(0.0)
    assert heading_spread(Request(), WALKED, [turns, turns]) == pytest.approx(0.5)


def test_few_robots_show_both_ends_of_floor_and_supply(tmp_path):
    model, ranges = puppy_model(), {"friction": (0.3, 0.9), "supply_voltage": (9.6, 12.0), "command_delay": (0.01, 0.02)}

    def values(even, effect, parameter):
        robots = Ensemble(ranges=ranges).draws(model, 8, 4, tmp_path, even)
        return np.array([e.parameters[parameter] for r in robots for e in r.effects if e.effect == effect])

    for effect, parameter, key in (("ground_friction", "friction", "friction"), ("supply_voltage", "voltage", "supply_voltage")):
        low, high = ranges[key]
        parts = [np.floor(8 * (values(even, effect, parameter) - low) / (high - low)) for even in (True, False)]
        assert sorted(parts[0]) == list(range(8))
        assert sorted(parts[1]) != list(range(8))
    assert (values(True, "command_delay", "delay") == values(False, "command_delay", "delay")).all()
