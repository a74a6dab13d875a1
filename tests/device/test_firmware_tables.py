"""Firmware tables: the thesis's text files, read back, and a C header that a compiler reads the same way."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.command import refused, succeeds
from workbench.device import export, read_tables, write_tables
from workbench.device.controller.program import table_of
from workbench.files import InputError
from workbench.motion import PoseTable, load_motion
from workbench.robot import BUS_IDS, data_file, puppy_model
from workbench.robot.model_file import save_model
from workbench.robot.servo_constants import load_servo_constants
from workbench.robot.servo_profile_file import servo_profile
from workbench.robot.servo_units import ServoUnits

TABLE = load_motion(data_file("robotis_walk.csv")).as_table()

PRINT_ALL = r"""
#include <stdio.h>
#include "motion.h"
int main(void)
{
    for (int j = 0; j < MOTION_JOINTS; ++j) printf("%s %d\n", motion_joints[j], motion_bus_ids[j]);
    for (int p = 0; p < MOTION_POSES; ++p) {
        for (int j = 0; j < MOTION_JOINTS; ++j) printf("%d %d ", motion_goals[p][j], motion_speeds[p][j]);
        printf("%lu\n", (unsigned long)motion_dwells_ms[p]);
    }
    return 0;
}
"""


def test_layout_of_the_thesis_under_a_line_that_says_the_order(tmp_path: Path) -> None:
    files = write_tables(TABLE, tmp_path)
    assert [f.name for f in files] == ["pos.txt", "speed.txt", "timeDiff.txt", "motion.h"]
    order = "# joints: blb blm blt brb brm brt flb flm flt frb frm frt head neck tail"
    pos = (tmp_path / "pos.txt").read_text().splitlines()
    assert pos[:3] == [order, "4,", "412,482,532,722,632,552,762,642,512,412,442,492,512,442,522,"]
    speed = (tmp_path / "speed.txt").read_text().splitlines()
    assert speed[:3] == [order, "4,", "159,128,128,190,284,66,315,97,59,159,28,3,0,62,62,"]
    assert (tmp_path / "timeDiff.txt").read_text().splitlines() == [order, "4,", "140,", "103,", "94,", "131,"]


def test_tables_of_another_family_are_in_its_own_counts(tmp_path: Path) -> None:
    xl, ax = ServoUnits.of(servo_profile("XL-430")), ServoUnits.of(servo_profile("AX-12A"))
    angles = np.radians([[0.0, 0.0], [90.0, 90.0], [-170.0, -90.0]])
    table = PoseTable.from_angles(("hip", "knee"), np.array([0.0, 0.5, 1.5]), angles, units=(xl, ax))
    assert table.goals.tolist() == [[2048 + 1024, 512 + 307], [2048 - 1934, 512 - 307]]
    assert table.speeds[0].tolist() == [round(180 / 6 / 0.229), round(180 / 6 * 1023 / 114)]
    assert np.abs(np.degrees(table.angles() - angles[1:])).max(axis=0) == pytest.approx([0.0195, 0.0293], abs=1e-3)
    assert table.commands().speeds[0] == pytest.approx([131 * np.radians(1.374), table.speeds[0, 1] * np.radians(0.666)])
    write_tables(table, tmp_path, {"hip": 1, "knee": 2})
    assert (tmp_path / "pos.txt").read_text().splitlines()[1] == "# servos: XL-430, AX-12A"
    assert "XL-430: goal positions 0 to 4095" in (tmp_path / "motion.h").read_text()
    back = read_tables(tmp_path)
    assert back.units == table.units
    assert np.array_equal(back.goals, table.goals)
    (tmp_path / "speed.txt").write_text((tmp_path / "speed.txt").read_text().replace("XL-430", "MX-28"))
    with pytest.raises(InputError, match=r"speed.txt: line 2: servos are not those of pos.txt"):
        read_tables(tmp_path)
    (tmp_path / "pos.txt").write_text((tmp_path / "pos.txt").read_text().replace("XL-430", "XL-999"))
    with pytest.raises(InputError, match=r"pos.txt: line 2: no servo profile for 'XL-999'"):
        read_tables(tmp_path)


def test_the_formats_own_units_are_the_ax12as() -> None:
    assert ServoUnits.of(servo_profile("AX-12A")) == ServoUnits()


def test_read_back_to_the_same_table(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    odd = PoseTable(("tail", "blb"), rng.integers(0, 1024, (7, 2)), rng.integers(0, 1024, (7, 2)), rng.integers(1, 70000, 7))
    for table in (TABLE, odd):
        write_tables(table, tmp_path)  # the second time over the first
        back = read_tables(tmp_path)
        assert back.joints == table.joints
        assert np.array_equal(back.goals, table.goals)
        assert np.array_equal(back.speeds, table.speeds)
        assert np.array_equal(back.dwells_ms, table.dwells_ms)
    assert len(list(tmp_path.iterdir())) == 4


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_c_header_compiles_without_warnings_and_says_the_same(tmp_path: Path) -> None:
    write_tables(TABLE, tmp_path)
    (tmp_path / "main.c").write_text('#include "motion.h"\n' + PRINT_ALL)  # twice: the guard holds
    strict = ["gcc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror"]
    subprocess.run([*strict, "main.c", "-o", "main"], cwd=tmp_path, check=True, capture_output=True)
    lines = subprocess.run([tmp_path / "main"], check=True, capture_output=True, text=True).stdout.splitlines()
    assert dict(line.split() for line in lines[:15]) == {j: str(i) for j, i in BUS_IDS.items()}
    numbers = np.array([[int(x) for x in line.split()] for line in lines[15:]])
    assert np.array_equal(numbers[:, 0:-1:2], TABLE.goals)
    assert np.array_equal(numbers[:, 1:-1:2], TABLE.speeds)
    assert np.array_equal(numbers[:, -1], TABLE.dwells_ms)


@pytest.mark.parametrize(("name", "old", "new", "message"), [
    ("pos.txt", "# joints:", "# order:", "pos.txt: line 1: expected '# joints: "),
    ("speed.txt", "blb blm", "blm blb", "speed.txt: line 1: joints are not in the order of pos.txt"),
    ("pos.txt", "4,", "5,", "pos.txt: line 2: expected the number of poses, and 4 follow"),
    ("timeDiff.txt", "4,\n140,\n", "3,\n", "timeDiff.txt: 3 poses, but 4 in pos.txt"),
    ("timeDiff.txt", "140,", "140,2,", "timeDiff.txt: pose 1: expected 1 numbers, found 2"),
    ("speed.txt", "159,128,", "159,", "speed.txt: pose 1: expected 15 numbers, found 14"),
    ("speed.txt", "159,128,", "159,x,", "speed.txt: line 3: expected whole numbers"),
    ("pos.txt", "412,482,", "412,1482,", "pose 1, joint blm: goal position 1482 is outside 0 to 1023"),
])
def test_damaged_tables_are_refused(name: str, old: str, new: str, message: str, tmp_path: Path) -> None:
    write_tables(TABLE, tmp_path)
    text = (tmp_path / name).read_text()
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        read_tables(tmp_path)


def test_joints_need_bus_ids(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="joint tail has no bus ID"):
        write_tables(TABLE, tmp_path / "new", {j: i for j, i in BUS_IDS.items() if j != "tail"})
    with pytest.raises(InputError, match="joints blb and blm share bus ID 13"):
        write_tables(TABLE, tmp_path / "new", {**BUS_IDS, "blb": 13})
    assert not (tmp_path / "new").exists()


def test_a_servo_that_nobody_knows_gets_no_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An LX-16A turns 240 deg over 1000 counts: in the AX-12A's, every angle would be 18 % too small."""
    path = tmp_path / "servo.yaml"
    path.write_text("model: LX-16A\nstall_torque: 1.7\nno_load_speed: 6.5\nrated_voltage: 7.4\nsupply_voltage: 7.4\n"
                    "coulomb_friction: 0.05\nviscous_friction: 0.01\nreflected_inertia: 0.005\nproportional_gain: 4.0\n")
    model = replace(puppy_model(), servos=dict.fromkeys(puppy_model().joints, load_servo_constants(path)))
    said = "joint .*: no servo profile for 'LX-16A'; expected one of AX-12A.*lx16a.yaml"
    with pytest.raises(InputError, match=said):
        export(load_motion(data_file("robotis_walk.csv"), model), model, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with pytest.raises(InputError, match=said):
        table_of(data_file("robotis_walk.csv"), model, 3, force=True)
    save_model(model, tmp_path / "model.yaml")
    for verb in ("export", "play", "run", "flash"):
        more = {"play": ["--port", "/dev/ttyNONE"], "flash": ["--dry-run"]}.get(verb, [])
        line = refused(capsys, verb, str(data_file("robotis_walk.csv")), "--model", str(tmp_path / "model.yaml"),
                       "--out", str(tmp_path / verb), *more)
        assert "no servo profile for 'LX-16A'" in line, verb
    assert succeeds(capsys, "inspect", str(path)).count("no servo profile for 'LX-16A'") == 1
