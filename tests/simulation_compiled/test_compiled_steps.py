"""One step of the compiled station against Drake's own, from states of Drake's rollouts: any wrong term shows at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studies.concealed_effects.robots import quadruped
from tests.effects.test_structure import ARM, INERTIAL
from tests.shared_data import practice
from tests.simulation_compiled.drake_steps import CompiledSteps, config_for, drake_steps, typical
from workbench.compare.session import load_session
from workbench.effects.registry import known_effects
from workbench.robot import Ground, RobotModel, ServoConstants, data_file, load_model, puppy_model
from workbench.simulation.compiled.tables import NotCoveredError

MEDIAN, MOST = 1e-8, 1e-4
"""Upper bounds on the median and the 99th percentile of velocity differences [rad/s, m/s]."""
KNOWN_TO_DRAKE_ALONE: set[str] = set()


def differences(model: RobotModel, base: str, seed: int = 0, count: int = 90, **how) -> np.ndarray:
    """The greatest difference of the plant's states of each step."""
    config = config_for(base)
    compiled = CompiledSteps(model, config)
    return np.array([np.abs(compiled.after(s) - s.after).max() for s in drake_steps(model, config, seed, count, **how)])


def check(apart: np.ndarray) -> None:
    assert np.median(apart) < MEDIAN
    assert np.quantile(apart, 0.99) < MOST


@pytest.fixture
def arm(tmp_path) -> RobotModel:
    path = tmp_path / "arm.sdf"
    path.write_text(ARM.format(inertial=INERTIAL))
    servo = ServoConstants(compliance_slope=None, compliance_margin=None, punch=None, proportional_gain=8.0)
    return RobotModel(str(path), base="base", servos=dict.fromkeys("abc", servo))


FOOT = ('<collision name="foot"><pose>0 0 -0.05 0 0 0</pose><geometry><sphere><radius>0.01</radius></sphere></geometry>'
        "<drake:proximity_properties><drake:point_contact_stiffness>1e5</drake:point_contact_stiffness>"
        "<drake:hunt_crossley_dissipation>20</drake:hunt_crossley_dissipation><drake:mu_dynamic>0.6</drake:mu_dynamic>"
        "<drake:mu_static>0.6</drake:mu_static></drake:proximity_properties></collision>")


def random_tree(random: np.random.Generator, folder: Path) -> RobotModel:
    """Three to eight links of random masses, each on a random one of those before it, about a random axis; the last is a foot."""
    count = int(random.integers(3, 9))
    links, joints = [_link("trunk", "<pose>0 0 0.3 0 0 0</pose>", "0 0 0", 0.8, np.full(3, 2e-3))], []
    for k in range(count):
        parent = "trunk" if k == 0 else random.choice(["trunk", *(f"l{i}" for i in range(k))])
        at, turn = random.uniform(-0.06, 0.06, 3), random.uniform(-1.0, 1.0, 3)
        inertia = random.uniform(1e-4, 2e-4, 3)  # any two are more than the third
        pose = f'<pose relative_to="{parent}">{_row(at)} {_row(turn)}</pose>'
        links.append(_link(f"l{k}", pose, _row(at / 3), random.uniform(0.05, 0.2), inertia, FOOT if k == count - 1 else ""))
        axis = random.normal(size=3)
        joints.append(f'<joint name="j{k}" type="revolute"><parent>{parent}</parent><child>l{k}</child>'
                      f"<axis><xyz>{_row(axis / np.linalg.norm(axis))}</xyz></axis></joint>")
    path = folder / "tree.sdf"
    path.write_text('<?xml version="1.0"?><sdf version="1.9" xmlns:drake="http://drake.mit.edu"><model name="tree">'
                    f"{''.join(links + joints)}</model></sdf>")
    return RobotModel(str(path), base="trunk", servos={f"j{k}": ServoConstants() for k in range(count)},
                      ground=Ground(friction=0.6, stiffness=1e5, dissipation=20.0))


