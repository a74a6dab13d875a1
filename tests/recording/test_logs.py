"""Servo logs: joint logs, BAM, SAGE."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.recording_robot import write_robot
from tests.shared_data import shared
from workbench.compare.channels import channel_names
from workbench.compare.comparison import noise_of
from workbench.files import InputError
from workbench.recording import Measurement, read_recording, register, take_from_recording, write_joint_log
from workbench.robot import RobotModel

PENDULUM = """<?xml version="1.0"?><sdf version="1.9"><model name="pendulum"><link name="base"/><link name="arm"><inertial>
<pose>0 0 -0.1 0 0 0</pose><mass>0.5</mass><inertia><ixx>1e-5</ixx><iyy>1e-5</iyy><izz>1e-5</izz></inertia></inertial></link>
<joint name="servo" type="revolute"><parent>base</parent><child>arm</child><axis><xyz>0 1 0</xyz><limit><lower>-3</lower>
<upper>3</upper></limit></axis></joint></model></sdf>"""


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> RobotModel:
    return write_robot(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory) -> RobotModel:
    path = tmp_path_factory.mktemp("pendulum") / "pendulum.sdf"
    path.write_text(PENDULUM)
    return RobotModel(description=str(path), base="base")


LOG = """time,goal.flm,position.flm,velocity.flm,duty.flm,voltage,enabled.flm,goal.tail,position.tail
0.10,10,1.0,-5,0.2,11.1,1,0,2
0.11,10,,0,0.25,11.0,1,0,2
0.12,20,3.0,5,-1,11.0,0,,1
0.13,20,4.0,5,0,10.9,,-30,0
"""


def test_joint_log_in_degrees_becomes_radians_and_its_goals_commands(tmp_path, model):
    path = tmp_path / "log.csv"
    path.write_text(LOG)
    r = read_recording(path)
    assert (r.kind, r.units) == ("joint_log", "degrees")
    assert r.rate == pytest.approx(100)
    np.testing.assert_allclose(r.channels["position.flm"], np.deg2rad([1, np.nan, 3, 4]))
    np.testing.assert_allclose(r.channels["velocity.flm"], np.deg2rad([-5, 0, 5, 5]))
    np.testing.assert_allclose(r.channels["duty.flm"], [0.2, 0.25, -1, 0])
    np.testing.assert_allclose(r.channels["voltage"], [11.1, 11.0, 11.0, 10.9])
    c = r.commands
    np.testing.assert_allclose(c.times, [0, 0.02, 0.03])
    np.testing.assert_allclose(c.goals, np.deg2rad([[10, 0], [20, 0], [20, -30]]))
    np.testing.assert_array_equal(c.enabled, [[True, True], [False, True], [False, True]])
    assert c.end == pytest.approx(0.03)
    m = register(r, model, None)
    take = take_from_recording(r, m, model, name="log", base="fixed")
    assert (take.joints, take.starts_at, take.zeroed, take.base) == (("flm", "tail"), 0.10, False, "fixed")
    np.testing.assert_allclose(take.q[:, 1], np.deg2rad([2, 2, 1, 0]))
    assert np.isnan(take.q_sigma[1, 0])
    assert take.q_sigma[0, 1] >= np.deg2rad(1) / np.sqrt(12) * 0.999
    assert take.commands.joints == model.joints
    np.testing.assert_allclose(take.commands.goals[:, model.joints.index("tail")], np.deg2rad([0, 0, -30]))


def test_commands_of_a_prediction_start_at_the_position_of_the_first_row(tmp_path):
    path = tmp_path / "c.csv"
    path.write_text("time,goal.servo,enabled.servo,position.servo,velocity.servo\n0,,1,12,3\n0.01,,1,,\n0.02,40,True,,\n0.03,40,0,,\n")
    r = read_recording(path)
    np.testing.assert_allclose(r.commands.goals[:, 0], np.deg2rad([12, 40, 40]))
    np.testing.assert_allclose(r.commands.times, [0, 0.02, 0.03])
    assert r.commands.enabled[:, 0].tolist() == [True, True, False]
    assert r.channels["velocity.servo"][0] == pytest.approx(np.deg2rad(3))


def test_joint_log_written_and_read_back(tmp_path):
    t = np.arange(50) / 200
    channels = {"goal.a": np.sin(t), "position.a": np.where(t < 0.1, np.nan, t), "voltage": 7 + t, "enabled.a": (t > 0.05) * 1.0}
    path = write_joint_log(tmp_path / "out.csv", t, channels)
    r = read_recording(path)
    for name, values in channels.items():
        np.testing.assert_allclose(r.channels[name], values, atol=1e-9)
    np.testing.assert_allclose(r.time, t)


@pytest.mark.parametrize(("old", "new", "message"), [
    ("goal.tail,", "gaol.tail,", "unknown column 'gaol.tail'"),
    ("goal.tail,position.tail", "goal.tail,position.neck", "column 'position.neck' without 'goal.neck'"),
    ("goal.tail,position.tail", "goal.tail,goal.tail", "column 'goal.tail' is given twice"),
    ("0.12,20", "0.11,20", "line 4: time 0.11 does not follow"),
    ("0.12,20", "0.12,2O", "line 4, column 2: expected a number, got '2O'"),
    ("-1,11.0,0,", "-1,11.0,off,", "line 4, enabled.flm: expected 1 or 0, got 'off'"),
    ("0.13,20,4.0,5,0,10.9,,-30,0\n", "0.13,20,4.0", "line 5: 3 of 9 columns; the file is cut mid-row"),
])
def test_bad_joint_logs(tmp_path, old, new, message):
    path = tmp_path / "log.csv"
    assert old in LOG
    path.write_text(LOG.replace(old, new, 1))
    with pytest.raises(InputError, match=rf"log\.csv: .*{message}"):
        read_recording(path)


def test_a_joint_that_the_model_lacks_is_refused(tmp_path, model):
    path = tmp_path / "log.csv"
    path.write_text(LOG.replace("tail", "trunk"))
    with pytest.raises(InputError, match="unknown joint 'trunk'"):
        take_from_recording(read_recording(path), Measurement(0.0), model)


def bam(**changes) -> dict:
    entry = {"position": 0.1, "speed": 0.5, "load": 65526, "input_volts": 7.3, "temp": 29, "timestamp": 0.0, "goal_position": 0.4,
             "torque_enable": True}
    entries = [{**entry, "timestamp": 0.005 * i, "load": [65526, 0, 885, 64651][i % 4], "torque_enable": i < 6} for i in range(8)]
    return {"mass": 0.49, "length": 0.1, "kp": 200, "vin": 7.4, "motor": "xl330", "entries": entries} | changes


def test_bam_log_load_register_is_signed_duty(tmp_path, pendulum, model):
    path = tmp_path / "log.json"
    path.write_text(json.dumps(bam()))
    r = read_recording(path)
    np.testing.assert_allclose(r.channels["duty.xl330"][:4], [-10 / 885, 0, 1, -1])
    assert r.metadata["kp"] == "200"
    take = take_from_recording(r, register(r, pendulum, None), pendulum, base="fixed")
    assert take.joints == ("servo",)
    np.testing.assert_allclose(take.q[:, 0], 0.1)
    np.testing.assert_allclose(take.v[:, 0], 0.5)
    np.testing.assert_allclose(take.commands.times, [0, 0.03])
    assert take.commands.enabled[:, 0].tolist() == [True, False]
    with pytest.raises(InputError, match="a log of one servo needs a model with one joint"):
        take_from_recording(r, Measurement(0.0), model)


def test_bad_bam_logs(tmp_path):
    path = tmp_path / "log.json"
    whole = json.dumps(bam())
    bad = bam()
    del bad["entries"][3]["position"]
    backwards = bam()
    backwards["entries"][3]["timestamp"] = 0.0
    for text, message in ((whole[:-30], "line 1, column .* expected whole JSON"), ("{}", "a list 'entries'"),
                          (json.dumps(bad), r"entries\[3\]: key 'position' is missing"),
                          (json.dumps(backwards), r"entries\[3\].timestamp: time 0 does not follow 0.01: the times start "
                                                  r"again"),
                          (whole.replace('"speed": 0.5', '"speed": "fast"', 1), r"entries\[0\].speed: expected a number, got")):
        path.write_text(text)
        with pytest.raises(InputError, match=message):
            read_recording(path)


def programme(n: int = 30, width: int = 6) -> dict[str, np.ndarray]:
    t = 0.02 * np.arange(n)
    goals = np.sin(t)[:, None] * np.ones(width)
    return {"t_cmd": t + 1e-5, "q_cmd": goals, "t_meas": t + 0.001, "q_meas": goals * 0.9, "v_meas": goals,
            "tau_abs": np.abs(goals)}


def test_sage_programmes_of_an_npz(tmp_path):
    path = tmp_path / "all.npz"
    np.savez(path, **{f"{name}/{k}": v for name in ("one", "two") for k, v in programme(30 if name == "one" else 20).items()})
    both = read_recording(path)
    assert (both.kind, len(both.time), both.commands) == ("sage", 50, None)
    assert "choose one as FILE#PROGRAMME" in both.problems[0]
    two = read_recording(f"{path}#two")
    assert (len(two.time), two.metadata["programme"]) == (20, "two")
    np.testing.assert_allclose(two.channels["position.Elbow"], programme(20)["q_meas"][:, 2])
    np.testing.assert_allclose(two.channels["goal.Jaw"], programme(20)["q_cmd"][:, 5])
    with pytest.raises(InputError, match="no programme 'three'; expected one of one, two"):
        read_recording(f"{path}#three")
    content = path.read_bytes()
    path.write_bytes(content[:len(content) // 2])
    with pytest.raises(InputError, match="not an npz of number arrays"):
        read_recording(path)
    np.savez(path, **{"x/t_cmd": np.zeros(3)})
    with pytest.raises(InputError, match="no array 'x/q_cmd'"):
        read_recording(path)


def raw(folder, columns=("positions", "velocities", "torques"), n=5, cut=""):
    folder.mkdir(exist_ok=True)
    (folder / "joint_list.txt").write_text("a\nb\n")
    (folder / "control.csv").write_text("type,timestamp,positions\r\n" + "".join(
        f'CONTROL,{20000 * i + 2},"[{i}.0, 0.5]"\r\n' for i in range(n)))
    state = "".join(f"STATE_MOTOR,{20000 * i + 3}," + ",".join(f'"[{i}.5, 0.25]"' for _ in columns) + "\r\n" for i in range(n))
    (folder / "state_motor.csv").write_text("type,timestamp," + ",".join(columns) + "\r\n" + state + cut)
    return folder


def test_sage_raw_folder_or_any_of_its_files(tmp_path):
    folder = raw(tmp_path / "push")
    for path in (folder, folder / "state_motor.csv", folder / "control.csv"):
        r = read_recording(path)
        assert (r.kind, r.metadata["programme"], len(r.time)) == ("sage", "push", 5)
        np.testing.assert_allclose(r.time, 0.02 * np.arange(5) + 3e-6)
        np.testing.assert_allclose(r.channels["position.a"], np.arange(5) + 0.5)
        np.testing.assert_allclose(r.commands.goals[:, 0], np.arange(5))
    raw(folder, cut='STATE_MOTOR,100003,"[1.0, 2.0]","[1.0]","[1.0, 2.0]"\r\n')
    with pytest.raises(InputError, match=r"state_motor.csv: line 7, velocities: expected 2 numbers"):
        read_recording(folder)
    raw(folder, columns=("positions",))
    with pytest.raises(InputError, match="column 'velocities' is missing"):
        read_recording(folder)
    with pytest.raises(InputError, match=r"a folder without .*state_motor"):
        read_recording(tmp_path)


def test_what_is_no_recording_says_what_was_expected(tmp_path):
    path = tmp_path / "x.csv"
    for content in (b"hello\nworld\n", b"time,blb\n0,1\n", b"\x00\xff\xfe"):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"not a recording|binary file"):
            read_recording(path)


def test_real_logs_of_a_pendulum(pendulum):
    for path in sorted(shared("data/xl330").glob("*.json")):
        r = read_recording(path)
        duty = r.channels["duty.xl330"]
        assert np.abs(duty).max() <= 1
        gain, on = 0.0028774 * float(r.metadata["kp"]), r.channels["enabled.xl330"] > 0
        law = np.clip(gain * (r.channels["goal.xl330"] - r.channels["position.xl330"]), -1, 1)
        assert np.median(np.abs(duty - law)[on]) * 885 < 12  # the register is the law's output (shared/data/README.md)
        take = take_from_recording(r, register(r, pendulum, None), pendulum)
        count = 2 * np.pi / 4096
        assert count / np.sqrt(12) * 0.99 < take.q_sigma[0, 0] < count


def test_real_programmes_raw_and_npz_agree():
    folder = shared("data/so101")
    assert len(read_recording(folder / "so101_programmes.npz").time) > 100_000
    for name in ("step_response", "friction_gravity"):
        a, b = read_recording(folder / "raw" / name), read_recording(f"{folder}/so101_programmes.npz#{name}")
        assert set(a.channels) == set(b.channels)
        for c in a.channels:
            np.testing.assert_allclose(a.channels[c], b.channels[c], atol=1e-6)
        np.testing.assert_allclose(a.commands.times, b.commands.times, atol=1e-9)
        assert a.rate == pytest.approx(49.85, abs=0.01)


def test_a_log_of_several_programmes_makes_no_take(tmp_path, model):
    path = tmp_path / "all.npz"
    np.savez(path, **{f"{name}/{k}": v for name in ("one", "two") for k, v in programme().items()})
    both = read_recording(path)
    renamed = replace(both, channels={c.replace(".Jaw", ".tail"): v for c, v in both.channels.items() if c.endswith("Jaw")})
    with pytest.raises(InputError, match="choose one as FILE#PROGRAMME"):
        take_from_recording(renamed, Measurement(0.0), model)


def test_a_count_shows_where_values_stay_though_rows_lie_between(tmp_path, model):
    """A log with a clock of its own, of a servo at rest: the rounding to counts is its noise."""
    count = np.radians(300 / 1023)
    read = np.round(0.05 * np.sin(np.linspace(0, 12, 400)) / count) * count
    time = np.arange(0.0, 7.9, 0.02) + 0.007
    position = np.interp(time, np.arange(400) * 0.02, read)
    joints = model.joints[:2]
    channels = {"goal." + joints[0]: np.zeros(len(time)), "position." + joints[0]: position,
                "goal." + joints[1]: np.zeros(len(time)), "position." + joints[1]: np.zeros(len(time))}
    recording = read_recording(write_joint_log(tmp_path / "log.csv", time - time[0], channels))
    measurement = register(recording, model, None)
    assert measurement.noise[joints[0]] == pytest.approx(count / np.sqrt(12), rel=0.01)
    assert measurement.noise[joints[1]] == pytest.approx(count / np.sqrt(12), rel=0.01)  # the same kind of servo
    take = take_from_recording(recording, measurement, model, "log", "free")
    assert noise_of([take]).joints[joints[1]] == pytest.approx(count / np.sqrt(12), rel=0.01)
    assert channel_names(SimpleNamespace(recorded=take, model=model)) == joints  # its base is nowhere told


def test_joints_that_rest_at_few_places_tell_their_count_together(tmp_path, model):
    """Of a motion of some poses, on a clock of its own: what lies between two counts is no finer sensor."""
    count, rng = np.radians(300 / 1023), np.random.default_rng(2)
    time = np.arange(0.0, 3.9, 0.02) + 0.007
    channels = {}
    for joint in model.joints[:6]:
        read = np.repeat(rng.integers(-40, 40, 5), 40) * count
        read[::40] -= 0.5 * np.diff(read, prepend=0.0)[::40] // count * count  # on the way
        channels |= {f"goal.{joint}": 0 * time, f"position.{joint}": np.interp(time, np.arange(200) * 0.02, read)}
    measurement = register(read_recording(write_joint_log(tmp_path / "log.csv", time - time[0], channels)), model, None)
    for joint in model.joints[:6]:
        assert measurement.noise[joint] > 0.99 * count / np.sqrt(12)


def test_a_joint_that_never_moves_has_the_noise_of_its_kinds_count(tmp_path, model):
    """What its servo would have told: 0 would make a gap of any number."""
    count = 2 * np.pi / 4096
    time = np.arange(0.0, 2.0, 0.02)
    moving = np.cumsum(np.tile([1, 2, 3, -1, -2, -3], 17)[:len(time)]) * count  # no value stays for two rows
    joints = model.joints[:2]
    channels = {f"{what}.{joint}": values for what in ("goal", "position") for joint, values in zip(joints, (moving, 0 * time))}
    measurement = register(read_recording(write_joint_log(tmp_path / "log.csv", time, channels)), model, None)
    assert measurement.noise[joints[1]] == pytest.approx(count / np.sqrt(12), rel=0.01)


def test_a_file_is_read_again_where_it_has_changed(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,goal.one,position.one\n0,0,0\n0.1,5,1\n0.2,5,4\n")
    first = read_recording(path)
    assert read_recording(path) is first
    path.write_text(path.read_text().replace("0.2,5,4", "0.2,5,3"))
    assert read_recording(path).channels["position.one"][2] < first.channels["position.one"][2]
