"""The other engine's capture and sessions, read back by the workbench."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studies.other_engine import Camera, commands_from_rows, film, play, write_motive_csv
from studies.other_engine.capture import pivots_for
from studies.other_engine.excitation import MotionRows, stand_motion, sway_motion, varied_walk
from studies.other_engine.firmware import read_rows
from studies.other_engine.make_session import TakePlan, make_session, record, servo_yaml
from tests.other_engine_models import as_take
from workbench.compare.session import load_session
from workbench.motion import load_motion
from workbench.recording import read_recording, register, take_from_recording
from workbench.robot import EffectSpec, data_file, puppy_model

STARTS_AT = 0.40317  # between frames 48 and 49
CAMERA = Camera(yaw=0.3, origin=(0.05, 0.0, -0.04), gaps=0.5)


@pytest.fixture(scope="module")
def walk():
    return MotionRows(*read_rows(data_file("robotis_walk.csv")))


@pytest.fixture(scope="module")
def model():
    return puppy_model()


@pytest.fixture(scope="module")
def commands(walk):
    return commands_from_rows(walk.joints, walk.times, walk.angles, cycles=3)


@pytest.fixture(scope="module")
def run(model, commands):
    return play(model, commands, commands.end + 0.3, lead=0.45)


@pytest.fixture(scope="module")
def pivots(model, run):
    return pivots_for(run, model.rigid_bodies, np.random.default_rng(4))


def test_workbench_finds_start_yaw_pivots_noise_and_angles_again(tmp_path, model, commands, run, pivots):
    capture = film(run, model.rigid_bodies, pivots, CAMERA, STARTS_AT, np.random.default_rng(5))
    write_motive_csv(tmp_path / "take.csv", capture, "take")
    recording = read_recording(tmp_path / "take.csv")
    assert (recording.kind, recording.version, recording.rate, len(recording.time)) == ("motive", "1.23", 120, len(capture))
    seen = register(recording, model, commands, as_take(run))
    assert seen.starts_at == pytest.approx(STARTS_AT, abs=1e-3)
    assert seen.yaw == pytest.approx(CAMERA.yaw, abs=np.deg2rad(0.2))
    for asset, pivot in pivots.items():
        np.testing.assert_allclose(seen.pivots[asset], pivot, atol=2e-3, err_msg=asset)
    assert np.median(list(seen.noise.values())) == pytest.approx(np.sqrt(2) * CAMERA.rotation_noise, rel=0.2)
    assert seen.position_noise == pytest.approx(CAMERA.position_noise, rel=0.2)
    take = take_from_recording(recording, seen, model)
    moving = take.time > seen.starts_at
    for joint in take.joints:
        true = np.interp(take.since_start, run.time, run.q[:, run.joints.index(joint)])
        error = take.q[:, take.column(joint)] - (true - true[take.resting].mean())
        assert np.sqrt(np.nanmean(error[moving] ** 2)) < 1.4 * np.sqrt(2) * CAMERA.rotation_noise, joint


def test_clean_film_shows_every_joint_about_its_own_axis(model, run, pivots):
    capture = film(run, model.rigid_bodies, pivots, CAMERA.noiseless(), STARTS_AT, np.random.default_rng(0))
    time = np.arange(len(capture)) / 120 - STARTS_AT
    w = {asset: q[:, 3] for asset, q in capture.quat.items()}
    assert all(np.all(w[a][time < -0.01] > 1 - 1e-6) for a in w), "parallel to the capture's axes at rest"
    turn = Rotation.from_quat(capture.quat["FLmid"]).inv() * Rotation.from_quat(capture.quat["FLbtm"])
    angle = np.interp(time, run.time, run.q[:, run.joints.index("flb")])
    np.testing.assert_allclose(turn.magnitude(), np.abs(angle - angle[0]), atol=1e-4)


def test_robot_walks_along_its_yaw_with_y_up_and_z_to_the_right(model, run, pivots):
    film_of = lambda camera: film(run, model.rigid_bodies, pivots, camera, STARTS_AT, np.random.default_rng(0))  # noqa: E731
    straight, turned = film_of(Camera().noiseless()), film_of(Camera(yaw=np.pi / 2).noiseless())
    path, path_turned = straight.p["body"] - straight.p["body"][0], turned.p["body"] - turned.p["body"][0]
    assert straight.p["FRtop"][0, 2] > straight.p["FLtop"][0, 2]
    assert straight.p["body"][0, 1] > 0.1
    np.testing.assert_allclose(path_turned[:, 2], -path[:, 0], atol=1e-9)  # a quarter turn to the left: x becomes -z


def test_gaps_are_blank_cells_and_the_start_of_a_take_says_how_long_the_take_is(tmp_path, model, run, pivots):
    capture = film(run, model.rigid_bodies, pivots, replace(CAMERA, gaps=3.0), STARTS_AT, np.random.default_rng(6))
    write_motive_csv(tmp_path / "take.csv", capture.cut(100), "take", frames_in_take=len(capture))
    lines = (tmp_path / "take.csv").read_text().splitlines()
    assert len(lines) == 7 + 100
    assert f"Total Frames in Take,{len(capture)}," in lines[0]
    missing = sum(np.isnan(capture.p[a][:100, 0]).sum() for a in capture.p)
    assert missing > 0
    assert sum(line.split(",").count("") for line in lines[7:]) == 8 * missing


def test_film_refuses_a_run_that_rests_too_shortly(model, run, pivots):
    with pytest.raises(ValueError, match="rests"):
        film(run, model.rigid_bodies, pivots, CAMERA, 0.5, np.random.default_rng(0))


def test_same_seed_gives_the_same_recording(model, walk):
    plan = TakePlan("walk", walk, 1, "free")
    a, b, c = (record(model, plan, CAMERA, np.random.default_rng(seed))[1] for seed in (3, 3, 4))
    np.testing.assert_array_equal(a.quat["tail"], b.quat["tail"])
    assert len(a) != len(c) or not np.array_equal(a.quat["tail"], c.quat["tail"])


def test_excitation_starts_and_ends_in_neutral_and_moves_every_joint(walk):
    rng = np.random.default_rng(0)
    for motion in (stand_motion(walk, rng), sway_motion(walk, rng)):
        assert np.all(np.diff(motion.times) > 0.2)
        assert not motion.angles[[0, -1]].any()
    assert np.all(np.abs(stand_motion(walk, rng).angles).max(axis=0) >= 8)
    varied = varied_walk(walk)
    np.testing.assert_allclose(varied.times[-1], 1.15 * walk.times[-1])
    np.testing.assert_allclose(np.ptp(varied.angles, axis=0), 0.85 * np.ptp(walk.angles, axis=0))


@pytest.fixture(scope="module")
def session(tmp_path_factory, model, walk):
    out = tmp_path_factory.mktemp("session") / "s"
    make_session(out, model, walk, seed=7)
    return out


def test_session_is_one_that_the_workbench_loads(session, model):
    loaded = load_session(session / "session.yaml")
    assert [t.name for t in loaded.takes] == ["stand", "sway", "walk"]
    assert [p.name for p in loaded.predict] == ["hidden_walk", "hidden_stand"]
    assert loaded.model.servo("flm") == model.servo("flm")
    for entry in loaded.predict:
        answer = read_recording(session / "answer" / f"{entry.name}.csv")
        start = read_recording(session / "predict" / f"{entry.name}_start.csv")
        assert len(answer.time) == entry.frames
        assert start.time[-1] < entry.starts_at, "the start tells nothing of the motion"
        shown = len(start.time)
        for asset, track in start.rigid_bodies.items():
            np.testing.assert_array_equal(track.p, answer.rigid_bodies[asset].p[:shown])


def test_answer_tells_the_truth(session):
    truth = json.loads((session / "answer/truth.json").read_text())
    assert truth["effects"] == []
    assert not any(take["fell"] for take in truth["takes"].values())
    assert truth["takes"]["stand"]["travel"] == 0
    clean = read_recording(session / "answer/hidden_walk.nominal.csv").rigid_bodies["body"].p
    assert np.linalg.norm((clean[-1] - clean[0])[[0, 2]]) == pytest.approx(truth["takes"]["hidden_walk"]["travel"], abs=0.01)


def test_motions_written_are_the_motions_played(tmp_path, walk):
    stand = stand_motion(walk, np.random.default_rng(0))
    (tmp_path / "stand.csv").write_text(stand.to_csv())
    written = load_motion(tmp_path / "stand.csv").commands(1)
    played = commands_from_rows(stand.joints, stand.times, stand.angles)
    for part in ("times", "goals", "speeds"):
        np.testing.assert_allclose(getattr(written.reordered(played.joints), part), getattr(played, part), atol=1e-12)


def test_session_is_written_whole_or_not_at_all(tmp_path, model, walk, session):
    with pytest.raises(FileExistsError):
        make_session(session, model, walk, seed=7)
    with pytest.raises(ValueError, match="backlash"):
        make_session(tmp_path / "s", model.with_effect(EffectSpec("backlash", ("flm",), {"gap": 1.0})), walk, seed=7)
    assert not list(tmp_path.iterdir())


def test_servo_yaml_refuses_servos_of_two_kinds(model):
    mixed = replace(model, servos={**model.servos, "flm": model.servo("flm").updated({"supply_voltage": 9.0})})
    with pytest.raises(ValueError, match="one kind"):
        servo_yaml(mixed)
