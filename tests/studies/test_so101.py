"""The SO-101's study: its arm and session, and that its measurements recover the parameters of synthetic programmes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies.so101.__main__ import main
from studies.so101.baseline import fit_baseline
from studies.so101.evaluate import degrees, errors, simulate, together
from studies.so101.programmes import TRAINING, VALIDATION, Programme, clock, jaw_range, load_programmes
from studies.so101.read_off import read_off
from studies.so101.response import INERTIA, Value, response
from studies.so101.rest import current, standing
from studies.so101.robot import COUNT, arm_sdf, servo
from studies.so101.rows import Rows, gravity
from studies.so101.session import write_session
from studies.so101.zero import Zero
from tests.shared_data import shared
from workbench.compare.session import load_session
from workbench.recording.joint_names import SO101_JOINTS as JOINTS
from workbench.recording.joint_names import URDF_JOINTS
from workbench.robot import Kinematics
from workbench.servo import ServoLaw

DATA = "data/so101"
DT = 0.02


def made_up(name: str, seed: int, lag: float = 0.08, friction: float = 0.006, compliance: float = 0.08) -> Rows:
    """A programme in which joint 1 (Pitch) obeys the regression's own law exactly, under a load that depends on its angle, and
    the others follow at once; the goal is computed from that law."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 40, DT)
    slow, fast = 2 * np.pi * rng.uniform(0.1, 0.4), 2 * np.pi * rng.uniform(0.5, 0.8)
    q = 0.3 * np.sin(slow * t + rng.uniform(0, 6)) + 0.1 * np.sin(fast * t)
    v, a = np.gradient(q, DT), np.gradient(np.gradient(q, DT), DT)
    g = 0.5 * np.cos(q + 0.8)
    goal = q + INERTIA * a + lag * v + friction * np.sign(v) - compliance * g
    late = np.interp(t + DT / 2, t, goal)  # a goal that is held counts from half a period later
    read, sent = np.tile(q[:, None], 6), np.tile(q[:, None], 6)
    sent[:, 1] = late
    p = Programme(name, t, t, sent, read, np.tile(v[:, None], 6), np.abs(read))
    frame = np.arange(10, len(t) - 10)
    column = np.tile(v[frame][:, None], 6)
    return Rows(p, frame, read[frame], column, np.tile(a[frame][:, None], 6), np.tile(g[frame][:, None], 6),
                np.abs(column) > 0.05, np.zeros(column.shape, dtype=bool))


def test_the_split_is_whole_and_nothing_serves_for_both() -> None:
    assert len(TRAINING) == len(VALIDATION) == 14
    assert not set(TRAINING) & set(VALIDATION)


def test_regression_finds_lag_friction_and_load() -> None:
    found = response("Pitch", [made_up(f"p{k}", k) for k in range(5)])
    assert found.late.value == pytest.approx(0.08, abs=0.002)
    assert found.delay.value == pytest.approx(0.0, abs=0.003)
    assert found.friction.value == pytest.approx(0.006, rel=0.15)
    assert found.compliance is not None
    assert found.compliance.value == pytest.approx(0.08, rel=0.1)
    assert found.late.low <= found.late.value <= found.late.high


def test_a_later_clock_shows_as_delay() -> None:
    rows = [made_up(f"p{k}", k) for k in range(5)]
    late = [replace(r, of=replace(r.of, sent=np.column_stack(
        [np.interp(r.of.time + 0.02, r.of.time, c) for c in r.of.sent.T]))) for r in rows]
    assert response("Pitch", late).delay.value == pytest.approx(0.02, abs=0.003)


