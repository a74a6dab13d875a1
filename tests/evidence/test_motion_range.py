"""How fast a joint moved when its servo was diagnosed: beyond that, a finding need not be a change."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.evidence.rig_logs import record
from tests.servo_rig import rig_model
from workbench.files import InputError
from workbench.identify.diagnosis import diagnose_session
from workbench.identify.evidence.motion_range import join_ranges, range_of, tell_faster
from workbench.identify.evidence.nuisance import uncertain_numbers, with_known
from workbench.identify.evidence.options import RangeOptions
from workbench.robot import EffectSpec, ServoConstants, load_model
from workbench.robot.law_covariance import MotionRange
from workbench.robot.model_file import save_model
from workbench.robot.servo_constants import servo_constants

SLOW, FAST = MotionRange(100.0, 500.0, 0.4), MotionRange(110.0, 2500.0, 0.4)


def evidence(rate: float, lost: bool = False, frame: float = 0.01):
    """A take in which a joint swings by 0.5 rad at `rate` [rad/s], seen with a servo's counts."""
    time = np.arange(0.0, 4.0, frame)
    q = np.round(0.5 * np.sin(rate * time) / 1.5e-3) * 1.5e-3
    q[100:130] = np.nan if lost else q[100:130]
    uses = {"fit": np.ones(len(time), dtype=bool), "choose": np.zeros(len(time), dtype=bool)}
    commands = SimpleNamespace(joints=("j",), times=time, goals=(q + 0.02)[:, None])
    take = SimpleNamespace(commands=commands, spec=SimpleNamespace(robot=lambda model: model))
    return SimpleNamespace(channels=("j",), uses=uses, recorded=q[:, None], since=time, take=take, moving=uses["fit"])


@pytest.mark.parametrize(("rate", "frame"), [(3.0, 0.01), (6.0, 0.01), (6.0, 0.02)])
@pytest.mark.parametrize("lost", [False, True])
def test_speed_and_acceleration_are_those_of_the_motion(tmp_path, rate, frame, lost, monkeypatch):
    monkeypatch.setattr("workbench.identify.evidence.torque_law.frames", lambda e: e.moving)
    found = range_of("j", [evidence(rate, lost, frame)], rig_model(tmp_path, ServoConstants()), RangeOptions())
    assert found.speed == pytest.approx(np.degrees(0.5 * rate), rel=0.06)
    assert found.acceleration == pytest.approx(np.degrees(0.5 * rate**2), rel=0.15)
    assert 0.0 < found.duty <= 1.0


def test_a_joint_that_nobody_saw_has_no_range(tmp_path):
    assert range_of("k", [evidence(3.0)], rig_model(tmp_path, ServoConstants()), RangeOptions()) is None
    assert join_ranges(None, None) is None
    assert join_ranges(None, SLOW) == join_ranges(SLOW, None) == SLOW
    assert join_ranges(SLOW, FAST) == FAST


def test_only_a_faster_motion_is_told():
    assert tell_faster("j", None, FAST, 1.5) == tell_faster("j", SLOW, None, 1.5) == ""
    assert tell_faster("j", FAST, SLOW, 1.5) == tell_faster("j", SLOW, SLOW, 1.5) == ""
    said = tell_faster("j", SLOW, FAST, 1.5)
    assert "was so before" in said
    assert "100 deg/s, 500 deg/s^2 and 40 % duty, and it moves at up to 110 deg/s, 2500 deg/s^2" in said


def test_the_range_is_kept_in_the_model(tmp_path):
    model = rig_model(tmp_path, ServoConstants())
    numbers = uncertain_numbers(model, "j")
    for observed in (SLOW, None):
        known = with_known(model, numbers, 0.1 * np.eye(len(numbers)), {"j": observed})
        save_model(known, tmp_path / "out" / "model.yaml")
        assert load_model(tmp_path / "out" / "model.yaml").servo("j").covariance.observed == observed


@pytest.mark.parametrize(("observed", "said"), [
    ({"speed": 1.0}, "covariance: observed: expected {speed: ..., acceleration: ..., duty: ...}"),
    ({"speed": -1.0, "acceleration": 1.0, "duty": 1.0}, "observed: speed: expected a non-negative number, got -1.0"),
    ({"speed": 1.0, "acceleration": "fast", "duty": 1.0}, "observed: acceleration: expected a non-negative number, got 'fast'")])
def test_what_is_no_range_is_refused(tmp_path, observed, said):
    known = {"covariance": {"names": ["zero"], "rows": [[1.0]], "observed": observed}}
    with pytest.raises(InputError) as e:
        servo_constants(ServoConstants().as_dict() | known, tmp_path / "servo.yaml")
    assert said in str(e.value)


@pytest.mark.slow
def test_what_only_faster_motions_show_is_no_sure_change(tmp_path):
    """A friction of slow motions that nothing has changed since is named by even odds at most where motions are three times as
    fast, and surely where they are not."""
    worn = EffectSpec("coulomb_friction", ("j",), {"torque": 0.08})
    for name in ("before", "faster", "again"):
        (tmp_path / name).mkdir()
    before = diagnose_session(record(tmp_path / "before"), n_jobs=1).diagnosis.model
    assert before.servo("j").covariance.observed is not None
    for name, faster in (("faster", 3.0), ("again", 1.0)):
        session = record(tmp_path / name, [worn], seed=1, faster=faster)
        save_model(before, tmp_path / name / "model.yaml")
        told = diagnose_session(session, n_jobs=1, previous=load_model(tmp_path / name / "model.yaml")).diagnosis
        found = {f.effect: f for f in told.findings}["coulomb_friction"]
        assert ("was so before" in found.evidence) == (faster > 1.0)
        assert (found.confidence > 0.9) == (faster == 1.0)
        assert found.confidence < 0.5 or faster == 1.0
