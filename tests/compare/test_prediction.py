"""Takes foretold: as the cameras of a start file, and as the servos' own log, would see them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import workbench
from tests.command import refused, succeeds
from tests.gap_sessions import STARTS_AT, record_arm, session_content, write_session
from workbench.compare.prediction import predict_session
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.recording import write_motive
from workbench.recording.formats.read import read_recording
from workbench.robot import EffectSpec, save_model
from workbench.simulation import Simulation, SimulationConfig
from workbench.view.report.notebook import prediction_html


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """A session whose recorded arm has more friction in `three`, and asks for the take itself, of which it shows the start."""
    record_arm(tmp_path, friction=0.35)
    lines = (tmp_path / "takes/wave.csv").read_text().splitlines(keepends=True)
    frames = len(lines) - 7
    (tmp_path / "start.csv").write_text("".join(lines[:7 + 48]))
    entry = {"name": "again", "motion": "motions/wave.csv", "cycles": 2, "start": "start.csv", "starts_at": STARTS_AT,
             "frames": frames, "base": "fixed"}
    write_session(tmp_path, session_content() | {"predict": [entry]})
    return tmp_path


def _miss(predicted: Path, recorded: Path) -> tuple[float, float]:
    """RMS of the lower link's rotation [deg] and place [mm]."""
    a, b = (read_recording(p).rigid_bodies["Lower"] for p in (predicted, recorded))
    turn = Rotation.from_quat(a.quat, scalar_first=True).inv() * Rotation.from_quat(b.quat, scalar_first=True)
    return (float(np.rad2deg(np.sqrt(np.mean(turn.magnitude() ** 2)))),
            float(1000 * np.sqrt(np.mean(np.sum((a.p - b.p) ** 2, axis=1)))))


