"""The next experiment: commands within the robot's limits, rivals that imitate an effect, and a motion that separates the two."""

import numpy as np
import pytest

from tests.gap_sessions import write_session
from workbench.compare.session import load_session
from workbench.device.tables.limits import check_limits
from workbench.experiment.design import Experiment, ObservationModel, Separation, design_experiment
from workbench.experiment.limits import Reach
from workbench.experiment.moves import JointMoves, Path, gravity_torque, long_runs
from workbench.experiment.projection import PairChannels
from workbench.experiment.rivals import Pair
from workbench.experiment.segment import join
from workbench.experiment.stance import BodyMoves
from workbench.motion import Motion, load_motion, save_motion
from workbench.robot import EffectSpec, foot_points, puppy_model


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return load_session(write_session(tmp_path_factory.mktemp("arm"))).model


@pytest.fixture(scope="module")
def puppy():
    model = puppy_model()
    return model, Reach(model)


def test_all_pieces_keep_the_servos_limits_and_begin_and_end_in_neutral(puppy):
    model, reach = puppy
    pieces = [*JointMoves(model, reach, ["flb"]).segments(), *JointMoves(model, reach, ["flm", "frb"]).segments(),
              *long_runs(model, reach, ["flb", "frb"], 12.0), *BodyMoves(model, reach).segments()]
    assert len(pieces) > 20
    for s in [*pieces, join(pieces[:3])]:
        table = Motion(s.name, s.times, model.joints, s.angles).as_table()
        assert [v for v in check_limits(table, model) if not v.warning] == [], s.name
        assert not s.angles[[0, -1]].any(), s.name


def test_no_leg_is_sent_into_another(puppy):
    model, reach = puppy
    q = np.zeros((2, len(model.joints)))
    for joint, angle in (("flt", 40), ("frt", 40)):  # about one axis: one of the two brings legs together
        q[0, model.joints.index(joint)] = np.radians(angle) * (1 if joint == "flt" else -1)
        q[1, model.joints.index(joint)] = np.radians(angle) * (-1 if joint == "flt" else 1)
    assert sorted(reach.clear(q)) == [False, True]
    closing = Path(model.joints, reach.speeds).to({j: q[list(reach.clear(q)).index(False), model.joints.index(j)]
                                                   for j in ("flt", "frt")}).home().segment("closing")
    smaller = reach.scaled_clear(closing)
    assert smaller is None or 0 < np.abs(smaller.angles).max() < np.radians(40)


def test_gravity_pulls_on_a_joint_as_drake_says(puppy):
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    from workbench.robot import ConfigureParser

    model, _ = puppy
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    ConfigureParser(parser)
    parser.AddModels(model.path)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(model.base))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    q = np.random.default_rng(0).uniform(-1, 1, (1, len(model.joints)))
    for j, angle in zip(model.joints, q[0]):
        plant.GetJointByName(j).set_angle(context, angle)
    forces = plant.CalcGravityGeneralizedForces(context)
    for j in ("flb", "blm", "tail", "frt"):
        expected = forces[plant.GetJointByName(j).velocity_start()]
        assert gravity_torque(model, j, q)[0] == pytest.approx(expected, abs=1e-9)


def test_the_body_goes_down_and_the_feet_stay(puppy, arm):
    model, reach = puppy
    moves = BodyMoves(model, reach)
    pose = moves._pose((0.0, 0.0, -0.15, 0.0, 0.0, 0.0))
    k = model.kinematics
    assert set(foot_points(model)) <= set(pose)
    for foot in foot_points(model):
        link = model.foot_links[foot]
        point = foot_points(model)[foot][0].mean(axis=0)
        at = []
        for q in ({}, pose):
            p, R = k.forward(np.array([[q.get(j, 0.0) for j in model.joints]]), model.joints)[link]
            at.append(p[0] + R[0] @ point)
        assert at[1] - at[0] == pytest.approx([0, 0, 0.15 * moves._length], abs=5e-4)
    assert BodyMoves(arm, Reach(arm)).segments() == []


def shown(a, b, of_a, of_b):
    n = len(a)
    return PairChannels(np.array(a, float), np.array(b, float), np.array(of_a, float), np.array(of_b, float), np.zeros((n, 0)),
                        np.zeros(n, dtype=int), np.ones(n), np.ones(n))


