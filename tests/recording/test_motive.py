"""Motive CSV: every header variant that has been seen, written here from one set of numbers and read back to it."""

import csv
import io
from dataclasses import dataclass
from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.shared_data import shared
from workbench.files import InputError
from workbench.recording import BodyTrack, read_motive, read_recording, write_motive

RNG = np.random.default_rng(7)
N = 40
NAMES = ("body", "FL btm")
P = {n: RNG.normal(size=(N, 3)) for n in NAMES}
R = {n: Rotation.random(N, rng=i + 1) for i, n in enumerate(NAMES)}
MARKER = RNG.normal(size=(N, 3))
UNIT = {"Meters": 1.0, "Centimeters": 0.01, "Millimeters": 0.001}


@dataclass
class Variant:
    """How one exporter writes."""

    version: str = "1.23"
    rotation: str = "Quaternion"
    units: str = "Meters"
    start: str = "2020-09-14 02.11.09.214 PM"
    labels: bool = True
    parent: bool = False
    timecode: bool = False
    quoted: bool = False
    padded: int = 0
    newline: str = "\n"
    bom: bool = False
    error: str = "Mean Marker Error"
    metadata: bool = True
    reverse: bool = False
    kind: str = "Rigid Body"
    time: str = "Time (Seconds)"
    first: int = 0
    missing: tuple[int, ...] = ()
    blank: tuple[int, ...] = ()


def export(v: Variant) -> bytes:
    """The file that such an exporter would write."""
    columns: list[tuple[str, str, str, str, np.ndarray]] = []
    for n in NAMES:
        if v.rotation == "Quaternion":
            columns += [(v.kind, n, "Rotation", a, c) for a, c in zip("XYZW", R[n].as_quat().T)]
        else:
            angles = R[n].as_euler(v.rotation, degrees=True)
            columns += [(v.kind, n, "Rotation", a, angles[:, v.rotation.index(a)]) for a in "XYZ"]
        columns += [(v.kind, n, "Position", a, c / UNIT[v.units]) for a, c in zip("XYZ", P[n].T)]
        columns += [(v.kind, n, v.error, "", np.full(N, 2e-4 / UNIT[v.units]))]
    columns += [("Marker", "body:Marker 1", "Position", a, c / UNIT[v.units]) for a, c in zip("XYZ", MARKER.T)]
    columns += [("Rigid Body Marker", "body:Marker 1", "Position", a, c) for a, c in zip("XYZ", np.zeros((3, N)))]
    if v.reverse:
        columns = columns[::-1]
    extra = [""] if v.timecode else []
    label = (lambda s: s) if v.labels else (lambda s: "")
    quote = (lambda s: f'"{s}"') if v.quoted else (lambda s: s)
    ids = {n: quote(f"{i:032X}") for i, n in enumerate(dict.fromkeys(c[0] + c[1] for c in columns))}
    meta = ["Format Version", v.version, "Take Name", "walk", "Take Notes", "", "Capture Frame Rate", "120.000000",
            "Export Frame Rate", "120.000000", "Capture Start Time", v.start, "Total Frames in Take", str(N),
            "Total Exported Frames", str(N - len(v.missing)), "Rotation Type", v.rotation, "Length Units", v.units,
            "Coordinate Space", "Global"]
    rows = [meta, []] if v.metadata else []
    rows += [["", label("Type"), *extra, *(c[0] for c in columns)], ["", label("Name"), *extra, *(c[1] for c in columns)],
             ["", label("ID"), *extra, *(ids[c[0] + c[1]] for c in columns)]]
    if v.parent:
        rows.append(["", "Parent", *extra, *("Root" for _ in columns)])
    rows += [["", "", *extra, *(c[2] for c in columns)],
             ["Frame", v.time, *(["TimeCode"] if v.timecode else []), *(c[3] for c in columns)]]
    for i in (i for i in range(N) if i not in v.missing):
        code = [f"15:26:46:12.{i:02d}"] if v.timecode else []
        values = ["" if i in v.blank and c[0] != "Marker" else repr(float(c[4][i])) for c in columns]
        rows.append([str(v.first + i), f"{i / 120:.3f}", *code, *values])
    width = len(columns) + 2 + len(extra)
    if v.padded:
        rows = [r + [""] * (max(width, len(meta)) + v.padded - len(r)) for r in rows]
    text = v.newline.join(",".join(r) for r in rows) + v.newline
    return (b"\xef\xbb\xbf" if v.bom else b"") + text.encode()


