"""Captures whose header contradicts itself or its values, and C3D files of other makers."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np
import pytest

from tests.inputs.corpus import as_csv, motive
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.inspect.problems import recording_problems
from workbench.recording import Recording, read_recording

HEAD = 7
"""Rows of a Motive header."""
OWN = "XYZWXYZ"


def _moved(order: str, names: bool = True, values: bool = True, bodies: tuple[int, ...] = (0, 1)) -> str:
    """A Motive CSV whose columns of some bodies are in another order, in its header, its values or both."""
    cells = [list(row) for row in motive(60, 2)]
    at = ["XYZW".index(a) for a in order[:4]] + [4 + "XYZ".index(a) for a in order[4:]]
    for body in bodies:
        own = slice(2 + 7 * body, 9 + 7 * body)
        for row in cells[HEAD:] if values else []:
            row[own] = [row[own][i] for i in at]
        if names:
            cells[HEAD - 1][own] = list(order)
    return as_csv(cells)


def _read(folder: Path, text: str, name: str = "take.csv") -> Recording:
    (folder / name).write_text(text)
    return read_recording(folder / name)


@pytest.mark.parametrize("order", ["WXYZXYZ", "YXZWXYZ", "XYZWYXZ", "WZYXZYX"])
def test_columns_are_read_by_name_in_any_order_and_that_is_told(tmp_path: Path, order: str) -> None:
    plain, moved = _read(tmp_path, _moved(OWN)), _read(tmp_path, _moved(order), "moved.csv")
    for name, body in plain.rigid_bodies.items():
        np.testing.assert_array_equal(moved.rigid_bodies[name].quat, body.quat)
        np.testing.assert_array_equal(moved.rigid_bodies[name].p, body.p)
    assert plain.problems == ()
    expected = [what for what, here, own in (("rotation", order[:4], "XYZW"), ("position", order[4:], "XYZ")) if here != own]
    assert len(moved.problems) == len(expected)
    for what, text in zip(expected, moved.problems):
        assert text.startswith(f"the header has {what} columns in the order")
        assert "another program changed this file" in text


def test_a_header_whose_order_the_values_contradict_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"in the order W,X,Y,Z, but every body begins half a turn about z .*X,Y,Z,W, as Motive"):
        _read(tmp_path, _moved("WXYZXYZ", values=False))
    (told,) = _read(tmp_path, _moved("WXYZXYZ", names=False)).problems
    assert told.startswith("every body begins half a turn about x from neutral (W near 0, X near 1)")


@pytest.mark.parametrize(("text", "said"), [
    (_moved("YXZWXYZ", bodies=(1,)), r"Rotation columns of 'Body0' are in the order X,Y,Z,W, those of 'Body1' in Y,X,Z,W"),
    (_moved("XYZWZYX", bodies=(0,)), r"Position columns of 'Body0' are in the order Z,Y,X"),
    (_moved(OWN).replace("Rotation Type,Quaternion", "Rotation Type,XYZ"),
     r"Rotation Type 'XYZ', Euler angles, but columns Rotation W"),
    (_moved(OWN).replace("X,Y,Z,W,X,Y,Z", "X,Y,Z,W,X,Y,W"), r"Position of 'Body0' has no column Z"),
    (_moved(OWN).replace("X,Y,Z,W,X,Y,Z", "X,Y,Z,X,X,Y,Z"), r"column 6 repeats Rotation X of 'Body0'")])
def test_a_header_that_contradicts_itself_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        _read(tmp_path, text)


def test_a_capture_in_which_nothing_ever_moves_is_told(tmp_path: Path) -> None:
    cells = motive(60, 2)
    still = as_csv([*cells[:HEAD], *([*row[:2], *cells[HEAD][2:]] for row in cells[HEAD:])])
    assert any("no body ever moves" in text for text in recording_problems("x", _read(tmp_path, still)))
    assert not any("no body ever moves" in text for text in recording_problems("x", _read(tmp_path, as_csv(cells), "moves.csv")))


def _trc(axes: str, order: tuple[int, ...] = tuple(range(9))) -> str:
    rng = np.random.default_rng(3)
    corner = np.array([0.0, 0, 0, 100, 0, 0, 0, 80, 0])
    rows = [corner + np.tile([40 * np.sin(k / 9), 5, 200], 3) + rng.normal(0, 0.05, 9) for k in range(60)]
    head = ["PathFileType\t4\t(X/Y/Z)\ttake.trc", "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits", "100\t100\t60\t3\tmm",
            "Frame#\tTime\tleg_1\t\t\tleg_2\t\t\tleg_3\t\t", f"\t\t{axes}"]
    return "\n".join([*head, *(f"{k + 1}\t{k / 100:.3f}\t" + "\t".join(f"{row[i]:.4f}" for i in order)
                               for k, row in enumerate(rows))]) + "\n"


def test_markers_of_a_trc_are_read_by_the_names_of_their_axes(tmp_path: Path) -> None:
    own, other = "X1\tY1\tZ1\tX2\tY2\tZ2\tX3\tY3\tZ3", "Z1\tY1\tX1\tZ2\tY2\tX2\tZ3\tY3\tX3"
    plain = _read(tmp_path, _trc(own), "a.trc")
    moved = _read(tmp_path, _trc(other, (2, 1, 0, 5, 4, 3, 8, 7, 6)), "b.trc")
    blank = _read(tmp_path, _trc("\t" * 8), "c.trc")
    for name, places in plain.markers.items():
        np.testing.assert_array_equal(moved.markers[name], places)
        np.testing.assert_array_equal(blank.markers[name], places)
    assert [text for text in moved.problems if "another order than X, Y, Z" in text]
    for axes, said in ((own.replace("Y2", "Y1"), "found 'Y1'"), (own.replace("Z3", "Q3"), "found 'Q3'")):
        with pytest.raises(InputError, match=f"line 5: TRC: expected X, Y and Z of 3 markers, X1 to Z3, {said}"):
            _read(tmp_path, _trc(axes), "d.trc")


def _c3d(path: Path, change: Callable[[Any], None] = lambda c: None, labels: tuple[str, ...] = ("b_1", "b_2", "b_3", "b_4"),
         unseen: tuple[int, ...] = ()) -> bytes:
    """A C3D of markers of one body, as bytes."""
    c, t, rng = ezc3d.c3d(), np.arange(60) / 100, np.random.default_rng(0)
    corners = np.array([[10.0, 0, 0], [100, 0, 0], [0, 80, 0], [0, 0, 60]])
    points = np.ones((4, len(labels), len(t)))
    for i in range(len(labels)):
        points[:3, i] = corners[i % 4][:, None] + [50 * np.sin(3 * t), 0 * t, 200 + 0 * t] + rng.normal(0, 0.1, (3, len(t)))
    points[:3, list(unseen)] = np.nan
    about = c["parameters"]["POINT"]
    about["RATE"]["value"], about["LABELS"]["value"], about["UNITS"]["value"] = [100.0], list(labels), ["mm"]
    c["data"]["points"] = points
    change(c)
    c.write(str(path))
    return path.read_bytes()


def _screen(x: str, y: str) -> Callable[[Any], None]:
    def change(c: Any) -> None:
        c.add_parameter("POINT", "X_SCREEN", [x])
        c.add_parameter("POINT", "Y_SCREEN", [y])
    return change


@pytest.mark.parametrize(("x", "y", "said"), [
    ("+X", "-Y", "POINT:Y_SCREEN '-Y'; expected [+]Z or [+]Y"), ("+Y", "+X", "POINT:Y_SCREEN '[+]X'"),
    ("+X", "up", "POINT:Y_SCREEN 'UP'"), ("-Z", "+Z", "X_SCREEN '-Z' and Y_SCREEN '[+]Z'; expected two axes")])
def test_axes_of_a_c3d_that_cannot_be_are_refused(tmp_path: Path, x: str, y: str, said: str) -> None:
    _c3d(tmp_path / "a.c3d", _screen(x, y))
    with pytest.raises(InputError, match=said):
        read_recording(tmp_path / "a.c3d")


@pytest.mark.parametrize("rate", [0.0, -100.0, 1e9, float("inf"), float("nan"), 1e-30])
def test_a_rate_that_no_camera_has_is_refused(tmp_path: Path, rate: float) -> None:
    path = tmp_path / "a.c3d"
    path.write_bytes(_c3d(path).replace(struct.pack("<f", 100.0), struct.pack("<f", rate)))
    with pytest.raises(InputError, match=r"a C3D file (with POINT:RATE .* expected 0.1 to 100000 frames|that is damaged$)"):
        read_recording(path)


def test_a_c3d_that_was_cut_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.c3d"
    whole = _c3d(path)
    assert len(read_recording(path).time) == 60
    for lost in (600, 2000, 3000):
        path.write_bytes(whole[:-lost])
        with pytest.raises(InputError, match=r"a C3D file that is (cut: it holds [0-9]+ of 60 frames|damaged)"):
            read_recording(path)


def test_what_a_c3d_leaves_open_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.c3d"
    path.write_bytes(_c3d(path).replace(b"UNITS", b"UNITZ"))
    assert "the file does not say POINT:UNITS; millimetres are assumed" in read_recording(path).problems
    _c3d(path, labels=("b_1", "b_1", "b_2", "b_3"))
    assert "two markers are called 'b_1': the first is read" in read_recording(path).problems
    _c3d(path, unseen=(1,))
    found = read_recording(path)
    assert "markers never seen: b_2" in found.problems
    assert list(found.rigid_bodies) == ["b"]


WALK = Path(__file__).parents[2] / "data" / "synthetic_walk"


def _exchanged(source: Path, to: Path, order: str, kind: str = "Rotation") -> None:
    """The walk with the values of a kind under X, Y, Z, W of every body taken from the columns `order`; the header stays."""
    lines = source.read_text().splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith("Frame"))
    kinds, axes = (np.array(line.split(",")) for line in lines[head - 1:head + 1])
    columns = {name: np.flatnonzero((kinds == kind) & (axes == name)) for name in order}
    rows = np.array([line.split(",") for line in lines[head + 1:]], dtype=object)
    moved = rows.copy()
    for name, value in zip("XYZW", order):
        moved[:, columns[name]] = rows[:, columns[value]]
    to.write_text("\n".join([*lines[:head + 1], *(",".join(row) for row in moved)]) + "\n")


@pytest.mark.parametrize("order", ["XYZW", "YXZW", "XZYW", "ZYXW", "YZXW", "ZXYW", "WXYZ"])
def test_the_robots_joints_show_exchanged_components(tmp_path: Path, order: str) -> None:
    """Not even the header tells: the values alone were moved, by all bodies alike."""
    _exchanged(WALK / "walk.csv", tmp_path / "walk.csv", order)
    problems = recording_problems("x", read_recording(tmp_path / "walk.csv"), load_session(WALK).model)
    told = [text for text in problems if "are the columns exchanged?" in text]
    assert len(told) == (order != "XYZW")
    assert all(f"if its X,Y,Z,W hold {','.join(order)}: " in text for text in told)


@pytest.mark.parametrize(("order", "said"), [
    ("YXZ", "hold Y,X,Z: are the columns of the positions exchanged?"), ("XZY", "hold X,Z,Y: are the columns of the positions"),
    ("YZX", "hold Y,Z,X: are the columns of the positions exchanged?"), ("ZYX", "the mirror image of the robot's links"),
    ("ZXY", "say that z is up in this export")])
def test_the_robots_links_show_exchanged_positions(tmp_path: Path, order: str, said: str) -> None:
    _exchanged(WALK / "walk.csv", tmp_path / "walk.csv", order, "Position")
    problems = recording_problems("x", read_recording(tmp_path / "walk.csv"), load_session(WALK).model)
    assert any(said in text for text in problems)


def test_what_a_trc_contradicts_is_told_or_refused(tmp_path: Path) -> None:
    own = _trc("X1\tY1\tZ1\tX2\tY2\tZ2\tX3\tY3\tZ3")
    slow = _read(tmp_path, own.replace("100\t100\t60", "25\t100\t60"), "a.trc")
    assert "the header says 25 frames a second, the times 100; the times are used" in slow.problems
    assert slow.rate == pytest.approx(100)
    assert "two markers are called 'leg_1': the first is read" in _read(tmp_path, own.replace("leg_2", "leg_1"), "b.trc").problems
    lines = own.splitlines()
    wider = "\n".join([*lines[:20], f"{lines[20]}\t1\t2\t3", *lines[21:]]) + "\n"
    with pytest.raises(InputError, match="line 21: TRC: 12 numbers of 3 markers; expected 9"):
        _read(tmp_path, wider, "c.trc")


@pytest.mark.parametrize(("columns", "said"), [
    ("x,y,z,qw,qx,qy,qz,x", "column 'leg.x' is given twice"), ("x_mm,y,z,qw,qx,qy,qz", "in metres and in millimetres"),
    ("x,y,z,qw,qx,qy,qz,x_mm", "in metres and in millimetres")])
def test_columns_of_poses_that_contradict_each_other_are_refused(tmp_path: Path, columns: str, said: str) -> None:
    names = columns.split(",")
    rows = [f"{k / 100}" + ",0" * len(names) for k in range(30)]
    with pytest.raises(InputError, match=said):
        _read(tmp_path, "\n".join([",".join(["time", *(f"leg.{name}" for name in names)]), *rows]) + "\n")
