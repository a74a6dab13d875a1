"""A robot that was diagnosed before: its numbers are as well known as they were then, and as far as they drift."""

import math

import pytest

from tests.servo_rig import rig_model
from workbench.identify.evidence.nuisance import uncertain_numbers, uncertain_since, with_known
from workbench.identify.evidence.options import EvidenceOptions, SinceThen
from workbench.robot import ServoConstants, load_model
from workbench.robot.model_file import save_model

SINCE = SinceThen()


def test_what_a_diagnosis_knew_is_kept_in_its_model_and_widened(tmp_path):
    model = rig_model(tmp_path, ServoConstants())
    known = with_known(model, dict.fromkeys(uncertain_numbers(model, "j", zeroed=False), 0.04))
    save_model(known, tmp_path / "out" / "model.yaml")
    now = {n.name: n.sd for n in uncertain_since(load_model(tmp_path / "out" / "model.yaml"), "j", False, SINCE)}
    assert now["torque_at_full_duty"] == pytest.approx(math.hypot(3 * 0.04, SINCE.torque))
    assert now["coulomb_friction"] == pytest.approx(math.hypot(3 * 0.04, SINCE.friction))
    assert now["zero"] == pytest.approx(SINCE.zero)


def test_of_a_data_sheet_torque_is_known_to_its_tolerance_alone(tmp_path):
    def known(**constants):
        return {n.name: n.sd for n in uncertain_numbers(rig_model(tmp_path, ServoConstants(**constants)), "j", True)}

    assert known()["torque_at_full_duty"] == known()["back_emf"] == EvidenceOptions.sheet
    assert known(torque_tolerance=0.1)["torque_at_full_duty"] == 0.1
    assert known(sd=(("no_load_speed", 0.618),))["back_emf"] == pytest.approx(0.1)
