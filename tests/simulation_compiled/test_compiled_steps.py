"""One step of the compiled station against Drake's own, from states of Drake's rollouts: any wrong term shows at once."""

from __future__ import annotations

import numpy as np
import pytest

from tests.simulation_compiled.drake_steps import CompiledSteps, config_for, drake_steps, typical
from tests.test_effects_structure import ARM, INERTIAL
from workbench.effects.registry import known_effects
from workbench.robot import Ground, RobotModel, ServoConstants, puppy_model
from workbench.simulation.compiled.tables import NotCoveredError

MEDIAN, MOST = 1e-8, 1e-4
"""Of differences of velocities [rad/s, m/s]: half of all steps, and 99 in 100, are nearer."""
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


@pytest.mark.parametrize("base", ["free", "fixed"])
def test_the_puppy_moves_by_drakes_steps(base):
    check(differences(puppy_model(), base))


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