def _link(name: str, pose: str, center: str, mass: float, inertia: np.ndarray, shape: str = "") -> str:
    moments = "".join(f"<{axis}>{value:.3e}</{axis}>" for axis, value in zip(("ixx", "iyy", "izz"), inertia))
    return (f'<link name="{name}">{pose}<inertial><pose>{center} 0 0 0</pose><mass>{mass:.3f}</mass>'
            f"<inertia>{moments}</inertia></inertial>{shape}</link>")


def _row(values: np.ndarray) -> str:
    return " ".join(f"{v:.4f}" for v in values)


@pytest.mark.parametrize("base", ["free", "fixed"])
def test_the_puppy_moves_by_drakes_steps(base):
    check(differences(puppy_model(), base))


def test_the_fox_moves_by_drakes_steps():
    check(differences(load_model(data_file("fox/model.yaml")), "free"))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_quadruped_of_other_masses_and_lengths_moves_by_drakes_steps(seed, tmp_path):
    check(differences(quadruped(np.random.default_rng(seed)).model(tmp_path / "robot.sdf"), "free", seed=seed, count=60))


@pytest.mark.parametrize("session", ["p0_nothing_hidden", "p3_payload", "p6_stiff_gearbox"])
def test_a_practice_robot_moves_by_drakes_steps(session):
    model = load_session(practice(session)).model
    check(differences(model, "free", count=60))


@pytest.mark.parametrize("base", ["free", "fixed"])
@pytest.mark.parametrize("seed", range(4))
def test_a_random_tree_moves_by_drakes_steps(seed, base, tmp_path):
    check(differences(random_tree(np.random.default_rng(seed), tmp_path), base, seed=seed, count=60, swing=0.8))


@pytest.mark.parametrize("changed", [
    pytest.param(lambda plant: plant.set_stiction_tolerance(1.1e-4), id="stiction tolerance 1.1e-4 for 1e-4"),
    pytest.param(lambda plant: plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -9.809]), id="gravity 9.809 for 9.81"),
])
def test_a_constant_that_drake_has_otherwise_fails_it(changed):
    """The test above is sharp enough: a tenth of the stiction tolerance, and a ten thousandth of gravity, do not pass."""
    with pytest.raises(AssertionError):
        check(differences(puppy_model(), "free", count=45, changed=changed))


def test_an_arm_with_springs_and_stops_moves_by_drakes_steps(arm):
    check(differences(arm, "fixed", swing=1.5))


def test_servos_that_are_switched_off_let_go(arm):
    check(differences(puppy_model(), "fixed", switched=True))


def effects_and_places():
    model = puppy_model()
    by_kind = {"joint": ("flm",), "foot": ("frb",), "link": ("fl_link",), "robot": (), "rigid_body": ()}
    for name, effect in sorted(known_effects().items()):
        if effect.layer in ("measurement", "timing"):
            continue  # they change no step
        kind = effect.places[0]
        where = by_kind[kind] if kind != "link" else (model.kinematics.frames["flm"].child,)
        yield pytest.param(effect, where, id=name)


@pytest.mark.parametrize(("effect", "where"), list(effects_and_places()))
def test_each_effect_is_in_the_step(effect, where):
    model = puppy_model(ground=Ground(friction=0.6, stiffness=1e5, dissipation=20.0)).with_effect(typical(effect, where))
    try:
        check(differences(model, "free", count=45))
    except NotCoveredError:
        assert effect.name in KNOWN_TO_DRAKE_ALONE


def test_effects_of_joints_are_in_the_steps_of_a_held_robot_all_at_once():
    model = puppy_model()
    joints = iter(model.joints)
    for _, effect in sorted(known_effects().items()):
        where = next(joints, None) if effect.places[0] == "joint" and effect.layer in ("actuator", "structure") else None
        if where is not None:
            model = model.with_effect(typical(effect, (where,)))
    assert len(model.effects) > 10
    check(differences(model, "fixed"))
