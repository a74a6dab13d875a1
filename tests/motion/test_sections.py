"""Motions of sections: the start and the stop are played once, the loop between them again and again."""

from pathlib import Path

import numpy as np
import pytest

from workbench.device.tables.firmware_tables import GOALS, read_tables, write_tables
from workbench.device.tables.limits import check_limits
from workbench.files import InputError
from workbench.inspect.problems import motion_problems
from workbench.motion import Motion, interpolate_motion, load_motion, save_motion
from workbench.recording.formats.file_kind import file_kind
from workbench.robot import puppy_model
from workbench.simulation import Simulation, SimulationConfig
from workbench.simulation.play import play_motion

SECTIONED = """\
# cycles: 3
section,time,flm,frm
start,0,0,0
start,0.5,10,-10
start,0.7,20,-20
loop,0.9,30,-20
loop,1.2,15,-30
loop,1.4,20,-20
stop,1.7,5,-5
stop,2.2,0,0
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "gait.csv"
    path.write_text(SECTIONED)
    return path


def test_sections_are_played_start_loops_stop(file: Path) -> None:
    motion = load_motion(file)
    assert (motion.start, motion.stop, motion.cycles, motion.closes) == (2, 2, 3, True)
    assert motion.duration == pytest.approx(0.7)
    assert motion.seconds() == pytest.approx(0.7 + 3 * 0.7 + 0.8)
    commands = motion.commands(2)
    assert commands.poses.tolist() == [0, 1, 2, 3, 4, 2, 3, 4, 5, 6]
    assert commands.times == pytest.approx([0, 0.5, 0.7, 0.9, 1.2, 1.4, 1.6, 1.9, 2.1, 2.4])
    assert commands.end == pytest.approx(motion.seconds(2))
    assert motion.commands().poses.tolist() == motion.commands(3).poses.tolist()
    assert motion.as_table().period == pytest.approx(0.7)


def test_without_sections_all_is_the_loop(tmp_path: Path) -> None:
    plain, sectioned = tmp_path / "plain.csv", tmp_path / "loop.csv"
    plain.write_text("time,flm\n0,0\n0.2,10\n0.4,0\n")
    sectioned.write_text("section,time,flm\nloop,0,0\nloop,0.2,10\nloop,0.4,0\n")
    one, other = load_motion(plain), load_motion(sectioned)
    assert (other.start, other.stop, other.cycles) == (0, 0, None) == (one.start, one.stop, one.cycles)
    assert np.array_equal(one.commands(3).goals, other.commands(3).goals)
    assert one.seconds(3) == pytest.approx(one.commands(3).end)


def test_first_pose_of_the_loop_is_in_time_from_both_sides(tmp_path: Path) -> None:
    """It comes from the start's last pose once, and from the loop's own last pose ever after: the longer way sets the speed."""
    path = tmp_path / "gait.csv"
    for start, end in ((20, 0), (0, 20)):
        path.write_text(f"section,time,flm\nstart,0,0\nstart,1,{start}\nloop,1.5,30\nloop,2,{end}\n")
        commands = load_motion(path).commands(2)
        assert np.degrees(commands.speeds[1, 0]) == pytest.approx(60, abs=0.7)  # 30 deg in 0.5 s, a count is 0.67 deg/s


def test_written_and_read_again(file: Path, tmp_path: Path) -> None:
    motion = load_motion(file)
    again = load_motion(save_motion(motion, tmp_path / "again.csv"))
    assert (again.start, again.stop, again.cycles) == (2, 2, 3)
    assert np.array_equal(again.as_table().goals, motion.as_table().goals)
    fixed = Motion.from_table(motion.as_table())  # with moving speeds of its own
    read = load_motion(save_motion(fixed, tmp_path / "speeds.csv")).as_table()
    for name in ("goals", "speeds", "dwells_ms", "start", "stop"):
        assert np.array_equal(getattr(read, name), getattr(motion.as_table(), name)), name
    assert file_kind(file) == file_kind(tmp_path / "speeds.csv") == "motion"
    assert motion_problems(fixed) == []


def test_unrolled_is_the_same_motion_played_once(file: Path) -> None:
    motion = Motion.from_table(load_motion(file).as_table())
    once = motion.unrolled(4)
    assert (once.start, once.stop) == (0, 0)
    for name in ("times", "goals", "speeds"):
        assert np.array_equal(getattr(once.commands(), name), getattr(motion.commands(4), name)), name
    smooth = interpolate_motion(load_motion(file), 2, 1e-3)
    assert smooth.time[-1] == pytest.approx(motion.seconds(2))
    assert np.degrees(smooth.q[[1400, 1600, 2100], 0]) == pytest.approx([20, 30, 20], abs=0.05)


def test_ideal_joints_follow_the_sections(file: Path) -> None:
    model = puppy_model()
    motion = load_motion(file, model)
    take = play_motion(Simulation(model, SimulationConfig(base="fixed", drive="ideal", time_step=2e-3)), motion)
    assert take.time[-1] == pytest.approx(motion.seconds(3), abs=0.01)
    at = int(np.searchsorted(take.time, 1.4 + 0.7))  # the second loop's end
    assert np.degrees(take.q[at, take.column("flm")]) == pytest.approx(20, abs=0.3)


def test_text_tables_say_their_sections(file: Path, tmp_path: Path) -> None:
    table = load_motion(file).as_table()
    write_tables(table, tmp_path)
    again = read_tables(tmp_path)
    assert (again.start, again.loop, again.stop) == (2, 3, 2)
    assert "#define MOTION_LOOP_POSES 3" in (tmp_path / "motion.h").read_text()
    said = (tmp_path / GOALS).read_text()
    (tmp_path / GOALS).write_text(said.replace("loop 3", "loop 4"))
    with pytest.raises(InputError, match="says 8 poses, and 7 follow"):
        read_tables(tmp_path)


def test_speed_at_once_counts_the_travel_within_the_sections() -> None:
    model = puppy_model()
    motion = Motion("m", np.array([0, 1.0, 2.0, 2.1, 3.0]), ("flm",), np.radians([[0.0], [40], [40], [0], [0]]), start=1, stop=2,
                    speeds=np.zeros((5, 1)))
    said = check_limits(motion.as_table(), model)
    assert [v.pose for v in said if v.kind == "speed"] == [3]  # 40 deg in 0.1 s; the way from neutral and the loop are slow


@pytest.mark.parametrize(("old", "new", "message"), [
    ("loop,1.2", "start,1.2", "line 7, column section: 'start' after 'loop'"),
    ("stop,1.7", "end,1.7", "line 9, column section: expected start, loop, stop, found 'end'"),
    ("start,0.5", "loop,0.5", "line 5, column section: 'start' after 'loop'"),
    ("# cycles: 3", "# cycles: 0", "line 1: expected '# cycles: N' with N from 1 to 10000"),
    ("# cycles: 3", "# cycles: many", "line 1: expected"),
    ("loop,", "stop,", "expected rows of a loop"),
    ("start,0.5,10,-10\nstart,0.7,20,-20\n", "", "line 3, column section: 'start' has no pose"),
])
def test_bad_sections_are_one_readable_line(old: str, new: str, message: str, file: Path) -> None:
    file.write_text(file.read_text().replace(old, new))
    with pytest.raises(InputError) as error:
        load_motion(file)
    assert message in str(error.value)
