"""The sessions of the blind trial: random draws, sealed answers, published files."""

import hashlib
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from studies.concealed_effects.catalogue import CATALOGUE, TIES, crowded, draw, possible
from studies.concealed_effects.conceal import Bench, conceal
from studies.concealed_effects.generator import make, write_session
from studies.concealed_effects.plan import MAKERS, SessionPlan, dealt_again, plan_sessions
from studies.concealed_effects.sealed import Vault
from studies.concealed_effects.takes import logged_takes
from studies.other_engine.hidden import OUTSIDE
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.recording import read_recording
from workbench.robot import EffectSpec


def test_a_hundred_sessions_hold_what_the_trial_asks():
    plans = plan_sessions(7)
    assert len({p.name for p in plans}) == 100
    outside = [p for p in plans if set(p.effects) & set(OUTSIDE)]
    assert (sum(not p.effects for p in plans), len(outside)) == (25, 15)
    several = [p for p in plans if len(p.effects) > 1]
    assert sum(p.masked for p in several) == (len(several) + 1) // 2
    assert max(len(p.effects) for p in plans) == 3
    dealt = Counter(e for p in plans for e in p.effects)
    assert set(dealt) >= set(CATALOGUE) - set(OUTSIDE), "every effect of the contract is hidden somewhere"
    for p in plans:
        able = set(possible(MAKERS[p.robot](np.random.default_rng(0)), False)) | set(OUTSIDE)
        assert set(p.effects) <= able
        assert not any(pair <= set(p.effects) for pair in TIES), "nothing is hidden that no second name could be asked for"
    assert {len(p.effects) for p in plans if p.masked} == {2, 3}
    assert plan_sessions(7) == plans
    assert plan_sessions(8) != plans


@pytest.mark.parametrize("seed", range(8))
def test_no_joint_is_dealt_two_effects(seed):
    for p in plan_sessions(seed):
        joints = {"rig": 1, "arm": 2}.get(p.robot, 15)
        in_a_joint = [e for e in p.effects if draw(e, np.random.default_rng(0), MAKERS[p.robot](np.random.default_rng(0))).where]
        assert len([e for e in in_a_joint if e != "payload"]) <= joints, p


def test_what_cannot_be_hidden_is_dealt_again_as_many_and_by_the_same_rules():
    for p in plan_sessions(7):
        again = dealt_again(p, np.random.default_rng(p.seed))
        assert len(again.effects) == len(p.effects)
        assert [e for e in again.effects if e in OUTSIDE] == [e for e in p.effects if e in OUTSIDE]
        assert not crowded(MAKERS[p.robot](np.random.default_rng(0)), again.effects)
        assert replace(again, effects=p.effects) == p
        assert again == dealt_again(p, np.random.default_rng(p.seed))


@pytest.mark.parametrize("kind", sorted(MAKERS))
def test_every_effect_can_be_drawn_for_every_robot_that_shows_it(kind):
    robot = MAKERS[kind](np.random.default_rng(3))
    for effect in (*possible(robot, False), *possible(robot, True)):
        for share in (0.0, 1.0):
            spec = draw(effect, np.random.default_rng(5), robot).at(share)
            assert spec.effect == effect
            assert all(np.isfinite(v).all() for v in spec.parameters.values())


def test_a_seal_opens_to_what_was_sealed_and_not_to_anything_else(tmp_path):
    vault = Vault(tmp_path / "sealed")
    committed = vault.seal("s000", {"truth.json": '{"effects": ["backlash"]}'})
    assert b"backlash" not in (tmp_path / "sealed/s000.sealed").read_bytes()
    assert Vault(tmp_path / "sealed").open("s000") == {"truth.json": b'{"effects": ["backlash"]}'}
    assert vault.commitments == {"s000": committed}
    assert (vault.count, vault.drawn_by, vault.seed.bit_length() > 64) == (100, "os.urandom", True)
    assert Vault(tmp_path / "another").seed != vault.seed
    for other in ({"seed": 7}, {"count": 30}):
        with pytest.raises(ValueError, match="under way"):
            Vault(tmp_path / "sealed", **other)
    with pytest.raises(ValueError, match="already"):
        vault.seal("s000", {})
    content = bytearray((tmp_path / "sealed/s000.sealed").read_bytes())
    content[10] ^= 1
    (tmp_path / "sealed/s000.sealed").write_bytes(bytes(content))
    with pytest.raises(InputError, match="committed"):
        vault.open("s000")


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    out = tmp_path_factory.mktemp("trial")
    make(out, Vault(out / "sealed"), SessionPlan("s000", "rig", ("coulomb_friction",), False, 11))
    return out


def test_a_session_shows_nothing_of_what_is_hidden_and_can_be_read(trial):
    session = load_session(trial / "sessions/s000/session.yaml")
    assert [t.name for t in session.takes] == ["slow", "quick", "steps"]
    assert not session.model.effects
    for take in session.takes:
        assert read_recording(take.recording).commands is not None
    files = [p for p in (trial / "sessions").rglob("*") if p.is_file()]
    assert len(files) == 8
    assert not any("friction" in p.read_text() for p in files if p.suffix == ".csv")


@pytest.mark.slow
def test_the_seed_makes_what_was_sealed_again(trial, tmp_path):
    vault = Vault(trial / "sealed")
    made = write_session(tmp_path, SessionPlan("s000", "rig", ("coulomb_friction",), False, 11))[1]
    assert hashlib.sha256(vault.packed("s000", made)).hexdigest() == vault.commitments["s000"]
    other = write_session(tmp_path, SessionPlan("s000", "rig", ("coulomb_friction",), False, 12))[1]
    assert hashlib.sha256(vault.packed("s000", other)).hexdigest() != vault.commitments["s000"]


def test_what_is_concealed_shows(tmp_path):
    rng = np.random.default_rng(1)
    robot = MAKERS["arm"](rng)
    model = robot.model(tmp_path / "arm.sdf")
    bench = Bench(robot, model, [t for t in logged_takes(model, rng) if not t.predict][1:])
    (effect,) = conceal(bench, ["servo_gain"], False, rng)
    assert bench.shows(effect) > 1.5


def test_an_effect_that_another_covers_up_does_not_count_as_hidden(tmp_path):
    rng = np.random.default_rng(1)
    robot = MAKERS["rig"](rng)
    model = robot.model(tmp_path / "rig.sdf")
    bench = Bench(robot, model, [t for t in logged_takes(model, rng) if not t.predict][2:])
    weak = EffectSpec("torque_ceiling", ("swing",), {"torque": 0.02})
    dry = EffectSpec("coulomb_friction", ("swing",), {"torque": 0.2})
    assert bench.shows(weak) > 1.5
    assert bench.shows(dry) > 1.5
    assert not bench.each_adds([weak, dry]), "too weak to move at all, with friction or without"
    strong = EffectSpec("servo_gain", ("swing",), {"ratio": 0.5})
    assert bench.each_adds([strong, dry])
