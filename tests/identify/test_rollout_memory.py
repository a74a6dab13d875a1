"""Rollouts are remembered: in memory within bounds, on disk so that a killed run continues; of servo logs and filmed takes."""

from dataclasses import replace

import numpy as np
import pytest

from tests.evidence.rig_logs import record
from workbench.effects.registry import known_effects
from workbench.identify.diagnosis import diagnose_session
from workbench.identify.rollouts import memory as memories
from workbench.identify.rollouts import servo_logs
from workbench.identify.rollouts.key import ModelKeys
from workbench.identify.rollouts.memory import RolloutMemory
from workbench.robot import EffectSpec

MANY = 1 << 20
ANSWERS = {f"key {k}": np.random.default_rng(k).normal(size=(50, 3)) for k in range(4)}


def kept(folder, most=MANY):
    memory = RolloutMemory(folder, most)
    for key, answer in ANSWERS.items():
        memory.keep(key, answer)
    return memory


def test_what_is_kept_is_told_to_the_bit_by_this_run_and_by_the_next(tmp_path):
    tmp_path /= "new/folder"
    here, again = kept(tmp_path), RolloutMemory(tmp_path, MANY)
    again.keep("coarse", np.float32([[1.5, np.nan]]))
    for memory in (here, again, RolloutMemory(tmp_path, MANY)):
        for key, answer in ANSWERS.items():
            np.testing.assert_array_equal(memory.get(key), answer)
    told = RolloutMemory(tmp_path, MANY).get("coarse")
    assert told.dtype == np.float32
    np.testing.assert_array_equal(told, [[1.5, np.nan]])
    assert here.get("another") is None


def test_memory_is_bounded_in_bytes_and_the_folder_keeps_the_rest(tmp_path):
    two = 2 * ANSWERS["key 0"].nbytes
    alone, beside = kept(None, two), kept(tmp_path, two)
    assert [alone.get(key) is not None for key in ANSWERS] == [False, False, True, True]
    for key, answer in ANSWERS.items():
        np.testing.assert_array_equal(beside.get(key), answer)


def test_a_record_that_was_cut_off_or_damaged_is_not_known_and_the_others_are(tmp_path):
    kept(tmp_path)
    (file,) = tmp_path.glob(f"*{memories.SUFFIX}")
    content = bytearray(file.read_bytes())
    content[60] ^= 1  # a number of the first record
    file.write_bytes(content[:-100])
    known = [RolloutMemory(tmp_path, MANY).get(key) is not None for key in ANSWERS]
    assert known == [False, True, True, False]


def test_a_rollout_counts_once_however_often_it_is_requested_and_whether_it_was_known_or_not(tmp_path):
    kept(tmp_path)
    memory = RolloutMemory(tmp_path, MANY)
    for key in ("key 0", "key 0", "new"):
        memory.request(key, 2.0)
    assert (memory.rollouts, memory.work, memory.played) == (2, 4.0, 0)


def test_models_that_differ_in_anything_have_other_keys(tmp_path):
    model = record(tmp_path).model
    worn = model.with_effect(EffectSpec("coulomb_friction", ("j",), {"torque": 0.01}))
    others = [worn, worn.with_effects([EffectSpec("coulomb_friction", ("j",), {"torque": 0.010000000000000002})]),
              model.with_servos({"coulomb_friction": 0.02})]
    keys = ModelKeys()
    assert len({keys.of(m) for m in (model, *others)}) == 4
    assert keys.of(model) == ModelKeys().of(model.with_effects(()))


def test_a_diagnosis_of_servo_logs_that_was_killed_rolls_nothing_out_again(tmp_path, monkeypatch):
    session = record(tmp_path, [EffectSpec("coulomb_friction", ("j",), {"torque": 0.02})])
    session = replace(session, takes=session.takes[:1])
    without = sorted(set(known_effects()) - {"coulomb_friction"})
    plays, played, most = servo_logs.servo_angles, [], np.inf

    def counted(models):
        if len(played) >= most:
            raise KeyboardInterrupt
        played.extend(job for jobs in models for job in jobs)
        return plays(models)

    def diagnosed(folder):
        played.clear()
        return diagnose_session(session, n_jobs=1, memory=folder, without=without).diagnosis

    monkeypatch.setattr(servo_logs, "servo_angles", counted)
    (tmp_path / "whole").mkdir()
    (tmp_path / "killed").mkdir()
    whole, all_of_them = diagnosed(tmp_path / "whole"), len(played)
    assert all_of_them > 150
    most = 100
    with pytest.raises(KeyboardInterrupt):
        diagnosed(tmp_path / "killed")
    before_the_end, most = len(played), np.inf
    again = diagnosed(tmp_path / "killed")
    assert len(played) == all_of_them - before_the_end
    assert again.findings == whole.findings
    assert again.provenance["rollouts"] == whole.provenance["rollouts"] >= all_of_them
