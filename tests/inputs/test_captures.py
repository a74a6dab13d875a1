"""Motive exports: gaps, wrong headers, exchanged names, and tables that a spreadsheet wrote."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.inputs.corpus import as_csv, motive
from tests.recording_robot import capture, write_robot
from workbench.files import InputError
from workbench.recording import BodyTrack, read_recording, survey
from workbench.recording.formats.file_kind import file_kind
from workbench.recording.mocap.mending import mend
from workbench.recording.mocap.tracks import tracks_of

HEADER = 7  # rows of it


def _told(folder: Path, change: Callable[[list[list[str]]], None]) -> tuple[str, ...]:
    cells = motive()
    change(cells)
    path = folder / "take.csv"
    path.write_text(as_csv(cells))
    recording = read_recording(path)
    return (*recording.problems, *survey(recording))


def test_a_sound_capture_has_nothing_to_tell(tmp_path: Path) -> None:
    assert _told(tmp_path, lambda cells: None) == ()


def _frozen(cells: list[list[str]]) -> None:
    for row in range(HEADER + 60, HEADER + 100):
        cells[row][2:] = cells[HEADER + 59][2:]


def _lost(cells: list[list[str]]) -> None:
    for row in range(HEADER + 60, HEADER + 100):
        cells[row][2:] = ["0", "0", "0", "1", "0", "0", "0"]


def _every_second(cells: list[list[str]]) -> None:
    for row in range(HEADER + 1, len(cells), 2):
        cells[row][2:] = cells[row - 1][2:]


def _long_quaternions(cells: list[list[str]]) -> None:
    for row in cells[HEADER:]:
        row[2:6] = [f"{1.3 * float(c):.6f}" for c in row[2:6]]


def _rough_quaternions(cells: list[list[str]]) -> None:
    for row in cells[HEADER:]:
        row[2:6] = [f"{float(c):.2f}" for c in row[2:6]]


def _leap(cells: list[list[str]]) -> None:
    cells[-1][0] = "3000000"


def _other_rate(cells: list[list[str]]) -> None:
    cells[0][5] = cells[0][7] = "12.000000"


def _decimated(cells: list[list[str]]) -> None:
    cells[0][7] = "60.000000"
    for k, row in enumerate(cells[HEADER:]):
        row[0], row[1] = str(2 * k), f"{k / 60:.6f}"


def _local(cells: list[list[str]]) -> None:
    cells[0][cells[0].index("Global")] = "Local"


def _far(cells: list[list[str]]) -> None:
    for row in cells[HEADER + 50:HEADER + 60]:
        row[6] = "1e20"


@pytest.mark.parametrize(("change", "said"), [
    (_frozen, "40 frame(s) repeat the pose before to the last digit"), (_lost, "40 frame(s) at the origin without a rotation"),
    (_every_second, "poses change in only 60 of 120 frames a second"),
    (_long_quaternions, "240 of 240 quaternions are not of unit"),
    (_rough_quaternions, "quaternions are not of unit length"), (_leap, "frame number leaps from 238 to 3000000"),
    (_other_rate, "the header says 12 frames a second, the Time column 120"), (_decimated, "frame numbers count every 2"),
    (_local, "Coordinate Space Local"), (_far, "more than 1000 m away"),
])
def test_what_is_wrong_is_told(tmp_path: Path, change: Callable[[list[list[str]]], None], said: str) -> None:
    assert any(said in p for p in _told(tmp_path, change))


def _every_fourth(cells: list[list[str]]) -> None:
    for row in range(HEADER, len(cells)):
        if (row - HEADER) % 4:
            cells[row][2:] = cells[row - 1][2:]


def _coarse_and_frozen(cells: list[list[str]]) -> None:
    """To a millimetre, which hides the noise, and held while the body moves."""
    for row in cells[HEADER:]:
        row[2:6], row[6:9] = [f"{float(c):.4f}" for c in row[2:6]], [f"{float(c):.3f}" for c in row[6:9]]
    _frozen(cells)


def _backwards(cells: list[list[str]]) -> None:
    for row in cells[HEADER:]:
        row[1] = f"{-float(row[1]):.6f}"


@pytest.mark.parametrize(("change", "said"), [
    (_every_fourth, "poses change in only 30 of 120"), (_coarse_and_frozen, "40 frame(s) repeat"), (_backwards, "Time column"),
])
def test_siblings_are_told(tmp_path: Path, change: Callable[[list[list[str]]], None], said: str) -> None:
    assert any(said in p for p in _told(tmp_path, change))


def test_what_was_not_seen_is_a_gap(tmp_path: Path) -> None:
    for change in (_frozen, _lost):
        _told(tmp_path, change)
        tracks = mend(tracks_of(read_recording(tmp_path / "take.csv")))
        assert not tracks.seen[0, 62:99].any()
        assert tracks.seen[0, :59].all()


def test_a_rate_that_time_contradicts_is_not_used(tmp_path: Path) -> None:
    _told(tmp_path, _other_rate)
    assert read_recording(tmp_path / "take.csv").time[-1] == pytest.approx(239 / 120, abs=1e-3)
    _told(tmp_path, _leap)
    assert read_recording(tmp_path / "take.csv").time[-1] == pytest.approx(239 / 120)


def test_a_body_that_rests_without_noise_is_not_frozen(tmp_path: Path) -> None:
    model = write_robot(tmp_path)
    still = capture(model, noise=0.0)
    assert not any("repeat" in p or "lost" in p for p in survey(still.recording))


@pytest.mark.parametrize(("content", "line"), [("1e25", "line 9"), ("1.5", "line 9"), ("-5", "line 9")])
def test_frame_numbers_that_are_none(tmp_path: Path, content: str, line: str) -> None:
    with pytest.raises(InputError, match=line):
        _told(tmp_path, lambda cells: cells[HEADER + 1].__setitem__(0, content))


@pytest.mark.parametrize("how", ["utf-16", "cr", "semicolon", "tab", "stray quote", "cr in header"])
def test_written_by_other_programs(tmp_path: Path, how: str) -> None:
    text = as_csv(motive())
    path = tmp_path / "take.csv"
    content = {"utf-16": text.encode("utf-16"), "cr": text.replace("\n", "\r").encode(),
               "tab": text.replace(",", "\t").encode(),
               "semicolon": text.replace(".", "?").replace(",", ";").replace("?", ",").encode(),
               "stray quote": text.replace("0.100", '"0.100', 1).encode(),
               "cr in header": text.replace("demo", "de\rmo").encode()}[how]
    path.write_bytes(content)
    if how == "stray quote":
        with pytest.raises(InputError, match="line"):
            read_recording(path)
        return
    recording = read_recording(path)
    assert (len(recording.time), recording.rate, list(recording.rigid_bodies)) == (240, 120.0, ["Body0"])
    assert np.nanmean(recording.rigid_bodies["Body0"].p[:, 2]) == pytest.approx(0.05, abs=1e-3)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory):
    model = write_robot(tmp_path_factory.mktemp("robot"))
    return model, capture(model, noise=2e-3, seed=3)


def test_z_up_is_seen_and_turned(made) -> None:
    model, captured = made
    bodies = {a: BodyTrack(np.stack([b.p[:, 0], -b.p[:, 2], b.p[:, 1]], axis=1),
                           np.stack([b.quat[:, 0], b.quat[:, 1], -b.quat[:, 3], b.quat[:, 2]], axis=1))
              for a, b in captured.recording.rigid_bodies.items()}
    lying = mend(tracks_of(replace(captured.recording, rigid_bodies=bodies)), model)
    upright = mend(tracks_of(captured.recording), model)
    assert any("z is up in this export" in p for p in lying.problems)
    assert not any("z is up" in p for p in upright.problems)
    np.testing.assert_allclose(lying.p, upright.p, atol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(lying.q * upright.q, axis=-1)), 1, atol=1e-12)


def test_names_that_are_exchanged_and_mirrored_captures_are_told(made) -> None:
    model, captured = made
    bodies = dict(captured.recording.rigid_bodies)
    assert not any("exchanged" in p or "mirror" in p for p in mend(tracks_of(captured.recording), model).problems)
    first = {name: np.nanmedian(body.p[:10], axis=0) for name, body in bodies.items()}
    a, b = max(((a, b) for a in first for b in first if a < b), key=lambda pair: np.linalg.norm(first[pair[0]] - first[pair[1]]))
    wrong = replace(captured.recording, rigid_bodies=bodies | {a: bodies[b], b: bodies[a]})
    told = mend(tracks_of(wrong), model).problems
    assert any("begin in each other's places" in p and f"'{a}'" in p and f"'{b}'" in p for p in told)
    mirrored = {name: BodyTrack(body.p * [1, 1, -1], body.quat * [1, -1, -1, 1]) for name, body in bodies.items()}
    told = mend(tracks_of(replace(captured.recording, rigid_bodies=mirrored)), model).problems
    assert any("mirror image" in p for p in told)


@pytest.mark.parametrize("factor", [0.001, 0.1, 10.0, 1000.0])
def test_lengths_of_another_unit_are_seen_and_mended(made, factor: float) -> None:
    model, captured = made
    bodies = {a: BodyTrack(factor * b.p, b.quat) for a, b in captured.recording.rigid_bodies.items()}
    told = mend(tracks_of(replace(captured.recording, rigid_bodies=bodies)), model)
    assert any("Length Units are wrong" in p for p in told.problems)
    np.testing.assert_allclose(told.p, mend(tracks_of(captured.recording), model).p, atol=1e-9)


@pytest.mark.parametrize("header", [
    "Pos X,Pos Y,Pos Z,Rot X,Rot Y,Rot Z,Rot W", "time,x,y,z,qx,qy,qz,qw", "time;x;y;z;qx;qy;qz;qw",
    "#timestamp x y z qx qy qz qw",
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []",
    "Frame,Dog Pos X,Dog Pos Y,Dog Pos Z,Dog Rot X,Dog Rot Y,Dog Rot Z,Dog Rot W",
    "%time,field.pose.position.x,field.pose.position.y,field.pose.position.z,field.pose.orientation.x,field.pose.orientation.y,"
    "field.pose.orientation.z,field.pose.orientation.w",
])
def test_a_clients_pose_log_is_named_as_one(tmp_path: Path, header: str) -> None:
    between = next(mark for mark in (";", ",", " ") if mark in header)
    (tmp_path / "x.csv").write_text(header + "\n" + between.join(["1"] * (header.count(between) + 1)) + "\n")
    assert file_kind(tmp_path / "x.csv") == "recording"
    with pytest.raises(InputError, match="NatNet client's pose log"):
        read_recording(tmp_path / "x.csv")