def check(path, v: Variant):
    r = read_recording(path)
    seen = np.array([i for i in range(N) if i not in v.missing])
    assert (r.kind, r.version, r.units) == ("motive", v.version if v.metadata else "", v.units)
    assert r.rate == pytest.approx(120.0, rel=1e-2)
    np.testing.assert_array_equal(r.frames, seen + v.first)
    np.testing.assert_allclose(r.time, (seen - seen[0]) / r.rate, atol=1e-12)
    assert tuple(sorted(r.rigid_bodies)) == tuple(sorted(NAMES))
    gone = np.isin(seen, v.blank)
    for n in NAMES:
        body = r.rigid_bodies[n]
        assert np.isnan(body.p[gone]).all()
        assert np.isnan(body.quat[gone]).all()
        np.testing.assert_allclose(body.p[~gone], P[n][seen][~gone], atol=1e-12)
        turn = Rotation.from_quat(body.quat[~gone], scalar_first=True) * R[n][seen[~gone]].inv()
        np.testing.assert_allclose(turn.magnitude(), 0, atol=1e-7)
        np.testing.assert_allclose(body.error[~gone], 2e-4, rtol=1e-9)
    np.testing.assert_allclose(r.markers["body:Marker 1"], MARKER[seen], atol=1e-12)
    assert set(r.markers) == {"body:Marker 1", "body:Marker 1 (Rigid Body Marker)"}
    return r


VARIANTS = {
    "1.20": Variant(version="1.20", labels=False, time="Time", error="Error Per Marker"),
    "1.21": Variant(version="1.21", labels=False, time="Time", error="Error Per Marker", quoted=True, newline="\r\n"),
    "1.22": Variant(version="1.22", labels=False, start="2020-09-14 12.05.03.445 P.M.", error="Error Per Marker"),
    "1.23": Variant(),
    "1.24": Variant(version="1.24", timecode=True, start="2026-08-04 03.25.40"),
    "1.25": Variant(version="1.25", parent=True),
    "1.25 with time code": Variant(version="1.25", parent=True, timecode=True),
    "bones": Variant(version="1.25", parent=True, kind="Bone"),
    "Hungarian": Variant(start="2023-11-28 10.27.58.765 DU."),
    "no start time": Variant(start=""),
    "CRLF": Variant(newline="\r\n"),
    "BOM": Variant(bom=True),
    "quoted": Variant(quoted=True),
    "padded": Variant(padded=3),
    "padded, CRLF, BOM": Variant(padded=5, newline="\r\n", bom=True),
    "padded 1.21": Variant(version="1.21", labels=False, padded=2),
    "first frame not zero": Variant(first=72210),
    "holes": Variant(first=5, missing=(3, 4, 20)),
    "gaps": Variant(blank=(0, 7, 8, 9, 39)),
    "columns in reverse": Variant(reverse=True),
    "header switched off": Variant(metadata=False),
} | {f"{order} {unit}": Variant(rotation=order, units=unit) for order in map("".join, permutations("XYZ")) for unit in UNIT} | {
    unit: Variant(units=unit) for unit in UNIT}


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_reads_to_the_same_numbers(tmp_path, name):
    path = tmp_path / "take.csv"
    path.write_bytes(export(VARIANTS[name]))
    r = check(path, VARIANTS[name])
    if VARIANTS[name].missing:
        assert r.problems == ("frames missing: 3 in 2 hole(s), the first after frame 7",)
    elif name == "header switched off":
        assert any("frame rate" in p for p in r.problems)
    elif name == "columns in reverse":
        assert [p.partition(" columns")[0] for p in r.problems] == ["the header has rotation", "the header has position"]
    else:
        assert r.problems == ()
    if VARIANTS[name].timecode:
        assert r.metadata["First TimeCode"] == "15:26:46:12.00"


