"""The thesis's conversion (equations 3.1 to 3.4), pose tables, and the file that people write."""

from pathlib import Path

import numpy as np
import pytest

from workbench.files import InputError
from workbench.files.reading import write_together
from workbench.motion import Motion, PoseTable, load_motion, save_motion
from workbench.robot import COUNT, JOINTS, SPEED_UNIT, data_file


@pytest.fixture(scope="module")
def walk() -> Motion:
    return load_motion(data_file("robotis_walk.csv"))


def test_the_thesis_figures_in_order_of_joints(walk: Motion) -> None:
    """Figure 3.4. Its pos.txt is in bus-ID order, so goals are compared by joint."""
    table = walk.as_table()
    assert table.joints == JOINTS
    assert table.goals[0].tolist() == [412, 482, 532, 722, 632, 552, 762, 642, 512, 412, 442, 492, 512, 442, 522]
    assert table.speeds[0].tolist() == [159, 128, 128, 190, 284, 66, 315, 97, 59, 159, 28, 3, 0, 62, 62]
    assert table.speeds[1].tolist() == [212, 0, 170, 255, 212, 85, 424, 297, 85, 212, 127, 0, 0, 85, 85]
    assert table.dwells_ms.tolist() == [140, 103, 94, 131]
    by_bus = ["tail", "frt", "flt", "frm", "flm", "frb", "flb", "brt", "blt", "brm", "blm", "brb", "blb", "neck", "head"]
    last = [502, 491, 531, 451, 611, 361, 661, 531, 491, 541, 441, 661, 361, 462, 512]
    assert [table.goals[3, JOINTS.index(j)] for j in by_bus] == last


def test_a_joint_whose_goal_stays_keeps_its_speed_where_a_robot_plays(walk: Motion, tmp_path: Path) -> None:
    """The foot at 2 deg/s is sent the same goal again at once, in the first cycle before it has arrived."""
    played = load_motion(save_motion(walk.as_sent(), tmp_path / "played.csv")).as_table()
    table, frt = walk.as_table(), JOINTS.index("frt")
    assert table.speeds[:2, frt].tolist() == [3, 0]
    assert played.speeds[:2, frt].tolist() == [3, 3]
    changed = played.speeds != table.speeds
    assert changed.any()
    assert not changed[0].any()
    for k, j in np.argwhere(changed):
        assert table.speeds[k, j] == 0
        assert table.goals[k, j] == table.goals[k - 1, j]
        assert played.speeds[k, j] == played.speeds[k - 1, j]
    np.testing.assert_array_equal(played.goals, table.goals)
    np.testing.assert_array_equal(played.dwells_ms, table.dwells_ms)


def test_firmware_timing(walk: Motion) -> None:
    commands = walk.commands(cycles=3)
    assert commands.times[:6] == pytest.approx([0, 0.140, 0.243, 0.337, 0.468, 0.608])
    assert commands.end == pytest.approx(3 * 0.468)
    assert commands.poses.tolist() == [0, 1, 2, 3] * 3
    assert commands.goals[0, 0] == pytest.approx((412 - 512) * COUNT)
    assert commands.speeds[4, 6] == pytest.approx(315 * SPEED_UNIT)
    assert commands.enabled.all()
    with pytest.raises(InputError, match="cycles"):
        walk.commands(cycles=0)


def test_halves_round_away_from_zero_as_in_matlab() -> None:
    half = np.radians(np.array([[0, 0.0], [0.5, -0.5]]) * 300 / 1023)
    assert PoseTable.from_angles(("a", "b"), np.array([0, 1.0]), half).goals.tolist() == [[513, 511]]


def test_a_dwell_below_a_half_in_its_file_is_rounded_down() -> None:
    times = np.array([0, 0.2409, 0.3334])  # 92.49999999999997 ms, as every program that reads the file has it
    still = np.zeros((3, 1))
    assert PoseTable.from_angles(("a",), times, still).dwells_ms.tolist() == [241, 92]
    assert PoseTable.from_angles(("a",), np.array([0, 0.0925]), still[:2]).dwells_ms.tolist() == [93]


@pytest.mark.parametrize(("angle", "time", "message"), [
    (150.0, 1.0, "pose 1, joint flm: goal position 1024 is outside 0 to 1023"),
    (-150.3, 1.0, "pose 1, joint flm: goal position -1 is outside"),
    (100.0, 0.1, "pose 1, joint flm: moving speed 1496 is outside"),
    (0.1, 0.0004, "pose 1: dwell of 0 ms"),
])
def test_what_the_registers_cannot_hold_is_refused(angle: float, time: float, message: str) -> None:
    motion = Motion("m", np.array([0, time]), ("flm",), np.radians([[0.0], [angle]]), "m.csv")
    with pytest.raises(InputError, match=message) as raised:
        motion.as_table()
    assert raised.value.source == "m.csv"


