"""What inverse dynamics make of a model's effects: masses are in, the rest is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.gap_sessions import write_session
from workbench.compare.session import load_session
from workbench.dynamics import InverseDynamics
from workbench.dynamics.trajectory import RobotTrajectory
from workbench.robot import EffectSpec, RobotModel


def _held(model: RobotModel, angle: float) -> tuple[dict[str, float], tuple[str, ...]]:
    """Torques that hold the arm still with joint `one` at `angle` [rad], and the warnings."""
    machine = InverseDynamics(model, "fixed")
    q = np.zeros((1, 3))
    q[0, model.joints.index("one")] = angle
    result = machine.of(RobotTrajectory.at_rest(model.joints, q))
    return dict(zip(result.joints, result.torque[0])), result.problems


def test_a_payload_is_held_and_friction_is_named(tmp_path: Path) -> None:
    model = load_session(write_session(tmp_path)).model
    nominal, quiet = _held(model, 0.5)
    loaded, said = _held(model.with_effect(EffectSpec("payload", ("lower",), {"mass": 0.2, "position": (0.0, 0.0, 0.05)}))
                         .with_effect(EffectSpec("coulomb_friction", ("two",), {"torque": 0.1})), 0.5)
    assert quiet == ()
    assert said == ("coulomb_friction: not in the inverse dynamics; only effects on masses are",)
    # lower's frame is 0.16 m beyond joint one (0.2 to 0.36 m high), and 0.08 m beyond joint two
    for joint, arm in (("one", 0.16 + 0.05), ("two", 0.08 + 0.05)):
        assert loaded[joint] - nominal[joint] == pytest.approx(-0.2 * 9.81 * arm * np.sin(0.5), rel=1e-6)