@pytest.mark.parametrize("seed", range(12))
def test_variants_at_random(tmp_path, seed):
    rng = np.random.default_rng(seed)
    v = Variant(rotation=str(rng.choice(["Quaternion", *map("".join, permutations("XYZ"))])), units=str(rng.choice(list(UNIT))),
                labels=bool(rng.integers(2)), timecode=bool(rng.integers(2)), quoted=bool(rng.integers(2)),
                padded=int(rng.integers(3)), newline=str(rng.choice(["\n", "\r\n"])),
                bom=bool(rng.integers(2)), reverse=bool(rng.integers(2)),
                first=int(rng.integers(1000)), missing=tuple(rng.choice(np.arange(1, N), 3, replace=False)),
                blank=tuple(rng.choice(N, 4)))
    path = tmp_path / "take.csv"
    path.write_bytes(export(v))
    check(path, v)


def test_a_cut_file_names_file_and_line(tmp_path):
    whole = export(Variant())
    path = tmp_path / "cut.csv"
    last = whole.rstrip(b"\n").rfind(b"\n") + 1
    for at in range(last + 1, len(whole) - 1, 37):
        path.write_bytes(whole[:at])
        with pytest.raises(InputError, match=rf"cut\.csv: line {6 + N + 1}: .*cut"):
            read_recording(path)
    middle = whole.find(b"\n", len(whole) // 2) + 60
    path.write_bytes(whole[:middle])
    with pytest.raises(InputError, match="cut mid-row"):
        read_recording(path)
    path.write_bytes(whole[:last])  # between rows nothing is wrong but the count
    assert read_recording(path).problems == ("the header announces 40 frames, the file holds 39",)


@pytest.mark.parametrize(("old", "new", "message"), [
    (b"Length Units,Meters", b"Length Units,Furlongs", "Length Units 'Furlongs'"),
    (b"Export Frame Rate,120.000000", b"Export Frame Rate,fast", "Export Frame Rate is 'fast'"),
    (b"Frame,Time (Seconds)", b"Fr", "no row starts with 'Frame'"),
    (b"\n3,0.025,", b"\n2,0.025,", "line 11: frame 2 does not follow"),
    (b"\n3,0.025,", b"\n3,O.O25,", "line 11, column 2: expected a number, got 'O.O25'"),
    (b"\n3,0.025,", b"\n3,", "line 11: 23 of 24 columns"),
])
def test_bad_input_is_one_line(tmp_path, old, new, message):
    path = tmp_path / "bad.csv"
    content = export(Variant())
    assert old in content
    path.write_bytes(content.replace(old, new, 1))
    with pytest.raises(InputError, match=message.replace("(", r"\(")) as e:
        read_motive(path)
    assert str(e.value).startswith(f"{path}: ")
    assert "\n" not in str(e.value)


def test_euler_angles_need_an_order(tmp_path):
    path = tmp_path / "take.csv"
    path.write_bytes(export(Variant(rotation="XYZ")).replace(b"Rotation Type,XYZ", b"Rotation Type,Quaternion"))
    with pytest.raises(InputError, match="Rotation Type 'Quaternion' with three columns"):
        read_motive(path)


def test_a_missing_or_empty_file(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_motive(tmp_path / "none.csv")
    (tmp_path / "empty.csv").write_bytes(b"")
    for read in (read_motive, read_recording):
        with pytest.raises(InputError, match="empty"):
            read(tmp_path / "empty.csv")
    header_only = export(Variant()).split(b"\n0,")[0] + b"\n"
    (tmp_path / "rows.csv").write_bytes(header_only)
    with pytest.raises(InputError, match="line 8: expected at least one row"):
        read_motive(tmp_path / "rows.csv")


@pytest.mark.parametrize("units", UNIT)
def test_written_and_read_back(tmp_path, units):
    quat = {n: R[n].as_quat(scalar_first=True) for n in NAMES}
    p = {n: P[n].copy() for n in NAMES}
    p["body"][5:9], quat["body"][5:9] = np.nan, np.nan
    bodies = {n: BodyTrack(p[n], quat[n], np.full(N, 1e-4)) for n in NAMES}
    path = write_motive(tmp_path / "deep" / "out.csv", bodies, 120.0, units=units, first_frame=12,
                        metadata={"Take Notes": "a, b"})
    r = read_motive(path)
    assert (r.version, r.units, r.rate, r.frames[0], r.problems) == ("1.23", units, 120.0, 12, ())
    assert r.metadata["Take Notes"] == "a, b"
    for n in NAMES:
        np.testing.assert_allclose(r.rigid_bodies[n].p, p[n], atol=6e-7)
        np.testing.assert_allclose(r.rigid_bodies[n].quat, quat[n], atol=6e-7)
    again = write_motive(tmp_path / "again.csv", r.rigid_bodies, r.rate, units=units, first_frame=12, metadata=r.metadata,
                         take_name="out")
    assert again.read_bytes() == path.read_bytes()


def test_a_file_of_many_blocks_is_read_whole(tmp_path):
    """Larger than the reader's blocks; compared with the standard library's CSV reader."""
    rng = np.random.default_rng(1)
    n = 14_000
    bodies = {}
    for i in range(6):
        p, q = rng.normal(size=(n, 3)), rng.normal(size=(n, 4))
        p[100 * i:100 * i + 7], q[100 * i:100 * i + 7] = np.nan, np.nan
        bodies[f"b{i}"] = BodyTrack(p, q / np.linalg.norm(q, axis=1, keepdims=True))
    path = write_motive(tmp_path / "big.csv", bodies, 120.0)
    assert path.stat().st_size > 5_000_000
    rows = list(csv.reader(io.StringIO(path.read_text())))[7:]
    table = np.array([[float(c) if c else np.nan for c in row] for row in rows])
    r = read_motive(path)
    for i, body in enumerate(r.rigid_bodies.values()):
        np.testing.assert_array_equal(body.quat, table[:, [5 + 8 * i, 2 + 8 * i, 3 + 8 * i, 4 + 8 * i]])
        np.testing.assert_array_equal(body.p, table[:, 6 + 8 * i:9 + 8 * i])


def test_real_exports():
    folder = shared("data/motive")
    rb = read_recording(folder / "motive_1.21_rigidbody_rbmarker_marker_quat_m.csv")
    assert (rb.version, rb.rate, len(rb.frames), list(rb.rigid_bodies)) == ("1.21", 120.0, 250, ["Rigid Body 1"])
    assert len(rb.markers) == 12
    np.testing.assert_allclose(rb.rigid_bodies["Rigid Body 1"].quat[0], [-1, 3.5e-5, 1.6e-5, -3.0e-5])
    assert np.isnan(rb.markers["Unlabeled:106"][0]).all()
    holes = read_recording(folder / "motive_1.23_rigidbody_quat_m_pathviewr_example.csv")
    assert (holes.frames[0], len(holes.frames), list(holes.rigid_bodies)) == (72210, 934, ["device02", "device03", "device05"])
    assert holes.time[-1] == pytest.approx((105100 - 72210) / 100)
    assert any("frames missing: 31957" in p for p in holes.problems)
    markers = read_recording(folder / "motive_1.23_marker_mm_30Hz.csv")
    assert (len(markers.markers), markers.rigid_bodies, markers.rate, len(markers.frames)) == (11, {}, 30.0, 2032)
    first = markers.markers["Ard_her_20-317L_4jt7wing:cmc"][0]
    np.testing.assert_allclose(first, np.array([107.554214, 208.315002, -3.679659]) / 1000)
    bare = read_recording(folder / "motive_1.23_header_only_no_assets_mm_360Hz.csv")
    assert (bare.rate, len(bare.frames), bare.rigid_bodies, bare.markers) == (360.0, 1353, {}, {})
    np.testing.assert_allclose(np.diff(bare.time), 1 / 360)


