"""Each verb end to end on a small arm: files written, and input refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.command import refused, succeeds
from tests.gap_sessions import record_arm, session_content, write_session
from workbench.dynamics import load_inverse_dynamics
from workbench.recording.formats.rollout_table import load_rollout


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """A session's folder, without its recording."""
    write_session(tmp_path)
    return tmp_path


def _at(folder: Path) -> list[str]:
    return [str(folder / "motions/wave.csv"), "--model", str(folder / "session.yaml"), "--out", str(folder / "out")]


def test_simulate(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = succeeds(capsys, "simulate", *_at(arm), "--base", "fixed", "--cycles", "2")
    assert said.splitlines()[0].startswith("on a stand; largest angle ")
    assert said.splitlines()[1:] == [f"wrote {arm}/out: rollout.csv, replay.html, joints.png, torques.png"]
    assert {p.name for p in (arm / "out").iterdir()} >= {"joints.png", "replay.html", "rollout.csv", "torques.png"}
    take = load_rollout(arm / "out/rollout.csv")
    assert take.time[-1] == pytest.approx(1.8)
    assert abs(take.q).max() > 0.3


def test_simulate_ideal_joints_follow_the_motion(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    succeeds(capsys, "simulate", *_at(arm), "--base", "fixed", "--drive", "ideal")
    take = load_rollout(arm / "out/rollout.csv")
    at = abs(take.time - 0.6).argmin()
    assert take.q[at] == pytest.approx([-0.349, 0.209, -0.436], abs=0.01)  # the second pose, -20 12 -25 deg


def test_inverse_dynamics_of_a_motion_and_of_its_rollout_agree(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    succeeds(capsys, "simulate", *_at(arm), "--base", "fixed", "--drive", "ideal")
    (arm / "rollout.csv").write_text((arm / "out/rollout.csv").read_text())
    said = succeeds(capsys, "inverse-dynamics", *_at(arm), "--base", "fixed")
    assert "inverse_dynamics.csv, torques.png, margins.png" in said
    motion = load_inverse_dynamics(arm / "out/inverse_dynamics.csv")
    succeeds(capsys, "inverse-dynamics", str(arm / "rollout.csv"), *_at(arm)[1:])
    rollout = load_inverse_dynamics(arm / "out/inverse_dynamics.csv")
    time = np.arange(0.2, 0.8, 0.01)  # at the start the ideal joints have to catch up with a motion that is under way
    for i, _ in enumerate(motion.joints):
        a, b = (np.interp(time, r.time, r.torque[:, i]) for r in (motion, rollout))
        assert np.sqrt(np.mean((a - b) ** 2)) < 0.05 * np.sqrt(np.mean(a**2)) + 0.002


def test_compare_and_inverse_dynamics_of_a_recorded_take(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record_arm(arm, friction=0.35)
    said = succeeds(capsys, "compare", str(arm / "session.yaml"), "--out", str(arm / "out"))
    assert "wave: first command at 0.41" in said
    compared = json.loads((arm / "out/comparison.json").read_text())
    (take,) = compared["takes"]
    assert next(iter(take["joints"])) == "three"  # whose friction is another
    assert take["joints"]["three"]["unit"] == "deg"
    page = (arm / "out/report.html").read_text()
    assert "three" in page
    assert (arm / "out/replay-wave.html").stat().st_size > 100_000
    succeeds(capsys, "inverse-dynamics", str(arm / "session.yaml"), "--take", "wave", "--out", str(arm / "forces"))
    assert load_inverse_dynamics(arm / "forces/inverse_dynamics.csv").base == "fixed"


def test_compare_two_motions(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (arm / "motions/slow.csv").write_text("time,one,three,two\n0,0,0,0\n0.45,20,-15,30\n0.9,0,0,0\n")
    succeeds(capsys, "compare", str(arm / "motions/slow.csv"), *_at(arm), "--base", "fixed")
    joints = json.loads((arm / "out/comparison.json").read_text())["takes"][0]["joints"]
    assert joints["one"]["error"] > 5


def test_export_is_refused_unless_forced(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (arm / "motions/wave.csv").write_text("time,one,three,two\n0,0,0,0\n0.15,60,0,0\n1,0,0,0\n")
    line = refused(capsys, "export", *_at(arm))
    assert "rpm, beyond its no-load speed" in line
    assert not (arm / "out").exists()
    succeeds(capsys, "export", *_at(arm), "--force")
    assert sorted(p.name for p in (arm / "out").iterdir()) == ["motion.h", "motion.table", "pos.txt", "speed.txt", "timeDiff.txt",
                                                                "workbench.log"]


BAD_MOTIONS = [
    ("time,one\n0,0\n1,170\n", "joint one"),
    ("time,one\n0,0\n1,nan\n", "column one: expected a finite number"),
    ("time,elbow\n0,0\n1,5\n", "no joint 'elbow'"),
    ("time,one\n0,0\n", "two rows"),
    ("time,one\n0,0\n0,5\n", "row 2"),
]


@pytest.mark.parametrize("verb", ["simulate", "inverse-dynamics", "export"])
@pytest.mark.parametrize(("content", "said"), BAD_MOTIONS)
def test_bad_motions(verb: str, content: str, said: str, arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (arm / "motions/wave.csv").write_text(content)
    base = [] if verb == "export" else ["--base", "fixed"]
    assert said in refused(capsys, verb, *_at(arm), *base)
    assert not (arm / "out").exists()


@pytest.mark.parametrize("verb", ["simulate", "inverse-dynamics"])
def test_a_base_that_cannot_float(verb: str, arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "fixed to the world" in refused(capsys, verb, *_at(arm), "--base", "free")


@pytest.mark.parametrize("verb", ["simulate", "inverse-dynamics", "export"])
def test_an_unwritable_folder_is_refused_before_the_work(
    verb: str, arm: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("workbench.simulation.Simulation", None)  # would fail if the work began
    (arm / "file").write_text("")
    base = [] if verb == "export" else ["--base", "fixed"]
    assert "is a file" in refused(capsys, verb, *_at(arm)[:-1], str(arm / "file/out"), *base)


def test_session_errors(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = session_content() | {"grond": {}}
    write_session(arm, content)
    assert "grond: unknown key" in refused(capsys, "compare", str(arm / "session.yaml"), "--out", str(arm / "out"))
    content = session_content()
    content["robot"]["base"] = "hull"
    write_session(arm, content)
    assert "no link 'hull'" in refused(capsys, "compare", str(arm / "session.yaml"), "--out", str(arm / "out"))


def test_recordings_that_cannot_be_compared(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = record_arm(arm)
    whole = path.read_text()
    compare = ("compare", str(arm / "session.yaml"), "--out", str(arm / "out"))
    path.write_text(whole[: len(whole) // 2])
    assert "wave.csv: line" in refused(capsys, *compare)
    path.write_text(whole.replace("Upper", "Wing"))
    assert "Wing" in refused(capsys, *compare)
    path.write_text(whole.replace("Rigid Body", "Marker"))
    assert "wave.csv" in refused(capsys, *compare)
    assert not (arm / "out").exists()