def test_errors_at_rest_by_approach_and_the_registers_square() -> None:
    n = 3000
    t = DT * np.arange(n)
    rows = []
    for seed in range(3):
        goal = np.repeat(np.random.default_rng(seed).uniform(-0.5, 0.5, n // 100), 100)
        came = np.sign(np.diff(goal, prepend=goal[0]))
        came = came[np.maximum.accumulate(np.where(came != 0, np.arange(n), 0))]
        error = np.repeat(np.random.default_rng(100 + seed).uniform(0.04, 0.06, n // 100), 100) * came
        sent = np.tile(goal[:, None], 6)
        read = sent - error[:, None]
        p = Programme("made up", t, t, sent, read, np.zeros((n, 6)), 80 * np.square(sent - read))
        frame = np.arange(20, n - 10, 5)
        still = np.repeat((np.arange(n) % 100 > 30)[frame][:, None], 6, axis=1)
        zero = np.zeros((len(frame), 6))
        rows.append(Rows(p, frame, read[frame], zero, zero, zero - 0.2, ~still, still))
    s = standing("Elbow", rows)
    assert s is not None
    assert (s.up.value, s.down.value, s.width.value) == pytest.approx((0.05, -0.05, 0.05), abs=0.003)
    assert s.load == pytest.approx(0.2)
    law = current("Elbow", rows)
    assert law is not None
    assert law.scale.value == pytest.approx(80)
    assert law.power.value == pytest.approx(2)


def test_baseline_finds_gain_delay_and_offset() -> None:
    t = DT * np.arange(2000)
    sent = np.sin(0.7 * t)[:, None] * np.arange(1, 7)
    read = np.column_stack([0.9 * np.interp(t - 0.1, t, c) + 0.02 for c in sent.T])
    p = Programme("made up", t, t, sent, read, sent, sent)
    b = fit_baseline([p])
    np.testing.assert_allclose(b.delay, 0.1, atol=1e-9)
    np.testing.assert_allclose(b.gain, 0.9, atol=1e-9)
    e = errors([p], {"made up": b.position(p)}, degrees(2.0))
    assert together(e, [p]).max() < 1e-6


def test_jaw_counts_in_shares_of_its_range_and_half_its_duty() -> None:
    plain, jaw = ServoLaw.of([servo()]), ServoLaw.of([servo(2.3)])
    np.testing.assert_allclose(jaw.gain * jaw.full_torque, plain.gain * plain.full_torque, rtol=1e-4)  # stiffness
    np.testing.assert_allclose(jaw.damping, plain.damping, rtol=1e-4)
    fastest = jaw.full_torque / jaw.back_emf * 2.3, plain.full_torque / plain.back_emf  # rad/s of the servo at full duty
    np.testing.assert_allclose(fastest[0], fastest[1] / 2, rtol=1e-4)


def test_read_off_turns_measurements_into_effects(tmp_path: Path) -> None:
    urdf = shared(f"{DATA}/so101_inertias_only.urdf")
    model = load_session(write_session(urdf.parent, tmp_path, TRAINING[:1], 2.3)).model
    rows = [made_up(f"p{k}", k) for k in range(3)]
    moving = {j: response(j, rows) for j in JOINTS}
    k = 3.35036 * 2.656
    zeros = {"Pitch": Zero("Pitch", Value(1 / (2 * k), 0, 1), Value(0, 0, 0), 0.0)}
    fitted = read_off(model, moving, dict.fromkeys(JOINTS), zeros)
    assert [e.parameters["ratio"] for e in fitted.effects if e.effect == "servo_gain"] == pytest.approx([2.0] * 6, rel=1e-3)
    pitch = next(e for e in fitted.effects if e.effect == "viscous_friction" and e.where == ("Pitch",))
    law = ServoLaw.of([servo()])
    assert pitch.parameters["coefficient"] == pytest.approx(moving["Pitch"].late.value * 2 * k - law.damping[0], rel=1e-3)


def test_the_arm_is_the_urdfs(tmp_path: Path) -> None:
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    urdf = shared(f"{DATA}/so101_inertias_only.urdf")
    (tmp_path / "robot.sdf").write_text(arm_sdf(urdf))
    arm = Kinematics.from_file(tmp_path / "robot.sdf")
    assert set(arm.joints) == set(JOINTS)
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(urdf))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    q = np.random.default_rng(1).uniform(-1, 1, (5, 6))
    ours = gravity(arm, q)
    for row, expected in zip(q, ours):
        for joint, angle in zip(JOINTS, row):
            plant.GetJointByName(URDF_JOINTS[joint]).set_angle(context, angle)
        g = plant.CalcGravityGeneralizedForces(context)
        drake = [g[plant.GetJointByName(URDF_JOINTS[j]).velocity_start()] for j in JOINTS]
        np.testing.assert_allclose(expected, drake, atol=1e-6)


def test_real_programmes_make_a_session_that_simulates(tmp_path: Path) -> None:
    data = shared(f"{DATA}/so101_programmes.npz").parent
    programmes = load_programmes(data)
    assert [p.name for p in programmes] == [*TRAINING, *VALIDATION]
    scale = jaw_range(programmes)
    assert scale / COUNT == pytest.approx(1523, abs=0.3)  # whole counts, as far as the file's digits go
    c = clock(programmes)
    assert c.period == pytest.approx(0.02006, abs=1e-5)
    assert c.apart == 0.0
    session = load_session(write_session(data, tmp_path, ("slow_precision", "step_response"), scale))
    assert [t.use for t in session.takes] == ["validate", "fit"]
    paths = simulate(session, session.model, lambda what, share: None, "", n_jobs=1, step=4e-3, seconds=0.5)
    by = {p.name: p for p in programmes}
    for name, path in paths.items():
        np.testing.assert_allclose(path[0], by[name].read[0], atol=1e-6)  # from the recorded start
        assert np.isfinite(path[:20]).all()
        assert np.abs(path[:20] - by[name].read[:20]).max() < 0.1


def test_without_recordings_one_line_and_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--data", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert "so101_programmes.npz" in said
    assert "expected the folder of the SO-101's recordings as --data" in said
    assert not (tmp_path / "out").exists()


def test_a_clone_without_the_recordings_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                                               monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studies.so101.__main__.BESIDE", tmp_path / "none")
    assert main(["--out", str(tmp_path / "out")]) == 0
    assert "nothing done" in capsys.readouterr().out
    assert not (tmp_path / "out").exists()