def test_a_difference_that_a_rival_can_imitate_does_not_count():
    """a less b is (30, 40); the second can add to its first entry for a price, the first can do nothing."""
    show = shown([30, 40], [0, 0], np.zeros((2, 0)), [[30], [0]])
    assert show.closest("a").cost == pytest.approx(2500)
    end = show.closest("b")
    x = 900 / 901
    assert end.x == pytest.approx([x])
    assert end.left == pytest.approx([30 - 30 * x, 40])
    assert show.chi_squared() == end.cost == pytest.approx((30 - 30 * x) ** 2 + 1600 + x**2)
    both = PairChannels.join([show, shown([0, 0], [0, 0], np.zeros((2, 0)), [[300], [0]])])
    assert both.chi_squared() > 2480, "what imitates in one piece gives itself away in the next"


def test_only_what_differs_adapts(arm):
    shared = EffectSpec("coulomb_friction", ("one",), {"torque": 0.05})
    gain, spring = EffectSpec("servo_gain", ("two",), {"ratio": 0.5}), EffectSpec("payload", ("lower",), {
        "mass": 0.1, "position": (0.0, 0.01, 0.04)})
    pair = Pair.of(arm.with_effect(shared).with_effect(gain), arm.with_effect(spring).with_effect(shared))
    assert pair.names == ("servo_gain", "payload")
    assert len(pair.neighbours) == 1 + 4
    assert pair.a.freedom == pytest.approx([0.25]), "half of the missing gain"
    moved = pair.b.move(np.array([1.0, 0, 0, -1.0]))
    assert moved.model.effects[0].parameters["mass"] == pytest.approx(0.15)
    assert moved.model.effects[1] == shared
    assert pair.a.move(np.array([-100.0])).model.effects[1].parameters["ratio"] == 0.05, "as far as is possible"


def test_a_rival_takes_away_no_more_friction_than_there_is(arm):
    nominal = arm.servo("one").coulomb_friction
    less = arm.with_effect(EffectSpec("coulomb_friction", ("one",), {"torque": -0.5 * nominal}))
    rival = Pair.of(less, arm).a
    for x, torque in ((-200.0, -nominal), (200.0, 1.5)):
        assert rival.move(np.array([x])).model.effects[0].parameters["torque"] == pytest.approx(torque)


def test_a_flatter_law_and_a_softer_joint_are_told_apart(arm, tmp_path):
    rivals = [(arm.with_effect(EffectSpec("servo_gain", ("two",), {"ratio": 0.5})),
               arm.with_effect(EffectSpec("joint_compliance", ("two",), {"stiffness": 6.0})))]
    observations = {"fixed": ObservationModel(dict.fromkeys(arm.joints, np.radians(0.2)), captured=True, rate=60.0)}
    said: list[str] = []
    experiment = design_experiment(arm, rivals, observations, n_jobs=1, progress=lambda what, share: said.append(what))
    (found,) = experiment.separations
    assert found.effects == ("servo_gain", "joint_compliance")
    assert found.separated
    assert found.where == "two"
    assert found.in_sigma > 0.5
    assert 1 < experiment.motion.duration <= 12
    assert [v for v in check_limits(experiment.motion.as_table(), arm) if not v.warning] == []
    entry = experiment.entry()
    assert entry is not None
    assert entry.to_json() == {"motion": "next_experiment.csv", "base": "fixed",
                               "separates": [["servo_gain", "joint_compliance"]]}
    save_motion(experiment.motion, tmp_path / "next_experiment.csv")
    assert len(load_motion(tmp_path / "next_experiment.csv", arm).times) == len(experiment.motion.times)
    assert said


def test_what_a_held_base_carries_shows_nowhere(arm):
    rivals = [(arm.with_effect(EffectSpec("payload", ("trunk",), {"mass": 0.2, "position": (0.0, 0.0, 0.05)})),
               arm.with_effect(EffectSpec("com_shift", ("trunk",), {"offset": (0.02, 0.0, 0.0)})))]
    observations = {"fixed": ObservationModel(dict.fromkeys(arm.joints, np.radians(0.2)), captured=False, rate=60.0)}
    experiment = design_experiment(arm, rivals, observations, n_jobs=1)
    assert not experiment.separations[0].separated
    assert experiment.entry() is None
    with pytest.raises(ValueError, match="at least one pair"):
        design_experiment(arm, [], observations)


def test_an_entry_names_only_what_is_separated(arm):
    rest = Motion("rest", np.array([0.0, 1.0]), arm.joints, np.zeros((2, len(arm.joints))))
    experiment = Experiment(rest, "fixed", (Separation(("a", "b"), "one", 2.0, 30.0), Separation(("a", "c"), "one", 0.1, 0.4)))
    entry = experiment.entry("motion.csv")
    assert entry is not None
    assert entry.separates == (("a", "b"),)
