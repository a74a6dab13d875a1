"""Implausible servo logs are reported by joint and time, and repaired where the repair is certain."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from tests.inputs.corpus import bam_log, corpus, joint_log, lerobot, ros_csv, sage, swing
from workbench.files import InputError
from workbench.recording import Recording, read_recording
from workbench.recording.formats.file_kind import file_kind
from workbench.recording.formats.read import recording_of_take
from workbench.recording.formats.rollout_table import load_rollout
from workbench.recording.servo_log.plausibility import beyond_range


def _read(folder: Path, time: np.ndarray, goal: np.ndarray, position: np.ndarray) -> Recording:
    path = folder / "log.csv"
    path.write_text(joint_log(time, goal, position))
    return read_recording(path)


def test_a_sound_log_has_nothing_to_tell(tmp_path: Path) -> None:
    assert _read(tmp_path, *swing()).problems == ()


@pytest.mark.parametrize("turn", [360.0, -360.0])
def test_readings_a_whole_turn_away_are_taken_out_and_counted(tmp_path: Path, turn: float) -> None:
    time, goal, position = swing()
    position[[40, 90]] += turn
    log = _read(tmp_path, time, goal, position)
    assert "2 reading(s) leap away by a whole turn" in log.problems[0]
    assert np.flatnonzero(np.isnan(log.channels["position.arm"])).tolist() == [40, 90]


def test_a_stretch_of_turns_is_turned_back(tmp_path: Path) -> None:
    time, goal, position = swing()
    true = position.copy()
    position[70:120] += 360
    log = _read(tmp_path, time, goal, position)
    assert "50 reading(s) are whole turns off" in log.problems[0]
    np.testing.assert_allclose(np.rad2deg(log.channels["position.arm"]), true, atol=1e-3)


def test_negative_counts_of_sixteen_bits_are_undone(tmp_path: Path) -> None:
    time, goal, position = swing()
    wrapped = np.where(position < 0, position + 65536 * 360 / 4096, position)
    log = _read(tmp_path, time, goal, wrapped)
    assert any("16-bit" in p for p in log.problems)
    np.testing.assert_allclose(np.rad2deg(log.channels["position.arm"]), position, atol=0.2)


def test_a_sign_in_a_bit_is_told(tmp_path: Path) -> None:
    time, goal, position = swing()
    log = _read(tmp_path, time, goal, np.where(position < 0, 32768 * 360 / 4096 - position, position))
    assert any("no servo gets that fast" in p or "turns" in p for p in log.problems)


@pytest.mark.parametrize(("change", "said"), [
    (lambda t, g, p: (t, np.deg2rad(g), np.deg2rad(p)), "radians"),
    (lambda t, g, p: (1000 * t, g, p), "milliseconds"),
    (lambda t, g, p: (t, p, p), "equals position.arm in every row"),
    (lambda t, g, p: (t, 0 * g, p), "was the command recorded?"),
    (lambda t, g, p: (np.where(t > 1, t + 0.5, t), g, p), "pause(s) without rows, the longest 0.52 s from 1.000 s"),
    (lambda t, g, p: (t, 57.3 * g, 57.3 * p), "more than 1.25 turns"),
])
def test_what_the_numbers_cannot_mean_is_told(tmp_path: Path, change, said: str) -> None:
    assert any(said in p for p in _read(tmp_path, *change(*swing())).problems)


def test_a_sensor_that_stands_while_its_goal_goes_on(tmp_path: Path) -> None:
    time, goal, position = swing()
    position[60:85] = position[60]
    problems = _read(tmp_path, time, goal, position).problems
    assert any("repeats" in p and "from 1.200 s" in p and "the sensor stood still" in p for p in problems)


@pytest.mark.parametrize(("lead", "told"), [
    (0.06, True), (0.2, True), (0.01, False), (0.0, False), (-0.06, False), (-0.2, False)])
def test_a_position_that_precedes_its_goal(tmp_path: Path, lead: float, told: bool) -> None:
    time, _, _ = swing(300)
    path = np.cumsum(np.random.default_rng(3).normal(size=900))  # a motion that does not repeat
    path = np.convolve(path, np.hanning(40) / 20, "same")[300:]
    goal, position = (np.interp(time - late, np.arange(600) / 50 - 2, path) for late in (0.0, -lead))
    problems = _read(tmp_path, time, goal, np.round(position / 0.0879) * 0.0879).problems
    assert any(f"precedes goal.arm by {1e3 * lead:.0f} ms" in p for p in problems) == told
    assert told or problems == ()


def test_leads_of_a_periodic_motion_may_be_lags(tmp_path: Path) -> None:
    time = np.arange(300) / 50
    goal, position = 30 * np.sin(2 * np.pi * time / 0.5), 20 * np.sin(2 * np.pi * (time + 0.1) / 0.5)
    assert not any("precedes" in p for p in _read(tmp_path, time, goal, np.round(position / 0.0879) * 0.0879).problems)


def test_a_joint_at_its_stop_is_no_stuck_sensor(tmp_path: Path) -> None:
    time, goal, position = swing()
    assert _read(tmp_path, time, goal, np.clip(position, -20, 15)).problems == ()


def test_duty_in_per_cent_is_told(tmp_path: Path) -> None:
    time, goal, position = swing()
    rows = joint_log(time, goal, position).splitlines()
    with_duty = [rows[0] + ",duty.arm", *[f"{r},{40 * np.sin(k)}" for k, r in enumerate(rows[1:])]]
    (tmp_path / "log.csv").write_text("\n".join(with_duty))
    assert any("per cent" in p for p in read_recording(tmp_path / "log.csv").problems)


@pytest.mark.parametrize("cell", ["inf", "1e999", "nan?", "1_0", "\u0663", "0x10"])
def test_what_is_no_number_is_refused_with_its_line(tmp_path: Path, cell: str) -> None:
    text = joint_log(*swing()).splitlines()
    text[5] = f"0.08,{cell},1"
    (tmp_path / "log.csv").write_text("\n".join(text) + "\n")
    with pytest.raises(InputError, match="line 6, column 2"):
        read_recording(tmp_path / "log.csv")


@pytest.mark.parametrize("cell", ["1e300", "-1e308", "1e18"])
def test_what_no_channel_reaches_is_refused_with_its_bound(tmp_path: Path, cell: str) -> None:
    text = joint_log(*swing()).splitlines()
    text[5] = f"0.08,{cell},1"
    (tmp_path / "log.csv").write_text("\n".join(text) + "\n")
    with pytest.raises(InputError, match=r"goal.arm: .* at 0.080 s; expected at most 1e\+10"):
        read_recording(tmp_path / "log.csv")


def test_positions_beyond_the_models_range() -> None:
    log = Recording("x", "joint_log", "", np.arange(3.0), np.arange(3), 1.0, channels={"position.a": np.deg2rad([0, 14.5, -80])})
    assert "reaches -80.0 to 14.5 deg" in beyond_range(log, {"a": (np.deg2rad(-90), 0.0)})[0]
    assert beyond_range(log, {"a": (np.deg2rad(-90), np.deg2rad(14))}) == ()


@pytest.mark.parametrize(("header", "said"), [
    ("timestamp,action.arm.pos,observation.state.arm.pos", "rename timestamp to time, action.arm.pos to goal.arm"),
    ("Time;pos_arm;cmd_arm", "columns Time, pos_arm, cmd_arm"),
    ("stamp,/joint_states/knee/position", "nearly a motion table"),
])
def test_foreign_columns_are_named_with_those_wanted(tmp_path: Path, header: str, said: str) -> None:
    (tmp_path / "x.csv").write_text(header + "\n0,1,2\n")
    with pytest.raises(InputError, match="expected time") as raised:
        read_recording(tmp_path / "x.csv")
    assert said in str(raised.value)


@pytest.mark.parametrize("how", ["utf-16", "cr", "semicolon", "tab"])
def test_tables_of_spreadsheets_are_read(tmp_path: Path, how: str) -> None:
    text = joint_log(*swing())
    content = {"utf-16": text.encode("utf-16"), "cr": text.replace("\n", "\r").encode(),
               "semicolon": text.replace(",", ";").replace("goal.", "goal?").replace("position.", "position?").replace(".", ",")
               .replace("?", ".").encode(), "tab": text.replace(",", "\t").encode()}[how]
    (tmp_path / "log.csv").write_bytes(content)
    log = read_recording(tmp_path / "log.csv")
    np.testing.assert_allclose(np.rad2deg(log.channels["position.arm"]), swing()[2], atol=1e-3)


def test_lerobot_in_degrees_and_in_shares_of_the_range(tmp_path: Path) -> None:
    position = swing(90, 30.0)[2]
    for scale, problems in (((1.0, 1.0), 0), ((0.0785 * 4096 / 360, 0.0907 * 4096 / 360), 1)):
        (tmp_path / "a.parquet").write_bytes(lerobot(scale))
        log = read_recording(tmp_path / "a.parquet")
        assert len(log.problems) == problems
        np.testing.assert_allclose(np.rad2deg(log.channels["position.joint_1"]), position, atol=0.02)


def test_lerobot_data_set_of_several_episodes(tmp_path: Path) -> None:
    (tmp_path / "data" / "chunk-000").mkdir(parents=True)
    (tmp_path / "meta").mkdir()
    (tmp_path / "data" / "chunk-000" / "file-000.parquet").write_bytes(lerobot(episodes=3))
    (tmp_path / "meta" / "info.json").write_text(
        '{"codebase_version": "v3.0", "features": {"observation.state": {"names": ["pan.pos", "jaw.pos"]}}}')
    with pytest.raises(InputError, match="holds 3 episodes"):
        read_recording(tmp_path)
    log = read_recording(f"{tmp_path}#1")
    assert (log.joints, len(log.time), log.metadata["episode"]) == (("pan", "jaw"), 90, "1")
    with pytest.raises(InputError, match="no programme '7'"):
        recording_of_take(Path(f"{tmp_path}#7"), "walk")


def test_a_ros_controllers_state(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text(ros_csv())
    log = read_recording(tmp_path / "x.csv")
    assert (log.kind, log.joints, log.sensing) == ("ros_csv", ("knee",), "encoders")
    assert log.rate == pytest.approx(50)
    np.testing.assert_allclose(np.rad2deg(log.channels["position.knee"]), swing(60)[2], atol=1e-3)


@pytest.mark.parametrize(("header", "time"), [
    ("%time,field.joint_names0,field.desired.positions0,field.actual.positions0",
     lambda t: f"{1.7e18 + round(t * 1e9):.0f},knee"),
    ("__time,/c/reference/positions[0],/c/feedback/positions[0]", lambda t: f"{1.7e9 + t:.3f}"),
    ("__time,/c/reference/positions[0],/c/feedback/positions[0]", lambda t: f"{1.7e15 + round(t * 1e6):.0f}"),
    ("time;/c/reference/positions[0];/c/feedback/positions[0]", lambda t: f"{t:.3f}"),
    ("time,reference.positions.0,feedback.positions.0", lambda t: f"{t:.3f}"),
    ("header.stamp.sec,header.stamp.nanosec,reference.positions[0],feedback.positions[0]",
     lambda t: f"{1_700_000_000 + int(t)},{round(1e9 * (t % 1))}"),
])
def test_ros_tables_of_other_tools(tmp_path: Path, header: str, time) -> None:
    rows = [f"{time(t)},{np.deg2rad(g):.6g},{np.deg2rad(p):.6g}" for t, g, p in zip(*swing(60))]
    text = "\n".join([header, *rows]) + "\n"
    (tmp_path / "x.csv").write_text(text.replace(",", ";") if ";" in header else text)
    assert file_kind(tmp_path / "x.csv") == "recording"
    log = read_recording(tmp_path / "x.csv")
    assert (log.kind, len(log.joints), log.problems) == ("ros_csv", 1, ())
    np.testing.assert_allclose(log.time - log.time[0], swing(60)[0], atol=1e-3)


@pytest.mark.parametrize(("columns", "said"), [
    ({"timestamp": pa.array(["0", "1"])}, "'timestamp': expected numbers, found string"),
    ({"action": pa.array([["1"], ["2"]])}, "'action': expected a vector of numbers"),
    ({"action": pa.array([None, [1.0]])}, "'action': expected as many numbers"),
    ({"episode_index": pa.array(["a", "b"])}, "'episode_index': expected whole numbers"),
])
def test_parquet_of_other_types(tmp_path: Path, columns: dict, said: str) -> None:
    sound = {"timestamp": pa.array([0.0, 0.1]), "action": pa.array([[0.0], [1.0]]), "observation.state": pa.array([[0.0], [1.0]])}
    parquet.write_table(pa.table(sound | columns), tmp_path / "x.parquet")
    with pytest.raises(InputError, match=said):
        read_recording(tmp_path / "x.parquet")


def test_lerobot_in_radians_is_converted(tmp_path: Path) -> None:
    (tmp_path / "a.parquet").write_bytes(lerobot((np.pi / 180, np.pi / 180)))
    log = read_recording(tmp_path / "a.parquet")
    assert "in radians" in log.problems[0]
    np.testing.assert_allclose(np.rad2deg(log.channels["position.joint_1"]), swing(90, 30.0)[2], atol=0.02)


@pytest.mark.parametrize(("old", "new", "said"), [
    ('"mass": 0.5', '"mass": 1e400', "beyond all bounds"),
    ('"timestamp": 0.0', '"timestamp": ' + "9" * 400, "a whole number of 400 digits"),
    ('"entries": [', '"entries": ' + "[" * 100_000, "nested too deep|line 1"),
    ('"position": 0.0', '"position": Infinity', "beyond all bounds"),
    ('"entries"', '"rows"', "found one with motor, mass, rows"),
])
def test_json_that_no_log_is(tmp_path: Path, old: str, new: str, said: str) -> None:
    (tmp_path / "log.json").write_text(bam_log().replace(old, new, 1))
    with pytest.raises(InputError, match=said):
        read_recording(tmp_path / "log.json")


def test_bam_times_in_milliseconds_are_told(tmp_path: Path) -> None:
    import json

    content = json.loads(bam_log())
    for entry in content["entries"]:
        entry["timestamp"] *= 1000
    (tmp_path / "log.json").write_text(json.dumps(content))
    assert any("milliseconds" in p for p in read_recording(tmp_path / "log.json").problems)


@pytest.mark.parametrize("damage", ["flip", "complex", "nan", "inf", "degrees", "bomb"])
def test_archives(tmp_path: Path, damage: str) -> None:
    import io
    import zipfile

    path = tmp_path / "x.npz"
    content = dict(np.load(io.BytesIO(sage())))
    if damage == "flip":
        whole = bytearray(sage())
        whole[len(whole) // 3] ^= 0x55
        path.write_bytes(whole)
    elif damage == "bomb":
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as out:
            out.writestr("t_cmd.npy", b"\0" * (300 << 20))
    else:
        change = {"complex": lambda q: q + 1j, "nan": lambda q: q * np.nan, "inf": lambda q: q + np.inf, "degrees": np.rad2deg}
        content["q_meas"] = change[damage](content["q_meas"])
        np.savez(path, **content)
    if damage == "degrees":
        assert any("is it in degrees" in p for p in read_recording(path).problems)
        return
    with pytest.raises(InputError, match=r"x\.npz"):
        read_recording(path)


@pytest.mark.parametrize(("name", "first"), [("log.csv", b"\n0,"), ("bam.json", b'"timestamp": 0.0'),
                                             ("ros.csv", b"\n1700000000000000000,"), ("rollout.csv", b"\n0.0,")])
@pytest.mark.parametrize("instead", [b"-1e308", b"-1e25"])
def test_a_time_beside_which_all_others_are_alike_is_refused(tmp_path: Path, name: str, first: bytes, instead: bytes) -> None:
    content = corpus(tmp_path)[name]
    number = first.strip(b'\n,"timesap: ')
    assert content.count(first) >= 1
    (tmp_path / name).write_bytes(content.replace(first, first.replace(number, instead), 1))
    with pytest.raises(InputError, match="increasing"):
        (load_rollout if name == "rollout.csv" else read_recording)(tmp_path / name)