def test_the_right_model_foretells_the_recording_to_its_noise(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = load_session(arm / "session.yaml")
    model = session.model.with_effect(EffectSpec("coulomb_friction", ("three",), {"torque": 0.29}))
    save_model(model, arm / "model.yaml")
    said = succeeds(capsys, "predict", str(arm / "session.yaml"), "--model", str(arm / "model.yaml"), "--out",
                    str(arm / "fitted"))
    assert said == f"wrote {arm}/fitted: again.csv\n"
    succeeds(capsys, "predict", str(arm / "session.yaml"), "--out", str(arm / "nominal"))
    degrees, mm = _miss(arm / "fitted/again.csv", arm / "takes/wave.csv")
    assert degrees < 0.25  # 0.12 deg about each of three axes
    assert mm < 1.5  # frames of rest alone do not tell how base and pivots share their offset
    assert _miss(arm / "nominal/again.csv", arm / "takes/wave.csv")[0] > 3 * degrees
    start, predicted = read_recording(arm / "start.csv"), read_recording(arm / "fitted/again.csv")
    assert tuple(predicted.rigid_bodies) == tuple(start.rigid_bodies)
    assert (predicted.version, predicted.rate, predicted.units) == ("1.23", start.rate, start.units)
    assert len(predicted.time) == session.predict[0].frames


def test_fitted_and_nominal_come_from_one_call(arm: Path) -> None:
    session = load_session(arm / "session.yaml")
    model = session.model.with_effect(EffectSpec("coulomb_friction", ("three",), {"torque": 0.29}))
    done = predict_session(session, model, arm / "both", nominal=session.model)
    assert [p.name for p in done.paths] == ["again.csv", "again.nominal.csv"]
    assert done.left_out == ()
    assert _miss(*done.paths)[0] > 0.5


def test_a_prediction_holds_its_takes_and_shows_itself(arm: Path) -> None:
    found = workbench.predict(arm / "session.yaml", arm / "new", config=SimulationConfig(contact_period=0), jobs=1)
    (take,), (path,) = found.takes, found.paths
    (asked,) = load_session(arm / "session.yaml").predict
    written = read_recording(path)
    assert (take.name, found.left_out) == ("again", ())
    assert take.since_start[-1] == pytest.approx(written.time[-1] - asked.starts_at, abs=2e-3)
    assert np.nanmax(np.abs(take.q)) > 0.1
    shown = found._repr_html_()
    for cell in ("again", f"{take.since_start[-1]:.2f} s", "–", str(path)):
        assert f"<td>{cell}</td>" in shown
    walked = replace(take, base="free", p_WB=np.column_stack([take.time, -take.time, take.time]) * (take.time > 0)[:, None])
    assert f"<td>{np.sqrt(2) * take.time[-1]:.3f} m</td>" in prediction_html((walked,), (path,), (("wave", "no frames"),))
    assert "Left out: wave: no frames" in prediction_html((walked,), (path,), (("wave", "no frames"),))


def test_units_and_frame_numbers_are_the_start_files(arm: Path) -> None:
    seen = read_recording(arm / "start.csv")
    write_motive(arm / "start.csv", seen.rigid_bodies, seen.rate, units="Millimeters", first_frame=int(seen.frames[0]))
    session = load_session(arm / "session.yaml")
    (path,) = predict_session(session, session.model, arm / "out", yaw=0.3).paths
    predicted, start = read_recording(path), read_recording(arm / "start.csv")
    assert "Length Units,Millimeters" in path.read_text()
    assert predicted.rigid_bodies["Trunk"].p[0] == pytest.approx(start.rigid_bodies["Trunk"].p[0], abs=1e-3)


def _with_log(folder: Path, rows: str, base: str = "fixed") -> Path:
    (folder / "goals.csv").write_text(rows)
    entry = {"name": "log", "commands": "goals.csv", "servos": {"proportional_gain": 3.0}, "base": base}
    return write_session(folder, session_content() | {"predict": [entry]})


LOG = ("time,goal.one,goal.two,enabled.one,enabled.two,position.one,position.two,velocity.one,velocity.two\n"
       "5.0,0,0,1,1,10,-5,0,20\n5.01,0,0,1,1,,,,\n5.3,15,0,1,0,,,,\n6.0,15,0,1,0,,,,\n")


def test_a_log_is_foretold_from_its_first_state(tmp_path: Path) -> None:
    session = load_session(_with_log(tmp_path, LOG))
    (path,) = predict_session(session, session.model, tmp_path / "out").paths
    log = read_recording(path)
    np.testing.assert_allclose(np.loadtxt(path, delimiter=",", skiprows=1, usecols=0), [5.0, 5.01, 5.3, 6.0])
    position = {j: np.rad2deg(log.channels[f"position.{j}"]) for j in ("one", "two")}
    assert position["one"][0] == pytest.approx(10)
    assert position["two"][0] == pytest.approx(-5)
    assert position["two"][1] > -5  # it was moving up
    assert "position.three" not in log.channels
    own = session.model_of(session.predict[0])
    commands = read_recording(tmp_path / "goals.csv").commands
    take = Simulation(own, SimulationConfig(base="fixed")).run(
        commands, 1.0, start=(np.deg2rad([10, 0, -5]), np.deg2rad([0, 0, 20])))  # joints one, three, two
    for joint in position:
        expected = np.rad2deg(np.interp([0, 0.01, 0.3, 1.0], take.time, take.q[:, take.column(joint)]))
        np.testing.assert_allclose(position[joint], expected, atol=1e-6)


@pytest.mark.parametrize(("rows", "expected"), [
    (LOG.replace("one", "four"), "unknown joint 'four'"),
    ("time,Trunk\n0,1\n", "not a recording"),
])
def test_a_log_that_does_not_fit_is_named(tmp_path: Path, rows: str, expected: str) -> None:
    session = load_session(_with_log(tmp_path, rows))
    with pytest.raises(InputError, match=expected) as caught:
        predict_session(session, session.model, tmp_path / "out")
    assert "goals.csv" in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_what_cannot_be_foretold_is_one_line(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["--out", str(arm / "out")]
    session = arm / "session.yaml"
    assert "expected the links and joints of the robot in" in refused(
        capsys, "predict", str(session), "--model", "package://puppy/puppy.sdf", *out)
    save_model(load_session(session).model.with_effect(EffectSpec("rust", ("two",), {"depth": 1.0})), arm / "model.yaml")
    line = refused(capsys, "predict", str(session), "--model", str(arm / "model.yaml"), *out)
    assert f"{arm}/model.yaml: effects: effect 'rust' is not known" in line
    (arm / "start.csv").write_text(LOG)
    assert "start.csv: expected the start of a Motive take" in refused(capsys, "predict", str(session), *out)
    write_session(arm, session_content())
    assert "predict: expected at least one entry" in refused(capsys, "predict", str(session), *out)
    assert not (arm / "out").exists()


def test_compare_takes_a_fitted_model(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = load_session(arm / "session.yaml").model.with_effect(EffectSpec("coulomb_friction", ("three",), {"torque": 0.29}))
    save_model(model, arm / "model.yaml")
    succeeds(capsys, "compare", str(arm / "session.yaml"), "--model", str(arm / "model.yaml"), "--out", str(arm / "out"))
    assert "Every joint's error is within" in (arm / "out/report.html").read_text()
