"""ROBOTIS motion files, on a published one and on small ones with each trouble."""

from pathlib import Path

import numpy as np
import pytest

from tests.shared_data import shared
from workbench.files import InputError
from workbench.motion import load_motion, load_mtn
from workbench.robot import COUNT

IDS = " ".join(["0", "1", "1"])
GOOD = f"""type=motion
version=1.01
enable={IDS}
motor_type=0 0 0
page_begin
name=go
compliance=5 5 7
play_param=0 2 1 2.0 32
step=512 612 412 0.200 0.400
step=512 512 512 0.000 0.096
page_end
page_begin
name=
compliance=5 5 5
play_param=0 0 1 1.0 32
page_end
"""


def write(folder: Path, text: str, encoding: str = "utf-8") -> Path:
    path = folder / "a.mtn"
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("text", [GOOD, GOOD.replace("\n", "\r\n"), "\ufeff" + GOOD + "1c", GOOD + "1c\n"])
def test_page_becomes_a_motion(text: str, tmp_path: Path) -> None:
    """Pauses and times are halved by the speed rate; a pause is a second row of its pose."""
    file = load_mtn(write(tmp_path, text))
    assert len(file.pages) == 2
    page = file.page()
    assert (page.number, page.name, page.next, page.exit, page.repeat, page.inertial_force) == (1, "go", 0, 2, 1, 32)
    assert page.compliance.tolist() == [5, 5, 7]
    motion = file.motion("go", {"b": 1, "a": 2, "unmoved": 9})
    assert motion.joints == ("a", "b")
    assert motion.times == pytest.approx([0, 0.2, 0.3, 0.348])
    assert motion.angles / COUNT == pytest.approx(np.array([[0, 0], [-100, 100], [-100, 100], [0, 0]]))


def test_page_that_follows_itself_starts_at_its_end(tmp_path: Path) -> None:
    file = load_mtn(write(tmp_path, GOOD.replace("play_param=0 2", "play_param=1 2").replace("512 512 512", "512 513 511")))
    assert file.motion(1, {"b": 1, "a": 2}).closes


def test_a_motion_of_another_robot_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD)
    with pytest.raises(InputError, match="bus ID 2 moves in this file, but no joint"):
        load_motion(path)
    with pytest.raises(InputError, match=r"expected one page .stop. with steps, found 0.*pages: go"):
        load_motion(f"{path}#stop")


@pytest.mark.parametrize(("old", "new", "message"), [
    ("type=motion", "type=task", "expected type=motion"),
    ("412 0.200 0.400", "412 0.200", "line 9: step: expected 5 finite numbers, found 4"),
    ("412 0.200 0.400", "1024 0.200 0.400", "line 9: step: expected positions from 0 to 1023"),
    ("412 0.200 0.400", "412 0.200 0", "line 9: step: expected a pause"),
    ("412 0.200 0.400", "412 x 0.400", "line 9: step: expected numbers"),
    ("0 2 1 2.0 32", "0 2 1 0 32", "speed rate 0"),
    ("motor_type=0 0 0\n", "", "expected one motor_type="),
    ("name=go\n", "name=go\nname=went\n", "expected one name=, found 2"),
    ("name=go\n", "going\n", "line 6: expected key=value, found 'going'"),
    ("page_end\n", "", "in pairs"),
    ("page_begin", "page_start", "in pairs"),
])
def test_bad_files_name_the_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert old in GOOD
    with pytest.raises(InputError, match=message):
        load_mtn(write(tmp_path, GOOD.replace(old, new)))


def test_the_published_file() -> None:
    """A humanoid's; its times are multiples of 8 ms (facts, 2.3)."""
    file = load_mtn(shared("data/mtn/bio_gp_humanoid_kr.mtn"))
    assert (file.version, len(file.pages), sum(len(p.times) for p in file.pages)) == ("1.01", 255, 264)
    ticks = np.concatenate([np.r_[p.times, p.pauses] for p in file.used]) / 0.008
    assert np.abs(ticks - np.round(ticks)).max() < 1e-6
    assert np.flatnonzero(file.enable).tolist() == list(range(1, 19))
    motion = file.motion("f_r1", {f"id{i:02}": i for i in range(1, 19)})
    assert motion.times == pytest.approx([0, 0.064, 0.128, 0.192])
    goals = np.round(512 + motion.angles[1] / COUNT)
    assert goals.tolist() == [342, 681, 572, 451, 762, 261, 512, 512, 517, 510, 742, 273, 858, 167, 700, 325, 547, 520]