def test_table_and_motion_agree(walk: Motion) -> None:
    """Back from counts the angles are within half a count, and converting them again gives the same goals and dwells."""
    back = Motion.from_table(walk.as_table())
    assert np.abs(back.angles - walk.angles).max() <= COUNT / 2
    assert back.closes
    assert np.array_equal(back.as_table().goals, walk.as_table().goals)
    assert np.array_equal(back.as_table().dwells_ms, walk.as_table().dwells_ms)


def test_columns_are_found_by_name(walk: Motion, tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_bytes(b"\xef\xbb\xbf tail, time ,flm\r\n# a remark\r\n1,0,2\r\n\r\n3,0.5,4\r\n")
    motion = load_motion(path)
    assert motion.joints == ("tail", "flm")
    assert np.degrees(motion.angles) == pytest.approx(np.array([[1, 2], [3, 4]]))
    lines = data_file("robotis_walk.csv").read_text().splitlines()
    path.write_text("\n".join(lines[1:]))
    headless = load_motion(path)
    assert headless.joints == JOINTS
    assert np.array_equal(headless.angles, walk.angles)


def test_written_and_read_again(walk: Motion, tmp_path: Path) -> None:
    path = save_motion(walk, tmp_path / "new" / "walk.csv")
    assert path.read_text() == data_file("robotis_walk.csv").read_text()
    assert [p.name for p in path.parent.iterdir()] == ["walk.csv"]


@pytest.mark.parametrize(("text", "message"), [
    ("", "empty"),
    ("time,flm\n", "two rows"),
    ("time,flm\n0,1\n", "two rows"),
    ("time,flm\n0,1\n1,nan\n", "line 3, column flm: expected a finite number, found 'nan'"),
    ("time,flm\n0,1\n1,\n", "line 3, column flm: expected a finite number, found ''"),
    ("time,flm\n0,1\ninf,2\n", "line 3, column time"),
    ("time,flm\n0,1\n1\n", "line 3: expected 2 cells, found 1"),
    ("time,flm\n0,1\n1,2\n1,3\n", "row 3: time 1 s does not come after 1 s"),
    ("time,flm\n1,1\n0,2\n", "row 2: time 0 s"),
    ("flm,flt\n0,1\n", "'time'"),
    ("time,flm,flm\n0,1,1\n", "'flm' is given twice"),
    ("0,1,2\n1,1,2\n", "line 1: without a header, expected time and 15 joints, found 3 cells"),
])
def test_bad_tables_are_one_readable_line(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as raised:
        load_motion(path)
    assert str(raised.value).startswith(str(path))
    assert "\n" not in str(raised.value)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        load_motion(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"time,flm\n0,\xff\n")
    with pytest.raises(InputError, match="UTF-8"):
        load_motion(tmp_path / "b.csv")


def test_files_are_written_together_or_not_at_all(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    (tmp_path / "a").write_text("old")
    with pytest.raises(InputError, match="b: cannot be written"):
        write_together(tmp_path, {"a": "new", "b": "new"})
    assert (tmp_path / "a").read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "b"]
    with pytest.raises(InputError, match="cannot be written"):
        write_together(tmp_path / "a", {"c": "new"})


def test_moving_speeds_of_their_own_survive_the_file(tmp_path):
    rng = np.random.default_rng(0)
    table = PoseTable(("b", "a"), rng.integers(0, 1024, (6, 2)), rng.integers(0, 1024, (6, 2)), rng.integers(1, 400, 6))
    path = save_motion(Motion.from_table(table), tmp_path / "own.csv")
    back = load_motion(path).as_table()
    assert path.read_text().splitlines()[0] == "time,b,a,speed.b,speed.a"
    for field in ("goals", "speeds", "dwells_ms"):
        np.testing.assert_array_equal(getattr(back, field), getattr(table, field))


@pytest.mark.parametrize(("header", "said"), [
    ("time,a,b,speed.a", "column 'speed.b': expected speed.JOINT for every joint or for none"),
    ("time,a,speed.a,speed.c", "column 'speed.c'"),
])
def test_moving_speeds_are_of_all_joints_or_of_none(tmp_path, header, said):
    path = tmp_path / "m.csv"
    path.write_text(f"{header}\n0,0,0,0\n1,1,1,1\n")
    with pytest.raises(InputError, match=said):
        load_motion(path)


def test_a_moving_speed_is_not_negative(tmp_path):
    path = tmp_path / "m.csv"
    path.write_text("time,a,speed.a\n0,0,0\n1,1,-5\n")
    with pytest.raises(InputError, match="row 2, joint a: expected a moving speed of 0 or more"):
        load_motion(path)
