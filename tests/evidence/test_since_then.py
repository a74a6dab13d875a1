"""A robot that was diagnosed before: its numbers are as well known as they were then, and as far as they drift."""

import math

import numpy as np
import pytest

from tests.servo_rig import rig_model
from workbench.files import InputError
from workbench.identify.evidence.hypothesis import Uncertain, start
from workbench.identify.evidence.nuisance import mixing, recalibrate, uncertain_numbers, uncertain_since, widen, with_known
from workbench.identify.evidence.options import EvidenceOptions, SinceThen
from workbench.identify.evidence.recalibration import list_changes
from workbench.robot import ServoConstants, load_model
from workbench.robot.model_file import save_model
from workbench.robot.servo_constants import servo_constants

SINCE = SinceThen()


def known_after(tmp_path, covariance):
    """The numbers of tomorrow, and the model of today, whose numbers have this covariance of standard deviations."""
    model = rig_model(tmp_path, ServoConstants())
    numbers = uncertain_numbers(model, "j")
    save_model(with_known(model, numbers, covariance(numbers)), tmp_path / "out" / "model.yaml")
    return numbers, uncertain_since(load_model(tmp_path / "out" / "model.yaml"), "j", SINCE)


def test_what_a_diagnosis_knew_is_kept_in_its_model(tmp_path):
    _, now = known_after(tmp_path, lambda numbers: np.diag([0.04 / n.sd for n in numbers])**2)
    sds = {n.name: n.sd for n in now}
    assert sds["torque_at_full_duty"] == pytest.approx(math.hypot(0.04, SINCE.torque))
    assert sds["coulomb_friction"] == pytest.approx(math.hypot(0.04, SINCE.friction))
    assert sds["zero"] == pytest.approx(math.hypot(0.04, SINCE.zero))
    assert not any(n.others for n in now)


def test_what_was_known_together_stays_known_together(tmp_path):
    """Torque and friction each to a half, but their difference to a hundredth: so it is tomorrow, but for drift."""
    def only_together(numbers):
        torque, friction = ([n.name for n in numbers].index(name) for name in ("torque_at_full_duty", "coulomb_friction"))
        C = np.diag([1e-4 / n.sd**2 for n in numbers])
        along = np.zeros(len(numbers))
        along[[torque, friction]] = 0.5 / numbers[torque].sd, 0.5 / numbers[friction].sd
        return C + np.outer(along, along)

    _, now = known_after(tmp_path, only_together)
    M = mixing(now)
    C, names = M @ M.T, [n.name for n in now]
    apart = np.zeros(len(now))
    apart[[names.index("torque_at_full_duty"), names.index("coulomb_friction")]] = 1.0, -1.0
    assert np.sqrt(C[0, 0]) == pytest.approx(math.hypot(0.5, 0.01, SINCE.torque))
    assert np.sqrt(apart @ C @ apart) == pytest.approx(math.hypot(0.01, 0.01, SINCE.torque, SINCE.friction))


def test_numbers_move_together_in_the_robot(tmp_path):
    model = rig_model(tmp_path, ServoConstants())
    both = Uncertain("j", "torque_at_full_duty", 0.2, (("coulomb_friction", -0.1), ("zero", 0.01)))
    friction, zero = Uncertain("j", "coulomb_friction", 0.3), Uncertain("j", "zero", 0.02)
    moved = recalibrate(model, {both: 1.0, friction: 1.0, zero: -1.0})
    assert moved.servo("j").torque_at_full_duty == pytest.approx(model.servo("j").torque_at_full_duty * math.exp(0.2))
    assert moved.servo("j").coulomb_friction == pytest.approx(model.servo("j").coulomb_friction * math.exp(0.2))
    assert moved.effects[0].parameters["angle"] == pytest.approx(math.degrees(-0.01))
    said = {r.number: r for r in list_changes(model, start((both, friction, zero)).at(np.array([1.0, 1.0, -1.0])))}
    assert said["coulomb_friction"].sigmas * said["coulomb_friction"].sd == pytest.approx(
        moved.servo("j").coulomb_friction - model.servo("j").coulomb_friction)
    assert said["coulomb_friction"].sd == pytest.approx(math.hypot(0.1, 0.3) * model.servo("j").coulomb_friction)


def test_what_the_data_do_not_tell_is_widened_no_further_than_before():
    C = widen(np.diag([1.0, 0.01**2, 0.5]), 3.0)
    assert np.sqrt(np.diag(C)) == pytest.approx([1.0, 0.03, math.sqrt(0.9)], rel=1e-2)


@pytest.mark.parametrize(("content", "said"), [
    ({"names": ["torque"], "rows": [[1.0]]}, "covariance: names: expected a list of"),
    ({"names": ["zero"], "rows": [[1.0, 0.0]]}, "expected 1 rows of 1 numbers"),
    ({"names": ["zero", "back_emf"], "rows": [[1.0, 2.0], [2.0, 1.0]]}, "expected no negative variance"),
    ({"names": ["zero"], "rows": ["one"]}, "rows: expected lists of numbers"),
    (3.0, "expected {names: [...], rows: [[...], ...]}")])
def test_what_is_no_covariance_is_refused(tmp_path, content, said):
    servo = {k: v for k, v in ServoConstants().as_dict().items() if v is not None} | {"covariance": content}
    with pytest.raises(InputError) as e:
        servo_constants(servo, tmp_path / "servo.yaml")
    assert said in str(e.value)


def test_of_a_data_sheet_torque_is_known_to_its_tolerance_alone(tmp_path):
    def known(**constants):
        return {n.name: n.sd for n in uncertain_numbers(rig_model(tmp_path, ServoConstants(**constants)), "j")}

    assert known()["torque_at_full_duty"] == known()["back_emf"] == EvidenceOptions.sheet
    assert known(torque_tolerance=0.1)["torque_at_full_duty"] == 0.1
    assert known(sd=(("no_load_speed", 0.618),))["back_emf"] == pytest.approx(0.1)
