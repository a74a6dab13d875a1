"""The header of a Motive CSV export: the take's metadata, and the quantity in each column."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from workbench.files import InputError
from workbench.files.numerals import number_of
from workbench.files.tables import is_binary, split_row

_METRES = {"meters": 1.0, "metres": 1.0, "m": 1.0, "centimeters": 0.01, "centimetres": 0.01, "cm": 0.01,
           "millimeters": 0.001, "millimetres": 0.001, "mm": 0.001}
_ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
_MAX_LINES = 40  # no version has more than eight rows before the data


@dataclass
class Asset:
    """Columns of one rigid body, bone or marker, by quantity: {axis letter: column}."""

    name: str
    kind: str
    rotation: dict[str, int] = field(default_factory=dict)
    position: dict[str, int] = field(default_factory=dict)
    error: int | None = None

    def order(self, what: str) -> str:
        """Axis letters of its "rotation" or "position" in the order of the columns; empty where it has none."""
        columns: dict[str, int] = getattr(self, what)
        return "".join(sorted(columns, key=columns.__getitem__))


@dataclass(frozen=True)
class MotiveHeader:
    """metadata: row 1 as pairs. columns: how many. offset: bytes before the data. lines: rows before the data.
    timecode: column of the time code, if any. parents: asset -> parent (1.25)."""

    metadata: Mapping[str, str]
    columns: int
    offset: int
    lines: int
    assets: tuple[Asset, ...]
    timecode: int | None
    parents: Mapping[str, str]

    @property
    def version(self) -> str:
        """Format version, as the file says; empty where the header was switched off."""
        return self.metadata.get("Format Version", "")


def looks_like_motive(head: bytes) -> bool:
    """Whether a file that begins with `head` is a Motive export, with or without its metadata row."""
    if is_binary(head):
        return False
    text = head.decode("utf-8", "replace").lstrip("\ufeff").lstrip()
    return text.lstrip('"').startswith("Format Version") or re.search(r'(?m)^"?Frame"?,"?Time', text) is not None


def parse_header(source: str, content: memoryview) -> MotiveHeader:
    """Reads the rows up to the one that starts with `Frame`, wherever that is; InputError if there is none.

    Columns are identified by (type, name, kind, axis), never by their number, as versions differ in labels, a Parent row and a
    TimeCode column, and spreadsheets pad rows with empty cells.
    """
    rows: list[list[str]] = []
    offset = 0
    for _ in range(_MAX_LINES):
        line, offset = _next_line(content, offset)
        if line is None:
            break
        rows.append(split_row(_decode(line)))
        if rows[-1] and rows[-1][0] == "Frame":
            return _header(source, rows, offset)
    raise InputError(source, f"header: no row starts with 'Frame' in the first {len(rows)} lines; expected a whole Motive export")


def _next_line(content: memoryview, start: int) -> tuple[bytes | None, int]:
    if start >= len(content):
        return None, start
    size = 1 << 16
    while True:  # header rows are long if there are many assets
        chunk = bytes(content[start:start + size])
        end = chunk.find(b"\n")
        if end >= 0:
            return chunk[:end], start + end + 1
        if start + size >= len(content):
            return chunk, len(content)
        size *= 4


def _decode(line: bytes) -> str:
    try:
        return line.decode("utf-8-sig").rstrip("\r")
    except UnicodeDecodeError:  # exported on a Windows machine with its own code page
        return line.decode("cp1252", "replace").rstrip("\r")


def _header(source: str, rows: list[list[str]], offset: int) -> MotiveHeader:
    axes = rows[-1]
    kinds = rows[-2] if len(rows) > 1 else []
    has_metadata = rows[0][:1] == ["Format Version"]
    metadata = {k: v for k, v in zip(rows[0][::2], rows[0][1::2]) if k} if has_metadata else {}
    middle = [r for r in rows[1 if has_metadata else 0:-2] if any(r)]
    labelled = {label: r for r in middle for label in ("Type", "Name", "ID", "Parent") if label in r[:3]}
    if not labelled:  # up to 1.22 the rows carry no labels, only an order
        labelled = dict(zip(("Type", "Name", "ID"), middle))
    cell = lambda row, i: row[i] if i < len(row) else ""  # noqa: E731
    types, names, ids = (labelled.get(k, []) for k in ("Type", "Name", "ID"))
    assets: dict[tuple[str, str, str], Asset] = {}
    parents: dict[str, str] = {}
    timecode = None
    for i in range(2, len(axes)):
        kind, axis = cell(kinds, i), axes[i].upper()
        if axis.startswith("TIMECODE"):
            timecode = i
            continue
        name = cell(names, i)
        if not name or not kind:
            continue
        asset = assets.setdefault((cell(types, i), name, cell(ids, i)), Asset(name, cell(types, i)))
        if kind in ("Rotation", "Position") and axis in "XYZW" and axis:
            group = asset.rotation if kind == "Rotation" else asset.position
            if axis in group:
                raise InputError(source, f"header: column {i + 1} repeats {kind} {axis} of '{name}'")
            group[axis] = i
        elif "Error" in kind:
            asset.error = i
        if cell(labelled.get("Parent", []), i):
            parents[name] = cell(labelled["Parent"], i)
    for asset in assets.values():
        _check(source, asset)
    _check_orders(source, list(assets.values()))
    written = metadata.get("Rotation Type", "")
    if written.upper() in _ORDERS and any("W" in asset.rotation for asset in assets.values()):
        raise InputError(source, f"header: Rotation Type '{written}', Euler angles, but columns Rotation W, of quaternions; "
                                 "expected one of the two")
    return MotiveHeader(metadata, len(axes), offset, len(rows), tuple(assets.values()), timecode, parents)


def _check(source: str, asset: Asset) -> None:
    for what, group in (("Rotation", asset.rotation), ("Position", asset.position)):
        missing = set("XYZ") - set(group)
        if group and missing:
            raise InputError(source, f"header: {what} of '{asset.name}' has no column {sorted(missing)[0]}")
    if "W" in asset.position:
        raise InputError(source, f"header: column {asset.position['W'] + 1} is Position W of '{asset.name}'; a position has X, Y "
                                 "and Z")


def _check_orders(source: str, assets: list[Asset]) -> None:
    """InputError where columns of two assets have their axes in different orders: no export has, so that a name was exchanged."""
    for what in ("rotation", "position"):
        first: dict[int, tuple[str, str]] = {}
        for asset in assets:
            order = asset.order(what)
            other, name = first.setdefault(len(order), (order, asset.name))
            if order != other:
                raise InputError(source, f"header: {what.capitalize()} columns of '{name}' are in the order {','.join(other)}, "
                                         f"those of '{asset.name}' in {','.join(order)}; expected one order, as Motive writes")


def rewritten_orders(header: MotiveHeader) -> list[str]:
    """A line for each kind of column whose axes are not in the order in which Motive writes them: then another program wrote the
    header, the values or both, and only the names say what is in a column."""
    out = []
    for what in ("rotation", "position"):
        orders = {asset.order(what) for asset in header.assets} - {""}
        for order in sorted(orders - {"XYZW", "XYZ"}):
            own = "".join(sorted(order, key="XYZW".index))
            out.append(f"the header has {what} columns in the order {','.join(order)}, where Motive writes {','.join(own)}: "
                       "another program changed this file; each column is read by its name: check that its values moved along")
    return out


def metres_per_unit(source: str, header: MotiveHeader) -> float:
    """Factor from the file's lengths to metres; metres where the header does not say."""
    unit = header.metadata.get("Length Units", "Meters")
    if unit.lower() not in _METRES:
        raise InputError(source, f"header: Length Units '{unit}'; expected Meters, Centimeters or Millimeters")
    return _METRES[unit.lower()]


def euler_order(source: str, header: MotiveHeader) -> str:
    """Order of the intrinsic Euler angles that the header names."""
    text = header.metadata.get("Rotation Type", "")
    found = re.search("|".join(_ORDERS), text.upper())
    if found is None:
        raise InputError(source, f"header: Rotation Type '{text}' with three columns; expected one of {', '.join(_ORDERS)}")
    return found.group()


def number(source: str, header: MotiveHeader, key: str) -> float | None:
    """A positive number of the metadata row; None where it is missing."""
    text = header.metadata.get(key, "")
    if not text:
        return None
    value = number_of(text.replace(",", "."))
    if value is None or not 1e-3 <= value <= 1e9:
        raise InputError(source, f"header: {key} is '{text[:40]}'; expected a positive number")
    return value
