"""The table of joint ranges."""

import csv

import numpy as np
import pytest

from workbench.files import InputError
from workbench.robot import RobotModel, data_file, puppy_model
from workbench.robot.ranges import joint_ranges


def parts() -> dict[str, dict[str, str]]:
    lines = [line for line in data_file("parts.csv").read_text().splitlines() if not line.startswith("#")]
    return {row["name"]: row for row in csv.DictReader(lines)}


@pytest.mark.parametrize(("bracket", "base", "joints"), [
    ("f1", 0.023, ("blb", "blm", "frm")), ("f2", 0.026, ("flb", "tail", "head"))])
def test_brackets_end_joints_where_their_base_meets_the_servo(bracket, base, joints):
    """The table's rule, from the widths in parts.csv; a degree of clearance, half a degree of rounding."""
    half, side = float(parts()[bracket]["x"]) / 2, float(parts()["ax12a"]["x"]) / 2
    angle = np.radians(np.arange(90.0, 180.0, 0.01))
    meets = np.degrees(angle[np.argmax(base * np.sin(angle) + half * np.cos(angle) < side)])
    ranges = joint_ranges(puppy_model())
    for joint in joints:
        assert meets - 1.6 < np.degrees(ranges[joint].upper) <= meets - 1
        assert ranges[joint].lower == -ranges[joint].upper
        assert bracket.upper() in ranges[joint].source


def test_another_robot_has_its_models_limits_or_a_table_beside_it(tmp_path):
    path = tmp_path / "arm.sdf"
    path.write_text('<sdf version="1.9"><model name="arm"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
                    "<parent>a</parent><child>b</child><axis><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>2</upper></limit>"
                    "</axis></joint></model></sdf>")
    model = RobotModel(str(path), base="a")
    assert (joint_ranges(model)["j"].lower, joint_ranges(model)["j"].upper) == (-1, 2)
    table = tmp_path / "joint_ranges.csv"
    table.write_text("joint,lower,upper,source\nj,-90,30,a stop\n")
    assert joint_ranges(model)["j"].lower == -1
    assert joint_ranges(model)["j"].upper == pytest.approx(np.radians(30))
    for bad, said in (("joint,low\n", "expected the columns"), ("joint,lower,upper,source\nk,1,2,x\n", "line 2: .*found 'k'"),
                      ("joint,lower,upper,source\nj,5,5,x\n", "line 2, joint j: expected lower below upper"),
                      ("joint,lower,upper,source\nj,a,5,x\n", "line 2, joint j: expected two angles"),
                      ("joint,lower,upper,source\nj,1\n", "line 2: expected 4 cells, found 2")):
        table.write_text(bad)
        with pytest.raises(InputError, match=said):
            joint_ranges(model)
