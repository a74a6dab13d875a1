"""The station in all its configurations, on the puppy that ships."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.common.yaml import yaml_dump_typed, yaml_load_typed

from workbench.files import InputError
from workbench.motion import load_motion
from workbench.robot import EffectSpec, Ground, ServoConstants, data_file, puppy_model
from workbench.simulation import Job, MakeStation, Simulation, SimulationConfig, simulate_batch

GRAVITY = 9.81


@pytest.fixture(scope="module")
def puppy():
    return puppy_model()


@pytest.fixture(scope="module")
def walk(puppy):
    return load_motion(data_file("robotis_walk.csv"), puppy).commands(2)


@pytest.fixture(scope="module")
def station(puppy):
    return Simulation(puppy)


@pytest.fixture(scope="module")
def walked(station, walk):
    return station.run(walk, 0.6)


def same(a, b):
    return all(np.array_equal(getattr(a, f), getattr(b, f)) for f in ("time", "q", "v", "p_WB", "quat_WB", "torque"))


@pytest.mark.parametrize("contact", ["point", "hydroelastic"])
def test_stands_on_its_feet_with_its_whole_weight(puppy, contact):
    take = Simulation(puppy, SimulationConfig(contact=contact)).run(duration=0.2, lead=0.0)
    weight = sum(puppy.kinematics.masses.values()) * GRAVITY
    force = sum(take.contact.values())
    np.testing.assert_allclose(force[:, 2], weight, rtol=0.01)
    assert np.abs(take.q - take.q[0]).max() < 1e-4
    assert {foot for foot, f in take.contact.items() if f[-1, 2] > 0.1 * weight} == {"blb", "brb", "flb", "frb"}


def test_a_station_run_again_and_a_new_one_give_the_same_to_the_bit(puppy, station, walk, walked):
    assert same(walked, station.run(walk, 0.6))
    assert same(walked, Simulation(puppy).run(walk, 0.6))


def test_a_run_leaves_the_takes_before_it_alone(station, walk, walked):
    before = {f: getattr(walked, f).copy() for f in ("q", "v", "p_WB", "quat_WB")}
    station.run(duration=0.6)
    assert all(np.array_equal(getattr(walked, f), b) for f, b in before.items())


def test_starts_where_it_is_told(puppy):
    fixed = Simulation(puppy, SimulationConfig(base="fixed"))
    q, v = np.zeros(15), np.zeros(15)
    q[puppy.joints.index("head")], v[puppy.joints.index("head")] = 0.4, 1.0
    take = fixed.run(duration=0.05, start=(q, v))
    assert take.time[0] == 0
    assert take.q[0, take.column("head")] == 0.4
    assert take.v[0, take.column("head")] == 1.0
    assert fixed.run(duration=0.05).q[-1, take.column("head")] == pytest.approx(0, abs=0.05)
    with pytest.raises(InputError, match="held base"):
        Simulation(puppy).run(duration=0.05, start=(q, v))


def test_rests_before_the_first_command(walked):
    assert walked.time[0] == pytest.approx(-0.1)
    assert walked.resting.sum() == 100
    assert np.ptp(walked.q[walked.resting], axis=0).max() < 1e-4
    assert walked.zeroed_at_rest().q[walked.resting].mean(axis=0) == pytest.approx(0, abs=1e-9)


def test_joints_follow_their_reference_within_what_the_law_allows(walked, walk):
    late = walked.time > 0.1
    error = walk.reordered(walked.joints).reference(walked.time[late]) - walked.q[late]
    assert np.abs(error).max() < np.radians(20)
    assert np.abs(error).max() > np.radians(1)  # a servo is not ideal


def test_torque_stays_below_what_the_servo_has(walked):
    servo = ServoConstants()
    limit = servo.torque_at_full_duty + servo.coulomb_friction + servo.back_emf * np.abs(walked.v)
    assert (np.abs(walked.torque) <= limit + 1e-6).all()


def test_fixed_base_stays_level_and_away_from_the_ground(puppy, walk):
    take = Simulation(puppy, SimulationConfig(base="fixed")).run(walk, 0.3)
    assert np.ptp(take.p_WB, axis=0).max() == 0
    np.testing.assert_array_equal(take.quat_WB[-1], [1, 0, 0, 0])
    assert take.contact == {}


def test_base_moves_along_a_recorded_path(puppy, walk, walked):
    take = Simulation(puppy, SimulationConfig(base="path")).run(walk, 0.6, path=walked)
    np.testing.assert_allclose(take.p_WB, walked.p_WB, atol=1e-3)
    assert np.abs((take.quat_WB * walked.quat_WB).sum(axis=1)).min() > 1 - 1e-5


def test_ideal_drive_follows_and_reports_the_torque_it_took(puppy):
    t = np.linspace(0, 1, 1001)
    q = np.zeros((len(t), 15))
    q[:, puppy.joints.index("head")] = 0.3 * (1 - np.cos(2 * np.pi * t))
    take = Simulation(puppy, SimulationConfig(drive="ideal", base="fixed")).run(trajectory=(t, q))
    head = np.interp(take.time, t, q[:, puppy.joints.index("head")])
    np.testing.assert_allclose(take.q[:, take.column("head")], head, atol=1e-3)
    assert 0.01 < np.abs(take.torque[:, take.column("head")]).max() < 1.0


def test_ideal_drive_through_poses_is_smooth(puppy, walk):
    take = Simulation(puppy, SimulationConfig(drive="ideal", base="fixed")).run(walk, 0.6)
    arrival = np.searchsorted(take.time, walk.times[1])
    np.testing.assert_allclose(take.q[arrival], walk.reordered(take.joints).goals[0], atol=0.02)
    assert np.abs(take.torque).max() < 20  # no corner in the path


def test_playback_shows_a_take_as_it_was(puppy, walked):
    holed = replace(walked, q=np.where(np.arange(15) == 3, np.nan, walked.q))
    shown = Simulation(puppy, SimulationConfig(drive="playback")).play_back(holed)
    np.testing.assert_array_equal(shown.q[:, 4], walked.q[:, 4])
    np.testing.assert_array_equal(shown.p_WB, walked.p_WB)
    assert (shown.q[:, 3] == 0).all()
    with pytest.raises(InputError, match="play_back"):
        Simulation(puppy, SimulationConfig(drive="playback")).run(duration=0.1)


def test_the_fast_servo_is_the_full_law_where_that_is_proportional(puppy, walk):
    proportional = ServoConstants(compliance_slope=None, compliance_margin=None, punch=None, proportional_gain=5.0)
    model = replace(puppy, servos=dict.fromkeys(puppy.joints, proportional))
    full, fast = (Simulation(model, SimulationConfig(drive=d, base="fixed")).run(walk, 0.6) for d in ("servo", "fast_servo"))
    assert np.degrees(np.abs(full.q - fast.q).max()) < 0.35  # the step: explicit against implicit
    finer = [Simulation(model, SimulationConfig(drive=d, base="fixed", time_step=2.5e-4)).run(walk, 0.6)
             for d in ("servo", "fast_servo")]
    assert np.abs(finer[0].q - finer[1].q).max() < 0.5 * np.abs(full.q - fast.q).max()


def test_the_fast_servo_errs_little_on_a_compliance_law(puppy, walk):
    full, fast = (Simulation(puppy, SimulationConfig(drive=d, base="fixed")).run(walk, 0.6) for d in ("servo", "fast_servo"))
    rms = np.degrees(np.sqrt(np.mean(np.square(full.q - fast.q))))
    assert 0.01 < rms < 0.1


@pytest.mark.parametrize("config", [{"time_step": 0.0, "integrator": "cenic", "accuracy": 1e-3}, {"approximation": "sap"}])
def test_other_solvers_agree_on_a_robot_held_in_the_air(puppy, walk, config):
    reference = Simulation(puppy, SimulationConfig(base="fixed")).run(walk, 0.4)
    other = Simulation(puppy, SimulationConfig(base="fixed", **config)).run(walk, 0.4)
    assert np.degrees(np.sqrt(np.mean(np.square(reference.q - other.q)))) < 0.3


def test_batches_give_the_same_takes_on_one_and_two_processes(puppy, walk):
    jobs = [Job(puppy, SimulationConfig(base="fixed"), walk, 0.1 * (1 + i % 2), name=str(i)) for i in range(4)]
    seen = []
    one = simulate_batch(jobs, n_jobs=1)
    two = simulate_batch(jobs, n_jobs=2, progress=lambda done, total: seen.append((done, total)))
    assert [t.name for t in two] == ["0", "1", "2", "3"]
    assert all(same(a, b) for a, b in zip(one, two))
    assert seen == [(i, 4) for i in (1, 2, 3, 4)]


def test_friction_of_the_ground_overrides_the_sdf(puppy):
    inspector = MakeStation(replace(puppy, ground=Ground(friction=0.3))).scene_graph().model_inspector()
    coefficients = {inspector.GetProximityProperties(g).GetProperty("material", "coulomb_friction").dynamic_friction()
                    for g in inspector.GetAllGeometryIds() if inspector.GetProximityProperties(g) is not None}
    assert coefficients == {0.3}


def test_feet_touch_with_one_set_of_shapes(puppy):
    for contact, present, absent in (("point", "foot_sphere", "foot_hydro"), ("hydroelastic", "foot_hydro", "foot_sphere")):
        inspector = MakeStation(puppy, SimulationConfig(contact=contact)).scene_graph().model_inspector()
        names = [inspector.GetName(g) for g in inspector.GetAllGeometryIds() if inspector.GetProximityProperties(g) is not None]
        assert any(present in n for n in names)
        assert not any(absent in n for n in names)


def test_ports_are_named(puppy):
    diagram = MakeStation(puppy_model())
    assert diagram.GetInputPort("goal_position").size() == 15
    for port in ("state", "motor_torque", "duty", "reference", "net_actuation", "contact_results"):
        assert diagram.HasOutputPort(port)
    assert all(not s.get_name().startswith("drake/") for s in diagram.GetSystems())


def test_refuses_what_it_cannot_do(puppy):
    with pytest.raises(InputError, match="soft_rain"):
        Simulation(puppy.with_effect(EffectSpec("soft_rain")))
    with pytest.raises(InputError, match="no link 'trunk'"):
        Simulation(puppy_model(base="trunk"))
    with pytest.raises(InputError, match="cannot float"):
        Simulation(puppy_model(base="tail_link"))
    with pytest.raises(InputError, match="contact: expected one of point, hydroelastic"):
        SimulationConfig(contact="magic")


def test_configuration_goes_through_yaml():
    config = SimulationConfig(time_step=5e-4, contact="hydroelastic")
    assert yaml_load_typed(schema=SimulationConfig, data=yaml_dump_typed(config)) == config


def test_a_robot_that_cannot_be_built_is_named_from_another_process():
    bad = replace(puppy_model(), effects=(EffectSpec("joint_stop", ("flm",), {"lower": 20.0, "upper": 10.0}),))
    walk = load_motion(data_file("robotis_walk.csv"), bad).commands(1)
    with pytest.raises(InputError, match="stop of 'flm': expected lower below upper"):
        simulate_batch([Job(bad, SimulationConfig(base="fixed"), walk, 0.05, name=name) for name in "ab"], n_jobs=2)
