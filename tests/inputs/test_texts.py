"""YAML, motions, .mtn files and tables: strict numbers, bounds, nothing that runs away."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.command import refused, succeeds
from tests.inputs.corpus import MTN, POSES, SERVO
from workbench.files import InputError
from workbench.files.yaml_file import read_yaml
from workbench.motion import load_motion, load_mtn
from workbench.robot import load_servo_constants

BOMB = "\n".join(f"{b}: &{b} [{','.join([f'*{a}'] * 10)}]" if a else f"{b}: &{b} [{','.join('l' * 10)}]"
                 for a, b in zip(["", *"abcdefghi"], "abcdefghij"))


@pytest.mark.parametrize(("text", "said"), [
    (BOMB, "more than 100000 values"), ("x: !!int abc", "'abc' is no int"), ("x: !!float abc", "no float"),
    ("x: !!bool abc", "no bool"), ("x: !!timestamp abc", "no timestamp"), ("x: !!python/object:os.system a", "is no"),
    ("x: " + "9" * 5000, "a whole number of 5000 digits"), ("[" * 2000, "not valid YAML"), ("a: &a [*a]", "recursive alias"),
    ("{y: " * 60 + "1" + "}" * 60, "nested deeper than 50"), ("a: 1\na: 2", "duplicate key"), ("? [a, b]\n: 1", "name as key"),
    ("x: 1\n" * 200_000, "MB"),
])
def test_yaml_is_bounded(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read_yaml(path)


@pytest.mark.parametrize(("old", "new", "said"), [
    ("stall_torque: 1.5", "stall_torque:", "stall_torque: is empty"),
    ("model: AX-12A", "model: [a]", "model: expected the servo"),
    ("model: AX-12A", "model: {a: 1}", "model: expected"), ("punch: 32", "punch: 1" + "0" * 400, "digits"),
    ("supply_voltage: 11.1", "supply_voltage: 11100", "expected at most 100 V"), ("punch: 32", "punch: 2000", "at most 1023"),
])
def test_servo_constants_are_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = tmp_path / "servo.yaml"
    path.write_text(SERVO.replace(old, new))
    with pytest.raises(InputError, match=said):
        load_servo_constants(path)


@pytest.mark.parametrize(("old", "new", "said"), [
    ("stall_torque: 1.5", "stall_torque: 15.3", "kg cm"), ("no_load_speed: 6.18", "no_load_speed: 59", "rpm"),
    ("compliance_slope: 32\ncompliance_margin: 1\npunch: 32", "proportional_gain: 800", "the register's own units")])
def test_constants_of_another_unit_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str,
                                            said: str) -> None:
    (tmp_path / "servo.yaml").write_text(SERVO.replace(old, new))
    assert said in succeeds(capsys, "inspect", str(tmp_path / "servo.yaml"))


@pytest.mark.parametrize("cell", ["1_0.5", "\u0661\u0662", "1e308", "nan", "inf", "0x1f", "1,5", "--1"])
def test_poses_are_of_plain_numbers(tmp_path: Path, cell: str) -> None:
    (tmp_path / "m.csv").write_text(POSES.replace("10.5", f'"{cell}"'))
    with pytest.raises(InputError, match="line 3"):
        load_motion(tmp_path / "m.csv")


@pytest.mark.parametrize(("effect", "said"), [
    ("{effect: backlash, where: [flm], parameters: {ratio: 1}}", "backlash"), ("{effect: rust, where: [flm]}", "rust"),
    ("{effect: backlash, where: [wing], parameters: {gap: 1}}", "wing")])
def test_a_wrong_effect_is_told_with_its_file(tmp_path: Path, capsys: pytest.CaptureFixture[str], effect: str, said: str) -> None:
    (tmp_path / "model.yaml").write_text(f"format: 1\neffects:\n- {effect}\n")
    line = refused(capsys, "inspect", str(tmp_path / "model.yaml"))
    assert f"{tmp_path / 'model.yaml'}: " in line
    assert said in line


def test_poses_that_are_no_degrees_or_seconds_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "radians.csv").write_text("time,blb\n0,0\n1,0.5\n2,0\n")
    assert "radians" in succeeds(capsys, "inspect", str(tmp_path / "radians.csv"))
    (tmp_path / "counts.csv").write_text("time,blb\n0,512\n1,600\n2,512\n")
    assert "counts" in succeeds(capsys, "inspect", str(tmp_path / "counts.csv"))
    (tmp_path / "ms.csv").write_text("time,blb\n0,0\n400,10\n800,0\n")
    assert "are the times in milliseconds?" in succeeds(capsys, "inspect", str(tmp_path / "ms.csv"))
    assert "--yes" in refused(capsys, "simulate", str(tmp_path / "ms.csv"), "--out", str(tmp_path / "out"))
    (tmp_path / "short.csv").write_text("time,blb\n0,0\n40,10\n80,0\n")  # a quick motion, over soon even in seconds
    assert "milliseconds" in refused(capsys, "simulate", str(tmp_path / "short.csv"), "--out", str(tmp_path / "out"))


@pytest.mark.parametrize(("change", "pages"), [
    (lambda b: b + b"\x8c\xf2", 1), (lambda b: b + b"1c", 1), (lambda b: b.replace(b"Step", "\uac77\uae30".encode("cp949")), 1),
    (lambda b: b.replace(b"Step", b"D\xe9but"), 1), (lambda b: b.replace(b"\n", b"\r\n"), 1),
    (lambda b: b.replace(b"1.01", b"1,01").replace(b"0.400", b"0,400").replace(b" 1.0 ", b" 1,5 "), 1),
    (lambda b: b.replace(b"version=1.01", b"version=1.00").replace(b"motor_type=" + b"0 " * 25 + b"0\n", b""), 1),
])
def test_motion_files_as_robotis_tools_write_them(tmp_path: Path, change, pages: int) -> None:
    path = tmp_path / "a.mtn"
    content = change(MTN.encode())
    assert content != MTN.encode()
    path.write_bytes(content)
    file = load_mtn(path)
    assert len(file.used) == pages
    assert not file.motor_type.any()
    assert load_motion(path).duration == pytest.approx(0.808 / file.used[0].speed_rate)


@pytest.mark.parametrize("share", [0.3, 0.6, 0.8, 0.97, 0.985])
def test_a_cut_motion_file_is_refused(tmp_path: Path, share: float) -> None:
    two = MTN + MTN[MTN.index("page_begin"):]
    (tmp_path / "a.mtn").write_text(two[: round(share * len(two))])
    with pytest.raises(InputError, match=r"a\.mtn"):
        load_mtn(tmp_path / "a.mtn")


@pytest.mark.parametrize(("option", "value"), [
    ("--cycles", "1000000000"), ("--cycles", "1" + "0" * 30), ("--cycles", "1_0"), ("--cycles", "\u0661"),
    ("--time-step", "1e-12"),
    ("--time-step", "1"), ("--time-step", "0.05"), ("--time-step", "nan"), ("--cycles", "0")])
def test_options_out_of_bounds(tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str, value: str) -> None:
    (tmp_path / "m.csv").write_text(POSES)
    with pytest.raises(SystemExit) as ended:
        succeeds(capsys, "simulate", str(tmp_path / "m.csv"), option, value, "--out", str(tmp_path / "out"))
    assert ended.value.code == 2
    assert option in capsys.readouterr().err


@pytest.mark.parametrize("suffix", [".csv", ".yaml", ".mtn", ".npz", ".json", ".sdf", ".urdf"])
def test_what_never_ends_is_refused_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str) -> None:
    os.mkfifo(tmp_path / f"pipe{suffix}")
    for verb in ("inspect", "simulate"):
        out = () if verb == "inspect" else ("--out", str(tmp_path / "out"))
        assert "a pipe, a device or a socket" in refused(capsys, verb, str(tmp_path / f"pipe{suffix}"), *out)
    (tmp_path / f"zero{suffix}").symlink_to("/dev/zero")
    assert "a pipe, a device or a socket" in refused(capsys, "inspect", str(tmp_path / f"zero{suffix}"))


def test_a_name_of_two_lines_is_told_in_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert r"a\nb.csv" in refused(capsys, "inspect", "a\nb.csv")


def test_firmware_tables_of_other_numbers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for cell in ("4_12", "9" * 40, "\u0664"):
        (tmp_path / "pos.txt").write_text(f"# joints: blb\n1,\n{cell},\n")
        assert "line 3: expected whole numbers" in refused(capsys, "inspect", str(tmp_path))
